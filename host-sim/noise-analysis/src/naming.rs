//! Names the effects that the whole record shows in a channel: which of them are reported, with parameters, units and
//! bounds, and with evidence that a person can check.

use crate::OCTAVES;
use crate::channel_fit::{ChannelFit, DITHERED_OCTAVES, FREQUENCY_BY_OCTAVES};
use crate::detectors::random_telegraph::is_reversible;
use crate::distributions::ROUNDING;
use crate::findings::{BoundedEstimate, Detection, Effect, MeasuredValue, Parameter, SIGNIFICANCE};
use crate::gapped_cascade::GappedCascade;
use crate::noise_terms::{filter_length_s, is_white, line_frequency};
use crate::report::term_parameters;
use crate::slow_drift::ChannelsInCommon;
use crate::spectra::{MarkovEstimate, Modulation};
use crate::spectral_lines::{FEW_PERIODS, MergedLine};
use crate::streamed_curves::STEPS_PER_COUNT;
use crate::traced_model::Addition;
use crate::uniform_series::UniformSeries;
use allan_core::confidence::NORMAL_975;
use allan_core::model::FittedTerm;
use allan_core::regression::Sensitivity;
use allan_core::telegraph::{self, KurtosisRatio};
use allan_core::term::{Markov, MovingAverageFilter, NoiseTerm, Resonance, Shape, Sinusoid};
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
    pub telegraph: Option<&'a Detection>,
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
    let is_rounding = |found: &&Detection| {
        !is_dithered_at_once && found.effect.parameters["amplitude"].value < NEIGHBOURING_COUNTS * resolution
    };
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
    for (term, found) in fit.traced.added() {
        match term.kind {
            NoiseTerm::Filtered(filter) => {
                effects.push(filter_effect((term, &filter), found, unit, period_s, profile.internal_rate_hz));
            }
            _ if !is_dithered => {}
            NoiseTerm::Markov(Markov { time_constant }) if time_constant < rounding_s && is_rounding_error(term) => {}
            NoiseTerm::Quantization if rounding_s > 0.0 => {}
            // Reported from the spectrum, which resolves them better than the curve.
            NoiseTerm::Sinusoid(_) | NoiseTerm::Resonance(_) if is_in_spectrum(&term.kind, &in_spectrum) => {}
            NoiseTerm::Sinusoid(_) | NoiseTerm::Resonance(_) if rounding_s > 0.0 && is_rounding_error(term) => {}
            NoiseTerm::Sinusoid(_) | NoiseTerm::Resonance(_) if has_few_periods(&term.kind, duration_s) => {
                let what = "as by a line of a few periods in the record, which its curve does not tell from a drift";
                effects.push(unexplained_line(term, unexplained_octave(found, &fit.covariates.curve, what)));
            }
            // In the curve alone: its frequency changes, or it is no line.
            NoiseTerm::Sinusoid(Sinusoid { frequency }) | NoiseTerm::Resonance(Resonance { frequency, .. })
                if lines.is_some() && !is_band(term, duration_s) =>
            {
                // Above a line of the spectrum, one of the harmonics of that beyond those that the spectrum lists.
                if has_line_below(&in_spectrum, frequency) {
                    continue;
                }
                let what = format!("as by a line at {frequency:.4} Hz, where the spectrum has none");
                effects.push(unexplained_line(term, unexplained_octave(found, &fit.covariates.curve, &what)));
            }
            // In the curve, random telegraph noise and a common-mode drift look like these.
            NoiseTerm::Markov(_) | NoiseTerm::RateRamp if telegraph.is_some() || common.is_some() => {}
            NoiseTerm::Markov(markov) if is_low_pass(model, markov, resolution) => {
                effects.push(low_pass_effect(term, markov, found, period_s));
            }
            NoiseTerm::Markov(Markov { time_constant })
                if findings.rest.is_some_and(|rest| !is_reversible(rest, time_constant)) =>
            {
                let what = format!(
                    "with the spectrum of a process that forgets within {} s, but its changes up and down differ: disturbances \
                     that begin at once and decay",
                    seconds(time_constant),
                );
                effects.push(unexplained_octave(found, &fit.covariates.curve, &what));
            }
            NoiseTerm::Markov(_) if let Some(by_spectrum) = &fit.markov_by_spectrum => {
                effects.push(markov_effect(term, by_spectrum, unit));
            }
            NoiseTerm::Markov(markov) => match kurtosis_ratio(fit, findings.rest, resolution, markov) {
                // Beside a telegraph signal it is that one's.
                Some(_) if effects.iter().any(|effect| effect.kind == "telegraph") => {
                    effects.push(term_effect(term, found, unit, period_s));
                }
                Some(kurtosis) if kurtosis.ratio - 3.0 * kurtosis.error > LARGEST_KURTOSIS_RATIO => {
                    let what = format!(
                        "with the spectrum of a process that forgets within {} s, but an excess kurtosis {:.1} ± {:.1} times \
                         that of a telegraph signal: rare disturbances",
                        seconds(markov.time_constant),
                        kurtosis.ratio,
                        kurtosis.error,
                    );
                    effects.push(unexplained_octave(found, &fit.covariates.curve, &what));
                }
                Some(kurtosis) if kurtosis.is_telegraph() => {
                    effects.push(telegraph_effect(term, found, &kurtosis, unit, period_s));
                }
                Some(kurtosis) if !is_gaussian(&kurtosis) => {
                    let what = format!(
                        "with the spectrum of a process that forgets within {} s: its excess kurtosis, {:.1} ± {:.1} times that of a \
                         telegraph signal, does not tell whether that has two levels",
                        seconds(markov.time_constant),
                        kurtosis.ratio,
                        kurtosis.error,
                    );
                    effects.push(unexplained_octave(found, &fit.covariates.curve, &what));
                }
                _ => effects.push(term_effect(term, found, unit, period_s)),
            },
            _ => effects.push(term_effect(term, found, unit, period_s)),
        }
    }
    keep_first_octave(&mut effects);
    effects.extend(telegraph.map(|found| found.effect.clone()));
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
        let is_octave = effect.kind == "unexplained" && !effect.parameters.contains_key("frequency");
        !is_octave || std::mem::take(&mut is_first)
    });
}

/// Whether the data shows an effect: the interval of its size excludes 0, and it lasts no longer than the record of
/// `duration_s` seconds.
fn is_shown(effect: &Effect, duration_s: f64) -> bool {
    let is_size = |name: &str| ["deviation", "amplitude", "value", "slope", "sensitivity"].contains(&name);
    let includes_0 = |of: &Parameter| of.low <= 0.0 && of.high >= 0.0;
    effect.parameters.iter().all(|(name, parameter)| match name.as_str() {
        "time_constant" => parameter.value < duration_s,
        name => !is_size(name) || !includes_0(parameter),
    })
}

/// Whether a line of the model is one of `lines`, the effects by the spectrum: its frequency by the curve, whose octaves tell it
/// to some tenths, is that of an effect.
fn is_in_spectrum(kind: &NoiseTerm, lines: &[Effect]) -> bool {
    let Some(frequency) = line_frequency(kind) else { return false };
    lines.iter().any(|line| {
        let value = |name: &str| line.parameters.get(name).map_or(0.0, |parameter| parameter.value);
        let reach = (FREQUENCY_BY_OCTAVES * frequency).max(0.5 * value("bandwidth"));
        (value("frequency") - frequency).abs() < reach
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
    let below = |line: &Effect| {
        line.parameters.get("frequency").is_some_and(|of| of.value < (1.0 + FREQUENCY_BY_OCTAVES) * frequency)
    };
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

/// A term that was added to the baseline model.
fn term_effect(term: &FittedTerm, found: &Addition, unit: &str, period_s: f64) -> Effect {
    added_effect(term, found, unit, period_s, &meaning(&term.kind))
}

/// A filter that was added to the baseline model, in a sensor whose internal sample rate is `internal_rate_hz`.
fn filter_effect(
    (term, filter): (&FittedTerm, &MovingAverageFilter),
    found: &Addition,
    unit: &str,
    period_s: f64,
    internal_rate_hz: f64,
) -> Effect {
    added_effect(term, found, unit, period_s, &filter_meaning(filter, internal_rate_hz))
}

fn added_effect(term: &FittedTerm, found: &Addition, unit: &str, period_s: f64, meaning: &str) -> Effect {
    let residual = found.residual;
    let evidence = format!(
        "{:+.1} % at tau = {} s ({:.0} sigma) before it was added, which takes {:.0} sigma off the fit; {meaning}",
        100.0 * residual.excess,
        seconds(residual.n as f64 * period_s),
        residual.sigmas.abs(),
        found.score.sqrt(),
    );
    Effect { kind: term.kind.name().to_owned(), parameters: term_parameters(term, unit), evidence, finding: 0 }
}

/// An estimate with the 95 % bounds of a normal distribution, of a quantity that is not negative.
fn normal_bounds(estimate: MeasuredValue, unit: &str) -> Parameter {
    let half_width = NORMAL_975 * estimate.error;
    let (low, high) = ((estimate.value - half_width).max(0.0), estimate.value + half_width);
    Parameter::new(estimate.value, low, high, unit)
}

/// A Markov term whose kurtosis is that of random telegraph noise.
fn telegraph_effect(
    term: &FittedTerm,
    found: &Addition,
    kurtosis: &KurtosisRatio,
    unit: &str,
    period_s: f64,
) -> Effect {
    let markov = term_effect(term, found, unit, period_s);
    let mut parameters = markov.parameters;
    parameters.remove("deviation");
    // Two levels that are equally frequent are two standard deviations apart.
    let amplitude = Parameter::new(2.0 * term.value, 2.0 * term.low, 2.0 * term.high, unit);
    parameters.insert("amplitude".to_owned(), amplitude);
    let evidence = format!(
        "two levels: excess kurtosis {:.2} ± {:.2} of that of a telegraph signal, a Gaussian process has 0; {}",
        kurtosis.ratio, kurtosis.error, markov.evidence,
    );
    Effect { kind: "telegraph".to_owned(), parameters, evidence, finding: 0 }
}

/// A term that fits an octave of the curve and is contradicted by `what` the samples show.
fn unexplained_octave(found: &Addition, curve: &Curve<OCTAVES>, what: &str) -> Effect {
    let point = curve.points().iter().find(|point| point.n == found.residual.n);
    // Of the measured deviation at this averaging time; that of the model is taken as exact.
    let bound = |of: fn(&AllanPoint) -> f64| point.map_or(1.0, |point| (of(point) / point.avar).sqrt());
    let percent = |factor: f64| 100.0 * ((1.0 + found.residual.excess) * factor - 1.0);
    let (low, high) = (percent(bound(|point| point.low)), percent(bound(|point| point.high)));
    let tau = found.residual.n as f64 * curve.sample_period();
    let evidence = format!(
        "{:+.1} % at tau = {} s ({:.0} sigma) {what}",
        100.0 * found.residual.excess,
        seconds(tau),
        found.residual.sigmas.abs(),
    );
    let parameters =
        [("tau", Parameter::new(tau, tau, tau, "s")), ("excess_percent", Parameter::new(percent(1.0), low, high, "%"))];
    Effect::new("unexplained", parameters, evidence)
}

/// An unexplained octave that the model describes by a line, with the frequency of that.
fn unexplained_line(term: &FittedTerm, mut octave: Effect) -> Effect {
    octave.parameters.extend(term_parameters(term, "").into_iter().filter(|(name, _)| name == "frequency"));
    octave
}

/// A Markov term that the spectrum shows and the curve does not.
fn markov_effect(term: &FittedTerm, by_spectrum: &MarkovEstimate, unit: &str) -> Effect {
    let time_constant = by_spectrum.time_constant.value;
    let evidence = format!(
        "the spectrum is flat below {} Hz, where a random walk would rise: e^{:.0} times as likely; {}",
        seconds(0.5 / (PI * time_constant)),
        by_spectrum.gain,
        meaning(&term.kind),
    );
    Effect { kind: term.kind.name().to_owned(), parameters: term_parameters(term, unit), evidence, finding: 0 }
}

/// A Markov term in the place of the white noise.
fn low_pass_effect(term: &FittedTerm, markov: Markov, found: &Addition, period_s: f64) -> Effect {
    let corner = |time_constant: f64| 0.5 / (PI * time_constant);
    let (shortest, longest) = match term.shape {
        Shape::Markov { time_constant } => time_constant,
        _ => (markov.time_constant, markov.time_constant),
    };
    let bandwidth = Parameter::new(corner(markov.time_constant), corner(longest), corner(shortest), "Hz");
    let evidence = format!(
        "{:+.1} % at tau = {} s ({:.0} sigma); all the white noise is correlated over {} s and none is left: \
         a low-pass filter of the first order",
        100.0 * found.residual.excess,
        seconds(found.residual.n as f64 * period_s),
        found.residual.sigmas.abs(),
        seconds(markov.time_constant),
    );
    Effect::new("filter_bandwidth", [("bandwidth", bandwidth)], evidence)
}

/// Sensitivities to temperature, to supply, and to the specific force on all axes as one effect.
fn sensitivity_effects(sensitivities: &[(ChannelProfile, Sensitivity)], unit: &str) -> Vec<Effect> {
    let parameter = |sensitivity: &Sensitivity, per: &str| {
        let (low, high) = sensitivity.bounds();
        Parameter::new(sensitivity.value, low, high, format!("{unit}/{per}"))
    };
    let single = |regressor: Quantity, kind: &str, per: &str, meaning: &str| {
        let (_, sensitivity) = sensitivities.iter().find(|(channel, _)| channel.quantity == regressor)?;
        let evidence = format!("follows the measured {kind}, {:.0} sigma; {meaning}", sensitivity.sigmas());
        Some(Effect::new(kind, [("sensitivity", parameter(sensitivity, per))], evidence))
    };
    let axes: Vec<_> =
        sensitivities.iter().filter(|(channel, _)| channel.quantity == Quantity::SpecificForce).collect();
    let acceleration = (!axes.is_empty()).then(|| {
        let clearest = axes.iter().map(|(_, sensitivity)| sensitivity.sigmas()).fold(0.0, f64::max);
        let named = axes.iter().map(|(channel, of)| (format!("sensitivity_{}", channel.axis), parameter(of, "g")));
        Effect {
            kind: "acceleration".to_owned(),
            parameters: named.collect(),
            evidence: format!("follows the measured specific force, {clearest:.0} sigma; g-sensitivity of the gyro"),
            finding: 0,
        }
    });
    let temperature = single(Quantity::Temperature, "temperature", "degC", "a bias that drifts with temperature");
    let supply = single(Quantity::SupplyVoltage, "supply", "V", "a bias that is not regulated");
    temperature.into_iter().chain(supply).chain(acceleration).collect()
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
    let (low, high) = sensitivity.bounds();
    let unit = format!("{}/{}", channel.unit, regressor.unit);
    let evidence = format!(
        "moves with {} at {:.2e} {unit}, {:.0} sigma, which is more than {:.0} times the data sheet's sensitivity: both share a \
         drift whose cause was not measured",
        regressor.name,
        sensitivity.value,
        sensitivity.sigmas(),
        profile.largest_sensitivity_multiple,
    );
    Effect::new("shared_drift", [("ratio", Parameter::new(sensitivity.value, low, high, unit))], evidence)
}

/// A line of the spectrum beside what `fit` has.
fn line_effect(line: &MergedLine, fit: &ChannelFit, unit: &str) -> Effect {
    let model = fit.after();
    if line.shape_p_value < SIGNIFICANCE {
        let why = format!(
            "has not the spectrum of a resonance, by chance {:.0e}: a frequency or a strength that changes",
            line.shape_p_value
        );
        return unexplained_band(line, model, &why);
    }
    if line.is_broad() && fit.refutes(&line.kind()) {
        return unexplained_band(line, model, "the Allan deviation contradicts a resonance there");
    }
    if let Some(modulation) = &line.modulation {
        return modulated_line(line, modulation);
    }
    // To the curve a line of a few phase changes in the record is a sinusoid; the spectrum tells it from one.
    let kind = match line.kind() {
        NoiseTerm::Sinusoid(Sinusoid { frequency }) if line.is_band() => {
            NoiseTerm::Resonance(Resonance { frequency, bandwidth: line.width.value })
        }
        kind => kind,
    };
    let root = 2f64.sqrt();
    let parameters = match kind {
        NoiseTerm::Resonance(_) => {
            vec![("deviation", normal_bounds(line.deviation, unit)), ("bandwidth", normal_bounds(line.width, "Hz"))]
        }
        _ => {
            let MeasuredValue { value, error } = line.deviation;
            vec![("amplitude", normal_bounds(MeasuredValue { value: root * value, error: root * error }, unit))]
        }
    };
    let frequency = ("frequency", normal_bounds(line.frequency, "Hz"));
    let width = if line.is_wider_than_resolution() {
        format!("{:.4} Hz wide", line.width.value)
    } else {
        "no wider than the record resolves".to_owned()
    };
    let evidence = format!(
        "line at {:.4} Hz in the spectrum, {width}, {:.0} sigma, by chance anywhere {:.0e}; {}",
        line.frequency.value,
        line.statistic.sqrt(),
        line.p_value,
        meaning(&kind),
    );
    Effect::new(kind.name(), parameters.into_iter().chain([frequency]), evidence)
}

/// A line whose amplitude or phase changes.
fn modulated_line(line: &MergedLine, modulation: &Modulation) -> Effect {
    let frequency = normal_bounds(line.frequency, "Hz");
    // The part of the deviation that is in the sidebands: the amplitude of either is half the depth of that of the line.
    let percent = |depth: f64| 100.0 * depth / (2.0 + depth * depth).sqrt();
    let MeasuredValue { value, error } = modulation.depth;
    let excess = Parameter::new(
        percent(value),
        percent((value - NORMAL_975 * error).max(0.0)),
        percent(value + NORMAL_975 * error),
        "%",
    );
    let (changes, depth) = if modulation.of_phase {
        ("its phase goes to and fro", format!("{value:.2} rad"))
    } else {
        ("its amplitude swells and fades", format!("{:.0} %", 100.0 * value))
    };
    let evidence = format!(
        "a line at {:.4} Hz, {:.0} sigma, whose sidebands are {:.4} Hz away: {changes} by {depth} every {:.0} s, which no sinusoid \
         does",
        line.frequency.value,
        line.statistic.sqrt(),
        modulation.frequency,
        1.0 / modulation.frequency,
    );
    Effect::new("unexplained", [("frequency", frequency), ("excess_percent", excess)], evidence)
}

/// A band of the spectrum that stands out of the noise and is no resonance, for this reason.
fn unexplained_band(line: &MergedLine, model: &Model, why: &str) -> Effect {
    let (centre, half) = (line.frequency.value, 0.5 * line.width.value);
    let is_noise = |kind: &NoiseTerm| !matches!(kind, NoiseTerm::Resonance(_) | NoiseTerm::Sinusoid(_));
    let noise = Model::new(model.sample_period(), model.terms().iter().copied().filter(|term| is_noise(&term.kind)));
    // One-sided densities: the mean of the band that holds half of a line's power, and that of the noise.
    let density = 0.5 * line.deviation.value.powi(2) / line.width.value;
    let excess = |times: f64| 100.0 * ((1.0 + times * density / (2.0 * noise.density(centre))).sqrt() - 1.0);
    let relative = NORMAL_975 * 2.0 * line.deviation.error / line.deviation.value;
    let evidence = format!(
        "a band around {centre:.4} Hz, {:.4} Hz wide, stands out of the noise ({:.0} sigma) and {why}",
        line.width.value,
        line.statistic.sqrt(),
    );
    let frequency = Parameter::new(centre, (centre - half).max(0.0), centre + half, "Hz");
    let percent = Parameter::new(excess(1.0), excess((1.0 - relative).max(0.0)), excess(1.0 + relative), "%");
    // An interval wider than the share says nothing of it.
    let is_known = percent.high - percent.low <= percent.value;
    let share = is_known.then_some(("excess_percent", percent));
    Effect::new("unexplained", [("frequency", frequency)].into_iter().chain(share), evidence)
}

/// Drift that `channel` has in common with others.
fn common_mode_effect(common: &ChannelsInCommon, channel: ChannelProfile, unit: &str) -> Effect {
    let parameter = |of: BoundedEstimate, unit: &str| Parameter::new(of.value, of.low, of.high, unit);
    let others: Vec<&str> = common.names.iter().copied().filter(|other| *other != channel.name).collect();
    let evidence = format!(
        "moves with {}: their spectra are e^{:.0} times as likely as those of channels with nothing in common, and no \
         measured cause explains it; a shared reference, supply or temperature gradient",
        others.join(" and "),
        common.gain,
    );
    Effect::new(
        "common_mode",
        [
            ("deviation", parameter(common.drift.deviation, unit)),
            ("time_constant", parameter(common.drift.time_constant, "s")),
        ],
        evidence,
    )
}

/// A time in s with three decimals, below 0.1 s with four.
fn seconds(tau: f64) -> String {
    if tau < 0.1 { format!("{tau:.4}") } else { format!("{tau:.3}") }
}

/// Usual causes of a term, for the evidence.
fn meaning(kind: &NoiseTerm) -> String {
    match kind {
        NoiseTerm::Quantization => "steps of the angle: a counter or an integrator before the output".to_owned(),
        NoiseTerm::RateRamp => "a steady drift: warming up, or ageing".to_owned(),
        NoiseTerm::Filtered(_) => "a low-pass filter before the sampling".to_owned(),
        NoiseTerm::Markov(_) => "a correlated fluctuation: thermal or electronic".to_owned(),
        NoiseTerm::Resonance(_) => "a narrow band: a mechanical resonance or an unsteady vibration".to_owned(),
        NoiseTerm::Sinusoid(_) => "a steady line: a vibration, or an interference folded into the band".to_owned(),
        NoiseTerm::AngleRandomWalk | NoiseTerm::BiasInstability | NoiseTerm::RateRandomWalk => {
            "part of the declared model".to_owned()
        }
    }
}

fn filter_meaning(filter: &MovingAverageFilter, internal_rate_hz: f64) -> String {
    let window = if filter.stages == 2 { "Bartlett window" } else { "moving average" };
    if filter.decimation == 1.0 {
        return format!("neighbours correlate as behind a {window} of {} taps a stage", filter.taps);
    }
    format!(
        "neighbours correlate as behind a {window} of {} taps a stage that is read every {:.2} values; \
         at the part's own {internal_rate_hz} Hz that is a sample rate of {:.1} Hz",
        filter.taps,
        filter.decimation,
        internal_rate_hz / filter.decimation,
    )
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
