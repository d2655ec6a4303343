//! Proposals by the model, the spectrum and the covariates of a channel, with bounds and with evidence that a person can check. The
//! [table](crate::rivals::table) decides which of them stand.

use crate::OCTAVES;
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use crate::detectors::random_telegraph::{Law, is_reversible};
use crate::effects::findings::{REFUTED, TOLD_APART};
use crate::effects::{
    AccelerationSensitivity, AngleQuantization, BandMismatch, CommonMode, CurveEvidence, Effect, LineEvidence,
    LineSource, LinearDrift, LinearDriftEvidence, LowPassDesign, LowPassFilter, MarkovEvidence, MarkovProcess,
    ModulatedLine, ModulationEvidence, Observation, OutputFilter, Refutation, ResonantLine, SharedDrift,
    SinusoidalLine, SpectrumEvidence, SupplySensitivity, TelegraphEvidence, TelegraphNoise, TemperatureSensitivity,
    Unexplained, UnexplainedPlace,
};
use crate::fit::channel_fit::ChannelFit;
use crate::fit::noise_terms::{MAX_LOW_PASS_SAMPLES, filter_length_s, is_filter, is_white, line_frequency};
use crate::fit::traced_model::Addition;
use crate::rivals::proposal::{ChannelFacts, Origin, Proposal};
use crate::rivals::slow_drift::ChannelsInCommon;
use crate::rivals::unexplained::MIN_EXCESS;
use crate::samples::gapped_cascade::GappedCascade;
use crate::samples::rounding::{DITHERED_OCTAVES, Rounding};
use crate::samples::streamed_curves::STEPS_PER_COUNT;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::spectral_lines::{FEW_PERIODS, MergedLine};
use crate::spectra::{Modulation, without_sines_at};
use allan_core::confidence::NORMAL_975;
use allan_core::model::FittedTerm;
use allan_core::regression::Sensitivity;
use allan_core::telegraph::{self, KurtosisRatio};
use allan_core::term::{LowPass, Markov, MovingAverageFilter, NoiseTerm, Shape};
use allan_core::{AllanPoint, Curve, Model};
use measurement::{ChannelProfile, Quantity, SensorProfile};
use std::f64::consts::{PI, SQRT_2};

/// Frequency of a line, in halves of the sample rate, above which it is one at half of the rate: the search ends one resolution below it.
const NO_HIGHER: f64 = 1.0 - 1e-9;

/// Upper bound of the bandwidth of a resonance that the curve alone shows, in units of its frequency: a wider one is no band.
const WIDEST_BAND: f64 = 2.0;
/// Largest excess kurtosis of a telegraph signal that the curve alone shows, in units of that of two equally frequent levels. A
/// signal that is at one level for a part `p` of the time has `(1/(p·(1−p)) − 2)/2` times as much at averaging times below its
/// time constant: 1.5 for 28 %. The samples themselves show less even ones.
const LARGEST_KURTOSIS_RATIO: f64 = 1.5;

pub(crate) struct ChannelFindings<'a> {
    pub channel: ChannelProfile,
    pub resolution: f64,
    pub fit: &'a ChannelFit,
    /// The covariates and the channel's sensitivities to them.
    pub sensitivities: Vec<(ChannelProfile, Sensitivity)>,
    /// Lines of the spectrum; `None` if they were not sought.
    pub lines: Option<&'a [MergedLine]>,
    /// Random telegraph noise in the samples.
    pub telegraph: Option<&'a TelegraphNoise>,
    pub common: Option<&'a ChannelsInCommon>,
    /// The samples less the share of the covariates.
    pub rest: Option<&'a UniformSeries>,
}

/// Proposals of a channel beyond the baseline model, without those of preprocessing, and the properties that decide between them.
pub(crate) fn propose(profile: &SensorProfile, findings: &ChannelFindings) -> (Vec<Proposal>, ChannelFacts) {
    let &ChannelFindings { channel, resolution, fit, lines, .. } = findings;
    let (unit, period_s) = (channel.unit, fit.after().sample_period());
    let facts = ChannelFacts {
        resolution,
        period_s,
        duration_s: fit.covariates.curve.samples() as f64 * period_s,
        avar: fit.curve.points().first().map_or(0.0, |point| point.avar),
        is_dithered: fit.is_dithered(profile, resolution, DITHERED_OCTAVES),
        is_dithered_at_once: fit.is_dithered(profile, resolution, 1),
        slope_of_ends: None,
    };
    let mut proposals = sensitivity_proposals(profile, channel, &findings.sensitivities);
    for (number, (term, found)) in fit.traced.added().into_iter().enumerate() {
        let effects = term_effects(profile, findings, &facts, (term, found)).into_iter();
        let origin = Origin::Term { number, kind: term.kind };
        proposals.extend(effects.map(|effect| Proposal { effect, origin: origin.clone() }));
    }
    let of_levels = |found: &TelegraphNoise| {
        let is_reversible = findings.rest.is_none_or(|rest| is_reversible(rest, found.time_constant_s.value));
        Proposal::new(*found, Origin::Levels { is_reversible })
    };
    proposals.extend(findings.telegraph.map(of_levels));
    let in_common = |common| Proposal::new(common_mode_effect(common, channel, unit), Origin::CrossSpectra);
    proposals.extend(findings.common.map(in_common));
    let of_line = |line: &MergedLine| {
        Some(Proposal::new(line_effect(line, fit, unit)?, Origin::Line { is_slow: line.is_slow() }))
    };
    proposals.extend(lines.unwrap_or_default().iter().filter_map(of_line));
    (proposals, facts)
}

fn term_effects(
    profile: &SensorProfile,
    findings: &ChannelFindings,
    facts: &ChannelFacts,
    (term, found): (&FittedTerm, &Addition),
) -> Vec<Effect> {
    let &ChannelFindings { channel: ChannelProfile { unit, .. }, fit, lines, .. } = findings;
    let curve = curve_evidence(found, facts.period_s);
    let line = |has_width: bool| LineEvidence { has_width, source: LineSource::Curve(curve) };
    let unexplained = |by: Refutation| unexplained_octave(found, &fit.curve, term, by);
    let mut effects = match term.kind {
        NoiseTerm::LowPass(filter) => vec![second_order_effect(term, &filter, curve)],
        NoiseTerm::Filtered(filter) => vec![filter_effect(term, &filter, curve, unit, profile.internal_rate_hz)],
        NoiseTerm::Quantization => {
            let refuted = fit.quantization_p_value.filter(|p_value| *p_value < REFUTED);
            let refuted = refuted.map(|p_value| unexplained(Refutation::ShapeOfSpectrum { p_value }));
            let quantization = AngleQuantization { coefficient: coefficient(term, unit), evidence: curve };
            refuted.into_iter().chain([quantization.into()]).collect()
        }
        NoiseTerm::RateRamp => {
            let evidence = LinearDriftEvidence::Curve(curve);
            vec![LinearDrift { slope: coefficient(term, unit), evidence }.into()]
        }
        NoiseTerm::Resonance(_) => {
            let (frequency_hz, bandwidth_hz) = (shape(term, 0), shape(term, 1));
            let (deviation, evidence) = (coefficient(term, unit), line(true));
            vec![ResonantLine { frequency_hz, bandwidth_hz, deviation, multiples: None, evidence }.into()]
        }
        NoiseTerm::Sinusoid(_) => {
            let (frequency_hz, amplitude) = (shape(term, 0), coefficient(term, unit));
            vec![SinusoidalLine { frequency_hz, amplitude, multiples: None, evidence: line(false) }.into()]
        }
        NoiseTerm::Markov(markov) => return markov_effects(findings, facts, (term, markov), curve, unexplained),
        // The terms of the baseline are no effects.
        NoiseTerm::AngleRandomWalk | NoiseTerm::BiasInstability | NoiseTerm::RateRandomWalk => Vec::new(),
    };
    if let Some(frequency) = line_frequency(&term.kind) {
        // The curve alone does not tell so few periods from a drift.
        if frequency * facts.duration_s < FEW_PERIODS {
            effects.push(unexplained(Refutation::FewPeriods));
        }
        // In the curve alone: its frequency changes, or it is no line.
        if lines.is_some() && !is_band(term, facts.duration_s) {
            effects.push(unexplained(Refutation::NotInSpectrum { frequency_hz: frequency }));
        }
    }
    effects
}

fn markov_effects(
    findings: &ChannelFindings,
    facts: &ChannelFacts,
    (term, markov): (&FittedTerm, Markov),
    curve: CurveEvidence,
    unexplained: impl Fn(Refutation) -> Effect,
) -> Vec<Effect> {
    let &ChannelFindings { channel: ChannelProfile { unit, .. }, fit, rest, .. } = findings;
    let time_constant_s = markov.time_constant;
    let mut effects = Vec::new();
    if is_low_pass(fit.after(), markov, facts.resolution) {
        effects.push(low_pass_effect(term, markov, curve));
    }
    if rest.is_some_and(|rest| !is_reversible(rest, time_constant_s)) {
        effects.push(unexplained(Refutation::Irreversible { time_constant_s }));
    }
    let process =
        |evidence| MarkovProcess { deviation: coefficient(term, unit), time_constant_s: shape(term, 0), evidence };
    if let Some(by_spectrum) = &fit.markov_by_spectrum {
        let corner_hz = 0.5 / (PI * by_spectrum.time_constant.value);
        effects.push(process(MarkovEvidence::Spectrum { corner_hz, gain: by_spectrum.gain }).into());
        return effects;
    }
    effects.push(process(MarkovEvidence::Curve(curve)).into());
    if let Some(of) = kurtosis_ratio(fit, rest, facts.resolution, markov) {
        let kurtosis = [of.ratio, of.error];
        if of.ratio - 3.0 * of.error > LARGEST_KURTOSIS_RATIO {
            effects.push(unexplained(Refutation::RareDisturbances { time_constant_s, kurtosis }));
        } else if of.is_telegraph() {
            // Two levels that are equally frequent are two standard deviations apart.
            let evidence = TelegraphEvidence::Kurtosis { ratio: of.ratio, error: of.error, curve };
            effects.push(telegraph_effect(term, 2.0, evidence, unit));
        } else if !is_gaussian(&of) {
            match law_by_samples(findings, term, markov) {
                Some(Law::Gaussian) => {}
                Some(Law::TwoLevels { jumps, gain, distance }) => {
                    effects.push(telegraph_effect(term, distance, TelegraphEvidence::Levels { jumps, gain }, unit));
                }
                None => effects.push(unexplained(Refutation::UndecidedLevels { time_constant_s, kurtosis })),
            }
        }
    }
    effects
}

/// The law of a Markov term of the model of a channel, by the samples without their sinusoids. They do not tell it if anything else in them is
/// correlated for longer than a filter's response: a band or a second process is nearer to a Gaussian process than to levels.
fn law_by_samples(findings: &ChannelFindings, term: &FittedTerm, markov: Markov) -> Option<Law> {
    let model = findings.fit.after();
    let is_known = |other: &FittedTerm| {
        let is_sinusoid = matches!(other.kind, NoiseTerm::Sinusoid(_));
        other.kind == term.kind || is_sinusoid || is_filter(&other.kind) || NoiseTerm::BASELINE.contains(&other.kind)
    };
    let lines = findings.lines.unwrap_or_default();
    if !model.terms().iter().all(is_known) || !lines.iter().all(MergedLine::is_sinusoid) {
        return None;
    }
    let rest = without_sines_at(findings.rest?, lines.iter().map(|line| line.frequency.value));
    Law::of_process(&rest, term.value, markov.time_constant, filter_length_s(model))
}

/// True if a kurtosis is [`TOLD_APART`] times as likely that of a Gaussian process, 0, as that of a telegraph signal, 1.
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
        return telegraph::kurtosis_ratio(&fit.curve, model, markov);
    }
    let rest = rest?;
    let mut estimator = GappedCascade::default();
    let step = resolution / STEPS_PER_COUNT;
    estimator.push_values(rest.values(), step);
    telegraph::kurtosis_ratio(&estimator.curve(rest.sample_period()).scaled(step), model, markov)
}

/// True if a term is a resonance of whose bandwidth a record of this length bounds both sides.
fn is_band(term: &FittedTerm, duration_s: f64) -> bool {
    let Shape::Resonance { bandwidth: (narrowest, widest), .. } = term.shape else { return false };
    matches!(term.kind, NoiseTerm::Resonance(of) if narrowest > 1.0 / duration_s && widest < WIDEST_BAND * of.frequency)
}

/// True if a Markov term is white noise behind a first-order low-pass filter: its time constant is short, and the white
/// noise, filtered or not, is no larger than the rounding error.
fn is_low_pass(model: &Model, markov: Markov, resolution: f64) -> bool {
    let period_s = model.sample_period();
    let rounding = Rounding::white(resolution, period_s).variance() * period_s;
    let white = model.terms().iter().filter(|term| is_white(&term.kind));
    let left: f64 = white.map(|term| term.low * term.low).sum();
    markov.time_constant < MAX_LOW_PASS_SAMPLES * period_s && left <= rounding
}

fn curve_evidence(found: &Addition, period_s: f64) -> CurveEvidence {
    let residual = found.residual;
    CurveEvidence {
        excess: residual.excess,
        tau_s: residual.n as f64 * period_s,
        sigmas: residual.sigmas,
        gain_sigmas: found.score.sqrt(),
    }
}

fn coefficient(term: &FittedTerm, unit: &'static str) -> ChannelEstimate {
    BoundedEstimate::new(term.value, term.low, term.high).in_unit(unit)
}

/// The parameter of the shape of a term at this position; 0 where it has none.
fn shape(term: &FittedTerm, position: usize) -> BoundedEstimate {
    let (value, (low, high)) =
        term.shape_parameters().nth(position).map_or((0.0, (0.0, 0.0)), |(_, value, bounds)| (value, bounds));
    BoundedEstimate::new(value, low, high)
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

/// A Markov term that is random telegraph noise, with levels `distance` standard deviations apart.
fn telegraph_effect(term: &FittedTerm, distance: f64, evidence: TelegraphEvidence, unit: &'static str) -> Effect {
    let amplitude = coefficient(term, unit).scaled(distance);
    TelegraphNoise { time_constant_s: shape(term, 0), amplitude, evidence }.into()
}

/// A term that fits an octave of the curve and is contradicted.
fn unexplained_octave(found: &Addition, curve: &Curve<OCTAVES>, term: &FittedTerm, by: Refutation) -> Effect {
    let point = curve.points().iter().find(|point| point.n == found.residual.n);
    // The bound is that of the measured deviation at this averaging time; the model's is taken as exact.
    let bound = |of: fn(&AllanPoint) -> f64| point.map_or(1.0, |point| (of(point) / point.avar).sqrt());
    let percent = |factor: f64| 100.0 * ((1.0 + found.residual.excess) * factor - 1.0);
    let (low, high) = (percent(bound(|point| point.low)), percent(bound(|point| point.high)));
    let evidence = curve_evidence(found, curve.sample_period());
    let tau_s = BoundedEstimate::exact(evidence.tau_s);
    let frequency_hz = line_frequency(&term.kind).map(|_| shape(term, 0));
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
    LowPassFilter {
        bandwidth_hz: BoundedEstimate::new(corner(markov.time_constant), corner(high), corner(low)),
        design: LowPassDesign::OneStage { time_constant_s: markov.time_constant },
        evidence: curve,
    }
    .into()
}

fn second_order_effect(term: &FittedTerm, filter: &LowPass, curve: CurveEvidence) -> Effect {
    LowPassFilter {
        bandwidth_hz: shape(term, 0).scaled(filter.bandwidth() / filter.frequency),
        design: if *filter == LowPass::butterworth(filter.frequency) {
            LowPassDesign::Butterworth
        } else {
            LowPassDesign::TwoStages
        },
        evidence: curve,
    }
    .into()
}

fn bounded(sensitivity: &Sensitivity, unit: &'static str) -> ChannelEstimate {
    let (low, high) = sensitivity.bounds();
    BoundedEstimate::new(sensitivity.value, low, high).in_unit(unit)
}

/// Sensitivities to temperature, supply and the specific force along each axis, in this order, or in their place a drift in common.
fn sensitivity_proposals(
    profile: &SensorProfile,
    channel: ChannelProfile,
    sensitivities: &[(ChannelProfile, Sensitivity)],
) -> Vec<Proposal> {
    let origin = |(regressor, of): &(ChannelProfile, Sensitivity)| Origin::Covariate {
        is_plausible: is_plausible(profile, channel, regressor.quantity, of),
    };
    let own = |covariate: &(ChannelProfile, Sensitivity)| {
        Some(Proposal::new(sensitivity_effect(channel, covariate)?, origin(covariate)))
    };
    let shared = |covariate: &(ChannelProfile, Sensitivity)| {
        Proposal::new(shared_drift_effect(profile, channel, covariate), origin(covariate))
    };
    let mut proposals: Vec<Proposal> = sensitivities.iter().filter_map(own).collect();
    proposals.sort_by_key(|of| match of.effect {
        Effect::TemperatureSensitivity(_) => 0,
        Effect::SupplySensitivity(_) => 1,
        _ => 2,
    });
    proposals.extend(sensitivities.iter().map(shared));
    proposals
}

fn sensitivity_effect(channel: ChannelProfile, (regressor, of): &(ChannelProfile, Sensitivity)) -> Option<Effect> {
    let (sensitivity, sigmas) = (bounded(of, channel.unit), of.sigmas());
    match regressor.quantity {
        Quantity::Temperature => Some(TemperatureSensitivity { sensitivity, sigmas }.into()),
        Quantity::SupplyVoltage => Some(SupplySensitivity { sensitivity, sigmas }.into()),
        Quantity::SpecificForce => {
            let along = |axis: &str| (axis == regressor.axis).then_some(sensitivity);
            let sensitivity = AccelerationSensitivity::AXES.map(along);
            Some(AccelerationSensitivity { sensitivity, sigmas }.into())
        }
        _ => None,
    }
}

/// True if a sensitivity of a channel is more probably one of the sensor's than not, by what is known of the sensor: its value is at most
/// a standard error beyond the largest plausible multiple of the data sheet's, or its interval includes zero.
///
/// One of the sensor's is anywhere up to that multiple m; the ratio of a drift that both channels share is of any size, as often in one
/// decade as in another, of three. A measured ratio r is as probable from either where `Φ((m − r)/error)·r/m = 1/ln 1000`: at r = m + error.
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
        includes_zero || sensitivity.value.abs() - sensitivity.error <= profile.largest_sensitivity_multiple * typical
    })
}

/// Drift that a channel shares with another one, too large to be caused by what that one measures.
fn shared_drift_effect(
    profile: &SensorProfile,
    channel: ChannelProfile,
    (regressor, sensitivity): &(ChannelProfile, Sensitivity),
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

/// A line beside what `fit` has; `None` of a nameless band that changes the deviation by less than a scale factor's tolerance.
fn line_effect(line: &MergedLine, fit: &ChannelFit, unit: &'static str) -> Option<Effect> {
    let model = fit.after();
    if line.shape_p_value < REFUTED {
        return unexplained_band(line, model, BandMismatch::Shape { p_value: line.shape_p_value });
    }
    if line.is_broad() && fit.refutes(&line.kind()) {
        return unexplained_band(line, model, BandMismatch::Curve);
    }
    if let Some(modulation) = &line.modulation {
        return Some(modulated_line(line, modulation, unit));
    }
    let frequency_hz = line.frequency.bounds();
    let evidence = |has_width: bool| LineEvidence {
        has_width,
        source: LineSource::Spectrum(SpectrumEvidence {
            frequency_hz: line.frequency.value,
            is_at_half_rate: 2.0 * line.frequency.value * fit.covariates.curve.sample_period() > NO_HIGHER,
            width_hz: line.is_wider_than_resolution().then_some(line.width.value),
            sigmas: line.statistic.sqrt(),
            p_value: line.p_value,
        }),
    };
    // To the curve a line of a few phase changes in the record is a sinusoid; the spectrum tells it from one.
    if matches!(line.kind(), NoiseTerm::Resonance(_)) || line.is_band() {
        let deviation = line.deviation.bounds().in_unit(unit);
        let bandwidth_hz = line.width.bounds();
        let evidence = evidence(true);
        return Some(ResonantLine { frequency_hz, bandwidth_hz, deviation, multiples: None, evidence }.into());
    }
    let amplitude = line.deviation.bounds().scaled(SQRT_2).in_unit(unit);
    Some(SinusoidalLine { frequency_hz, amplitude, multiples: None, evidence: evidence(false) }.into())
}

fn modulated_line(line: &MergedLine, modulation: &Modulation, unit: &'static str) -> Effect {
    ModulatedLine {
        frequency_hz: line.frequency.bounds(),
        amplitude: line.deviation.bounds().scaled(SQRT_2).in_unit(unit),
        depth: modulation.depth.bounds(),
        period_s: modulation.frequency.bounds().inverse(),
        of_phase: modulation.of_phase,
        evidence: ModulationEvidence::Envelope { sigmas: line.statistic.sqrt() },
    }
    .into()
}

/// A band of the spectrum that stands out of the noise and is no resonance.
fn unexplained_band(line: &MergedLine, model: &Model, mismatch: BandMismatch) -> Option<Effect> {
    let (centre, half) = (line.frequency.value, 0.5 * line.width.value);
    let is_noise = |kind: &NoiseTerm| !matches!(kind, NoiseTerm::Resonance(_) | NoiseTerm::Sinusoid(_));
    let noise = Model::new(model.sample_period(), model.terms().iter().copied().filter(|term| is_noise(&term.kind)));
    // One-sided densities: the mean of the band that holds half of a line's power, and that of the noise.
    let density = 0.5 * line.deviation.value.powi(2) / line.width.value;
    let excess = |times: f64| 100.0 * ((1.0 + times * density / (2.0 * noise.density(centre))).sqrt() - 1.0);
    let relative = NORMAL_975 * 2.0 * line.deviation.error / line.deviation.value;
    let percent = BoundedEstimate::new(excess(1.0), excess((1.0 - relative).max(0.0)), excess(1.0 + relative));
    if percent.high < 100.0 * MIN_EXCESS {
        return None;
    }
    // An interval wider than the share says nothing of it.
    let is_known = percent.high - percent.low <= percent.value;
    let frequency_hz = BoundedEstimate::new(centre, (centre - half).max(0.0), centre + half);
    let band = Unexplained {
        place: UnexplainedPlace::Frequency(frequency_hz),
        excess_percent: is_known.then_some(percent),
        observation: Observation::Band { width_hz: line.width.value, sigmas: line.statistic.sqrt(), mismatch },
    };
    Some(band.into())
}

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
