//! Names the effects that the whole record shows in a channel: which of them are reported, with their bounds and with evidence
//! that a person can check.

use crate::OCTAVES;
use crate::bounds::{BoundedEstimate, ChannelEstimate, MeasuredValue};
use crate::detectors::random_telegraph::is_reversible;
use crate::distributions::ROUNDING;
use crate::effects::findings::SIGNIFICANCE;
use crate::effects::{
    AccelerationSensitivity, AngleQuantization, BandMismatch, CommonMode, CurveEvidence, Effect, FirstOrderFilter,
    LineEvidence, LineSource, LinearDrift, LinearDriftEvidence, MarkovEvidence, MarkovProcess, Observation,
    OutputFilter, Refutation, ResonantLine, SharedDrift, SinusoidalLine, SpectrumEvidence, SupplySensitivity,
    TelegraphEvidence, TelegraphNoise, TemperatureSensitivity, Unexplained, UnexplainedPlace,
};
use crate::fit::channel_fit::{ChannelFit, DITHERED_OCTAVES, FREQUENCY_BY_OCTAVES};
use crate::fit::noise_terms::{filter_length_s, is_white, line_frequency};
use crate::fit::traced_model::Addition;
use crate::rivals::slow_drift::ChannelsInCommon;
use crate::samples::gapped_cascade::GappedCascade;
use crate::samples::streamed_curves::STEPS_PER_COUNT;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::Modulation;
use crate::spectra::spectral_lines::{FEW_PERIODS, MergedLine};
use allan_core::confidence::NORMAL_975;
use allan_core::model::FittedTerm;
use allan_core::regression::Sensitivity;
use allan_core::telegraph::{self, KurtosisRatio};
use allan_core::term::{Markov, MovingAverageFilter, NoiseTerm, Shape};
use allan_core::term::{Resonance, Sinusoid};
use allan_core::{AllanPoint, Curve, Model};
use measurement::{ChannelProfile, Quantity, SensorProfile};
use std::f64::consts::PI;

/// In a channel that is not dithered, two levels closer than this, in steps of its resolution, are two neighbouring counts, and a
/// correlated process of no more than their deviation is the rounding error.
const NEIGHBOURING_COUNTS: f64 = 1.5;
/// In a channel that is not dithered, the rounding error is correlated over about this many lengths of the filter.
const ROUNDING_FILTER_LENGTHS: f64 = 20.0;
/// Longest time constant, in samples, of a Markov process that is named a low-pass filter.
const MAX_LOW_PASS_SAMPLES: f64 = 64.0;
/// Upper bound of the bandwidth of a resonance that the curve alone shows, in units of its frequency: a wider one is no band.
const WIDEST_BAND: f64 = 2.0;
/// Largest excess kurtosis of a telegraph signal that the curve alone shows, in units of that of two equally frequent levels. A
/// signal that is at one level for a part `p` of the time has `(1/(p·(1−p)) − 2)/2` times as much at averaging times below its
/// time constant: 1.5 for 28 %. The samples themselves show less even ones.
const LARGEST_KURTOSIS_RATIO: f64 = 1.5;
/// How many times as likely a Gaussian process is as a telegraph signal, where it is named: a probability of 95 % where the two are as
/// frequent.
const TOLD_APART: f64 = 19.0;

/// What was found in a channel over the whole record.
pub(crate) struct ChannelFindings<'a> {
    pub channel: ChannelProfile,
    /// Smallest distance of two values, in the channel's unit.
    pub resolution: f64,
    pub fit: &'a ChannelFit,
    /// The covariates and the channel's sensitivities to them.
    pub sensitivities: Vec<(ChannelProfile, Sensitivity)>,
    /// Lines of the spectrum; `None` if they were not sought.
    pub lines: Option<&'a [MergedLine]>,
    /// Random telegraph noise in the samples.
    pub telegraph: Option<&'a TelegraphNoise>,
    /// Drift that the channel has in common with others.
    pub common: Option<&'a ChannelsInCommon>,
    /// The samples less the share of the covariates.
    pub rest: Option<&'a UniformSeries>,
}

/// The effects of a channel beyond the baseline model, without those that preprocessing found.
pub(crate) fn name_effects(profile: &SensorProfile, findings: &ChannelFindings) -> Vec<Effect> {
    let &ChannelFindings { channel, resolution, fit, lines, common, .. } = findings;
    let (model, unit, period_s) = (fit.after(), channel.unit, fit.after().sample_period());
    let (plausible, implausible): (Vec<_>, Vec<_>) = findings
        .sensitivities
        .iter()
        .copied()
        .partition(|(regressor, sensitivity)| is_plausible(profile, channel, regressor.quantity, sensitivity));
    let mut effects = sensitivity_effects(&plausible, unit);
    effects.extend(implausible.iter().map(|(regressor, of)| shared_drift_effect(profile, channel, *regressor, of)));
    // Without dither the rounding error is no white noise, and the curve shows the steps of the rounding.
    let is_dithered = fit.is_dithered(profile, resolution, DITHERED_OCTAVES);
    let is_dithered_at_once = fit.is_dithered(profile, resolution, 1);
    let is_rounding =
        |found: &&TelegraphNoise| !is_dithered_at_once && found.amplitude.value < NEIGHBOURING_COUNTS * resolution;
    let telegraph = findings.telegraph.filter(|found| !is_rounding(found));
    let rounding_s = if is_dithered_at_once { 0.0 } else { ROUNDING_FILTER_LENGTHS * filter_length_s(model) };
    // Two levels have half their distance as their deviation.
    let is_rounding_error = |term: &FittedTerm| 2.0 * term.low < NEIGHBOURING_COUNTS * resolution;
    let duration_s = fit.covariates.curve.samples() as f64 * period_s;
    let in_spectrum: Vec<Effect> = lines
        .unwrap_or_default()
        .iter()
        .map(|line| line_effect(line, fit, unit))
        .filter(|effect| is_shown(effect, duration_s))
        .collect();
    let unexplained = |found: &Addition, term: Option<&FittedTerm>, by: Refutation| {
        unexplained_octave(found, &fit.covariates.curve, term, by)
    };
    for (term, found) in fit.traced.added() {
        let curve = curve_evidence(found, period_s);
        match term.kind {
            NoiseTerm::Filtered(filter) => {
                effects.push(filter_effect(term, &filter, curve, unit, profile.internal_rate_hz));
            }
            _ if !is_dithered => {}
            NoiseTerm::Markov(Markov { time_constant }) if time_constant < rounding_s && is_rounding_error(term) => {}
            NoiseTerm::Quantization if rounding_s > 0.0 => {}
            // Reported from the spectrum, which resolves them better than the curve.
            NoiseTerm::Sinusoid(_) | NoiseTerm::Resonance(_) if is_in_spectrum(&term.kind, &in_spectrum) => {}
            NoiseTerm::Sinusoid(_) | NoiseTerm::Resonance(_) if rounding_s > 0.0 && is_rounding_error(term) => {}
            NoiseTerm::Sinusoid(_) | NoiseTerm::Resonance(_) if has_few_periods(&term.kind, duration_s) => {
                effects.push(unexplained(found, Some(term), Refutation::FewPeriods));
            }
            // In the curve alone: its frequency changes, or it is no line.
            NoiseTerm::Sinusoid(Sinusoid { frequency }) | NoiseTerm::Resonance(Resonance { frequency, .. })
                if lines.is_some() && !is_band(term, duration_s) =>
            {
                // Above a line of the spectrum, one of the harmonics of that beyond those that the spectrum lists.
                if has_line_below(&in_spectrum, frequency) {
                    continue;
                }
                effects.push(unexplained(found, Some(term), Refutation::NotInSpectrum { frequency_hz: frequency }));
            }
            // In the curve, random telegraph noise and a common-mode drift look like these.
            NoiseTerm::Markov(_) | NoiseTerm::RateRamp if telegraph.is_some() || common.is_some() => {}
            NoiseTerm::Markov(markov) if is_low_pass(model, markov, resolution) => {
                effects.push(low_pass_effect(term, markov, curve));
            }
            NoiseTerm::Markov(Markov { time_constant })
                if findings.rest.is_some_and(|rest| !is_reversible(rest, time_constant)) =>
            {
                effects.push(unexplained(found, None, Refutation::Irreversible { time_constant_s: time_constant }));
            }
            NoiseTerm::Markov(_) if let Some(by_spectrum) = &fit.markov_by_spectrum => {
                let corner_hz = 0.5 / (PI * by_spectrum.time_constant.value);
                effects.push(markov_effect(term, MarkovEvidence::Spectrum { corner_hz, gain: by_spectrum.gain }, unit));
            }
            NoiseTerm::Markov(markov) => match kurtosis_ratio(fit, findings.rest, resolution, markov) {
                // Beside a telegraph signal it is that one's.
                Some(_) if effects.iter().any(|effect| matches!(effect, Effect::TelegraphNoise(_))) => {
                    effects.push(markov_effect(term, MarkovEvidence::Curve(curve), unit));
                }
                Some(kurtosis) if kurtosis.ratio - 3.0 * kurtosis.error > LARGEST_KURTOSIS_RATIO => {
                    effects.push(unexplained(found, None, rare_disturbances(markov, &kurtosis)));
                }
                Some(kurtosis) if kurtosis.is_telegraph() => {
                    effects.push(telegraph_effect(term, &kurtosis, curve, unit));
                }
                Some(kurtosis) if !is_gaussian(&kurtosis) => {
                    effects.push(unexplained(found, None, undecided_levels(markov, &kurtosis)));
                }
                _ => effects.push(markov_effect(term, MarkovEvidence::Curve(curve), unit)),
            },
            _ => effects.extend(term_effect(term, curve, unit)),
        }
    }
    keep_first_octave(&mut effects);
    effects.extend(telegraph.map(|found| Effect::from(*found)));
    effects.extend(common.map(|common| common_mode_effect(common, channel, unit)));
    effects.extend(in_spectrum);
    effects.retain(|effect| is_shown(effect, duration_s));
    effects
}

/// Whether a kurtosis is [`TOLD_APART`] times as likely that of a Gaussian process, 0, as that of a telegraph signal, 1.
fn is_gaussian(kurtosis: &KurtosisRatio) -> bool {
    (0.5 - kurtosis.ratio) / kurtosis.error.powi(2) > TOLD_APART.ln()
}

/// Kurtosis of a Markov term of the model. That of the curve of a channel with covariates is theirs as well, such as that of a
/// supply that jumps; so it is estimated from the samples less their share, `rest`, in steps of the `resolution`.
fn kurtosis_ratio(
    fit: &ChannelFit,
    rest: Option<&UniformSeries>,
    resolution: f64,
    markov: Markov,
) -> Option<KurtosisRatio> {
    let model = fit.after();
    if fit.covariates.is_empty() {
        return telegraph::kurtosis_ratio(&fit.covariates.curve, model, markov);
    }
    let rest = rest?;
    let mut estimator = GappedCascade::default();
    let step = resolution / STEPS_PER_COUNT;
    estimator.push_values(rest.values(), step);
    telegraph::kurtosis_ratio(&estimator.curve(rest.sample_period()).scaled(step), model, markov)
}

/// Of several terms that stand for one thing that has no name, leaves the first, which was the clearest, and the lines.
fn keep_first_octave(effects: &mut Vec<Effect>) {
    let mut is_first = true;
    effects.retain(|effect| {
        let is_octave = matches!(effect, Effect::Unexplained(of) if of.frequency_hz().is_none());
        !is_octave || std::mem::take(&mut is_first)
    });
}

/// Whether the data shows an effect: the interval of its size excludes 0, and it lasts no longer than the record of
/// `duration_s` seconds.
fn is_shown(effect: &Effect, duration_s: f64) -> bool {
    let time_constant_s = match effect {
        Effect::MarkovProcess(of) => Some(of.time_constant_s),
        Effect::TelegraphNoise(of) => Some(of.time_constant_s),
        Effect::CommonMode(of) => Some(of.time_constant_s),
        _ => None,
    };
    let excludes_0 = |of: &BoundedEstimate| of.low > 0.0 || of.high < 0.0;
    // Of several axes some may be 0, and the size of what is unexplained is told as it is.
    let may_be_0 = matches!(effect, Effect::AccelerationSensitivity(_) | Effect::Unexplained(_));
    time_constant_s.is_none_or(|of| of.value < duration_s) && (may_be_0 || effect.sizes().iter().all(excludes_0))
}

/// Whether a line of the model is one of `lines`, the effects by the spectrum: its frequency by the curve, whose octaves tell it
/// to some tenths, is that of an effect.
fn is_in_spectrum(kind: &NoiseTerm, lines: &[Effect]) -> bool {
    let Some(frequency) = line_frequency(kind) else { return false };
    lines.iter().any(|line| {
        let bandwidth = if let Effect::ResonantLine(of) = line { of.bandwidth_hz.value } else { 0.0 };
        let reach = (FREQUENCY_BY_OCTAVES * frequency).max(0.5 * bandwidth);
        line.frequency_hz().is_some_and(|of| (of.value - frequency).abs() < reach)
    })
}

/// Whether a term is a resonance of whose bandwidth a record of this length bounds both sides.
fn is_band(term: &FittedTerm, duration_s: f64) -> bool {
    let Shape::Resonance { bandwidth: (narrowest, widest), .. } = term.shape else { return false };
    matches!(term.kind, NoiseTerm::Resonance(of) if narrowest > 1.0 / duration_s && widest < WIDEST_BAND * of.frequency)
}

/// Whether one of `lines`, the effects by the spectrum, is at a lower frequency than a line of the curve, which is known to some
/// tenths.
fn has_line_below(lines: &[Effect], frequency: f64) -> bool {
    let below =
        |line: &Effect| line.frequency_hz().is_some_and(|of| of.value < (1.0 + FREQUENCY_BY_OCTAVES) * frequency);
    lines.iter().any(below)
}

/// Whether a line has fewer periods in the record than lines are searched for: its curve alone does not tell it from drift.
fn has_few_periods(kind: &NoiseTerm, duration_s: f64) -> bool {
    line_frequency(kind).is_some_and(|frequency| frequency * duration_s < FEW_PERIODS)
}

/// Whether a Markov term is white noise behind a first-order low-pass filter: its time constant is short, and the white
/// noise, filtered or not, is no larger than the rounding error.
fn is_low_pass(model: &Model, markov: Markov, resolution: f64) -> bool {
    let period_s = model.sample_period();
    let rounding = ROUNDING * resolution * resolution * period_s;
    let white = model.terms().iter().filter(|term| is_white(&term.kind));
    let left: f64 = white.map(|term| term.low * term.low).sum();
    markov.time_constant < MAX_LOW_PASS_SAMPLES * period_s && left <= rounding
}

/// What the curve shows of a term that was added.
fn curve_evidence(found: &Addition, period_s: f64) -> CurveEvidence {
    let residual = found.residual;
    CurveEvidence {
        excess: residual.excess,
        tau_s: residual.n as f64 * period_s,
        sigmas: residual.sigmas,
        gain_sigmas: found.score.sqrt(),
    }
}

/// The coefficient of a term of a channel in `unit`.
fn coefficient(term: &FittedTerm, unit: &'static str) -> ChannelEstimate {
    BoundedEstimate::new(term.value, term.low, term.high).in_unit(unit)
}

/// The parameter of the shape of a term at this position; 0 where it has none.
fn shape(term: &FittedTerm, position: usize) -> BoundedEstimate {
    let (value, (low, high)) =
        term.shape_parameters().nth(position).map_or((0.0, (0.0, 0.0)), |(_, value, bounds)| (value, bounds));
    BoundedEstimate::new(value, low, high)
}

/// A term that was added to the baseline model. A filter and a Markov process are told by more than the term, and the terms of the
/// baseline are no effects.
fn term_effect(term: &FittedTerm, curve: CurveEvidence, unit: &'static str) -> Option<Effect> {
    let line = |has_width: bool| LineEvidence { has_width, source: LineSource::Curve(curve) };
    match term.kind {
        NoiseTerm::Quantization => {
            Some(AngleQuantization { coefficient: coefficient(term, unit), evidence: curve }.into())
        }
        NoiseTerm::RateRamp => {
            let evidence = LinearDriftEvidence::Curve(curve);
            Some(LinearDrift { slope: coefficient(term, unit), evidence }.into())
        }
        NoiseTerm::Resonance(_) => Some(
            ResonantLine {
                frequency_hz: shape(term, 0),
                bandwidth_hz: shape(term, 1),
                deviation: coefficient(term, unit),
                multiples: None,
                evidence: line(true),
            }
            .into(),
        ),
        NoiseTerm::Sinusoid(_) => Some(
            SinusoidalLine {
                frequency_hz: shape(term, 0),
                amplitude: coefficient(term, unit),
                multiples: None,
                evidence: line(false),
            }
            .into(),
        ),
        NoiseTerm::Markov(_)
        | NoiseTerm::Filtered(_)
        | NoiseTerm::AngleRandomWalk
        | NoiseTerm::BiasInstability
        | NoiseTerm::RateRandomWalk => None,
    }
}

/// A filter that was added to the baseline model, in a sensor whose internal sample rate is `internal_rate_hz`.
fn filter_effect(
    term: &FittedTerm,
    filter: &MovingAverageFilter,
    curve: CurveEvidence,
    unit: &'static str,
    internal_rate_hz: f64,
) -> Effect {
    OutputFilter {
        taps: shape(term, 0),
        decimation: shape(term, 1),
        white_noise: coefficient(term, unit),
        stages: filter.stages,
        internal_rate_hz,
        evidence: curve,
    }
    .into()
}

/// An estimate with the 95 % bounds of a normal distribution, of a quantity that is not negative.
fn normal_bounds(estimate: MeasuredValue) -> BoundedEstimate {
    let half_width = NORMAL_975 * estimate.error;
    BoundedEstimate::new(estimate.value, (estimate.value - half_width).max(0.0), estimate.value + half_width)
}

/// A Markov term of a channel in `unit`.
fn markov_effect(term: &FittedTerm, evidence: MarkovEvidence, unit: &'static str) -> Effect {
    let time_constant_s = shape(term, 0);
    MarkovProcess { deviation: coefficient(term, unit), time_constant_s, evidence }.into()
}

/// A Markov term whose kurtosis is that of random telegraph noise.
fn telegraph_effect(term: &FittedTerm, kurtosis: &KurtosisRatio, curve: CurveEvidence, unit: &'static str) -> Effect {
    TelegraphNoise {
        time_constant_s: shape(term, 0),
        // Two levels that are equally frequent are two standard deviations apart.
        amplitude: coefficient(term, unit).scaled(2.0),
        evidence: TelegraphEvidence::Kurtosis { ratio: kurtosis.ratio, error: kurtosis.error, curve },
    }
    .into()
}

/// A Markov term with the kurtosis of rare disturbances.
fn rare_disturbances(markov: Markov, kurtosis: &KurtosisRatio) -> Refutation {
    Refutation::RareDisturbances { time_constant_s: markov.time_constant, kurtosis: [kurtosis.ratio, kurtosis.error] }
}

/// A Markov term whose kurtosis does not tell whether it has two levels.
fn undecided_levels(markov: Markov, kurtosis: &KurtosisRatio) -> Refutation {
    Refutation::UndecidedLevels { time_constant_s: markov.time_constant, kurtosis: [kurtosis.ratio, kurtosis.error] }
}

/// A term that fits an octave of the curve and is contradicted; `line` is the term where that is a line.
fn unexplained_octave(found: &Addition, curve: &Curve<OCTAVES>, line: Option<&FittedTerm>, by: Refutation) -> Effect {
    let point = curve.points().iter().find(|point| point.n == found.residual.n);
    // Of the measured deviation at this averaging time; that of the model is taken as exact.
    let bound = |of: fn(&AllanPoint) -> f64| point.map_or(1.0, |point| (of(point) / point.avar).sqrt());
    let percent = |factor: f64| 100.0 * ((1.0 + found.residual.excess) * factor - 1.0);
    let (low, high) = (percent(bound(|point| point.low)), percent(bound(|point| point.high)));
    let evidence = curve_evidence(found, curve.sample_period());
    let tau_s = BoundedEstimate::exact(evidence.tau_s);
    let frequency_hz = line.filter(|term| line_frequency(&term.kind).is_some()).map(|term| shape(term, 0));
    Unexplained {
        place: match frequency_hz {
            Some(frequency_hz) => UnexplainedPlace::LineOfCurve { tau_s, frequency_hz },
            None => UnexplainedPlace::AveragingTime(tau_s),
        },
        excess_percent: Some(BoundedEstimate::new(percent(1.0), low, high)),
        observation: Observation::RefutedTerm { curve: evidence, by },
    }
    .into()
}

/// A Markov term in the place of the white noise.
fn low_pass_effect(term: &FittedTerm, markov: Markov, curve: CurveEvidence) -> Effect {
    let corner = |time_constant: f64| 0.5 / (PI * time_constant);
    let BoundedEstimate { low, high, .. } = shape(term, 0);
    FirstOrderFilter {
        bandwidth_hz: BoundedEstimate::new(corner(markov.time_constant), corner(high), corner(low)),
        time_constant_s: markov.time_constant,
        evidence: curve,
    }
    .into()
}

/// A sensitivity with its bounds, of a channel in `unit`.
fn bounded(sensitivity: &Sensitivity, unit: &'static str) -> ChannelEstimate {
    let (low, high) = sensitivity.bounds();
    BoundedEstimate::new(sensitivity.value, low, high).in_unit(unit)
}

/// Sensitivities to temperature, to supply, and to the specific force on all axes as one effect.
fn sensitivity_effects(sensitivities: &[(ChannelProfile, Sensitivity)], unit: &'static str) -> Vec<Effect> {
    let single = |regressor: Quantity| {
        let (_, sensitivity) = sensitivities.iter().find(|(channel, _)| channel.quantity == regressor)?;
        Some((bounded(sensitivity, unit), sensitivity.sigmas()))
    };
    let forces = || sensitivities.iter().filter(|(channel, _)| channel.quantity == Quantity::SpecificForce);
    let acceleration = forces().next().is_some().then(|| {
        let along = |axis: &str| forces().find(|(channel, _)| channel.axis == axis).map(|(_, of)| bounded(of, unit));
        AccelerationSensitivity {
            sensitivity: AccelerationSensitivity::AXES.map(along),
            sigmas: forces().map(|(_, sensitivity)| sensitivity.sigmas()).fold(0.0, f64::max),
        }
    });
    let temperature = single(Quantity::Temperature)
        .map(|(sensitivity, sigmas)| Effect::from(TemperatureSensitivity { sensitivity, sigmas }));
    let supply = single(Quantity::SupplyVoltage)
        .map(|(sensitivity, sigmas)| Effect::from(SupplySensitivity { sensitivity, sigmas }));
    temperature.into_iter().chain(supply).chain(acceleration.map(Effect::from)).collect()
}

/// Whether a sensitivity of a channel is more probably one of the sensor's than not, by what is known of the sensor: its value, the
/// middle of its interval, is within the largest plausible multiple of the data sheet's, or the interval includes zero.
fn is_plausible(
    profile: &SensorProfile,
    channel: ChannelProfile,
    regressor: Quantity,
    sensitivity: &Sensitivity,
) -> bool {
    let (low, high) = sensitivity.bounds();
    let typical = channel.sensitivities.to(regressor);
    let includes_zero = low * high <= 0.0;
    typical.is_none_or(|typical| {
        includes_zero || sensitivity.value.abs() <= profile.largest_sensitivity_multiple * typical
    })
}

/// Drift that a channel shares with another one, too large to be caused by what that one measures.
fn shared_drift_effect(
    profile: &SensorProfile,
    channel: ChannelProfile,
    regressor: ChannelProfile,
    sensitivity: &Sensitivity,
) -> Effect {
    SharedDrift {
        ratio: bounded(sensitivity, channel.unit),
        per: regressor.unit,
        with: regressor.name,
        sigmas: sensitivity.sigmas(),
        largest_multiple: profile.largest_sensitivity_multiple,
    }
    .into()
}

/// A line of the spectrum beside what `fit` has.
fn line_effect(line: &MergedLine, fit: &ChannelFit, unit: &'static str) -> Effect {
    let model = fit.after();
    if line.shape_p_value < SIGNIFICANCE {
        return unexplained_band(line, model, BandMismatch::Shape { p_value: line.shape_p_value });
    }
    if line.is_broad() && fit.refutes(&line.kind()) {
        return unexplained_band(line, model, BandMismatch::Curve);
    }
    if let Some(modulation) = &line.modulation {
        return modulated_line(line, modulation);
    }
    let frequency_hz = normal_bounds(line.frequency);
    let evidence = |has_width: bool| LineEvidence {
        has_width,
        source: LineSource::Spectrum(SpectrumEvidence {
            frequency_hz: line.frequency.value,
            width_hz: line.is_wider_than_resolution().then_some(line.width.value),
            sigmas: line.statistic.sqrt(),
            p_value: line.p_value,
        }),
    };
    // To the curve a line of a few phase changes in the record is a sinusoid; the spectrum tells it from one.
    if matches!(line.kind(), NoiseTerm::Resonance(_)) || line.is_band() {
        let deviation = normal_bounds(line.deviation).in_unit(unit);
        let bandwidth_hz = normal_bounds(line.width);
        return ResonantLine { frequency_hz, bandwidth_hz, deviation, multiples: None, evidence: evidence(true) }
            .into();
    }
    let MeasuredValue { value, error } = line.deviation;
    let root = 2f64.sqrt();
    let amplitude = normal_bounds(MeasuredValue { value: root * value, error: root * error }).in_unit(unit);
    SinusoidalLine { frequency_hz, amplitude, multiples: None, evidence: evidence(false) }.into()
}

/// A line whose amplitude or phase changes.
fn modulated_line(line: &MergedLine, modulation: &Modulation) -> Effect {
    // The part of the deviation that is in the sidebands: the amplitude of either is half the depth of that of the line.
    let percent = |depth: f64| 100.0 * depth / (2.0 + depth * depth).sqrt();
    let MeasuredValue { value, error } = modulation.depth;
    let excess_percent = BoundedEstimate::new(
        percent(value),
        percent((value - NORMAL_975 * error).max(0.0)),
        percent(value + NORMAL_975 * error),
    );
    Unexplained {
        place: UnexplainedPlace::Frequency(normal_bounds(line.frequency)),
        excess_percent: Some(excess_percent),
        observation: Observation::ModulatedLine {
            sigmas: line.statistic.sqrt(),
            sideband_hz: modulation.frequency,
            depth: value,
            of_phase: modulation.of_phase,
        },
    }
    .into()
}

/// A band of the spectrum that stands out of the noise and is no resonance.
fn unexplained_band(line: &MergedLine, model: &Model, mismatch: BandMismatch) -> Effect {
    let (centre, half) = (line.frequency.value, 0.5 * line.width.value);
    let is_noise = |kind: &NoiseTerm| !matches!(kind, NoiseTerm::Resonance(_) | NoiseTerm::Sinusoid(_));
    let noise = Model::new(model.sample_period(), model.terms().iter().copied().filter(|term| is_noise(&term.kind)));
    // One-sided densities: the mean of the band that holds half of a line's power, and that of the noise.
    let density = 0.5 * line.deviation.value.powi(2) / line.width.value;
    let excess = |times: f64| 100.0 * ((1.0 + times * density / (2.0 * noise.density(centre))).sqrt() - 1.0);
    let relative = NORMAL_975 * 2.0 * line.deviation.error / line.deviation.value;
    let percent = BoundedEstimate::new(excess(1.0), excess((1.0 - relative).max(0.0)), excess(1.0 + relative));
    // An interval wider than the share says nothing of it.
    let is_known = percent.high - percent.low <= percent.value;
    let frequency_hz = BoundedEstimate::new(centre, (centre - half).max(0.0), centre + half);
    Unexplained {
        place: UnexplainedPlace::Frequency(frequency_hz),
        excess_percent: is_known.then_some(percent),
        observation: Observation::Band { width_hz: line.width.value, sigmas: line.statistic.sqrt(), mismatch },
    }
    .into()
}

/// Drift that `channel` has in common with others.
fn common_mode_effect(common: &ChannelsInCommon, channel: ChannelProfile, unit: &'static str) -> Effect {
    CommonMode {
        deviation: common.drift.deviation.in_unit(unit),
        time_constant_s: common.drift.time_constant,
        others: common.names.iter().copied().filter(|other| *other != channel.name).collect(),
        gain: common.gain,
    }
    .into()
}

#[cfg(test)]
mod tests {
    use super::is_gaussian;
    use allan_core::telegraph::KurtosisRatio;

    /// The ratio of two normal densities of one deviation, written out.
    #[test]
    fn a_gaussian_process_is_named_where_it_is_nineteen_times_as_likely() {
        let likelihood = |ratio: f64, error: f64, truth: f64| (-0.5 * ((ratio - truth) / error).powi(2)).exp();
        for error in [0.05, 0.1, 0.3, 1.0, 30.0] {
            for ratio in [-0.5, 0.0, 0.2, 0.45, 0.5, 1.0] {
                let (gaussian, telegraph) = (likelihood(ratio, error, 0.0), likelihood(ratio, error, 1.0));
                let expected = gaussian > 19.0 * telegraph || (gaussian == 0.0 && ratio < 0.5);
                assert_eq!(is_gaussian(&KurtosisRatio { ratio, error }), expected, "{ratio} {error}");
            }
        }
    }
}
