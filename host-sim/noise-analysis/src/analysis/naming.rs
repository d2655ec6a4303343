//! Effects as they are reported: parameters with units and intervals, evidence that a person can check.

use super::coefficient_unit;
use super::common::Common;
use super::lines::Line;
use super::walk::Unbounded;
use crate::findings::BoundedEstimate;
use crate::findings::MeasuredValue;
use crate::report::{Effect, Parameter};
use allan_core::confidence::NORMAL_975;
use allan_core::model::FittedTerm;
use allan_core::regression::Sensitivity;
use allan_core::telegraph::KurtosisRatio;
use allan_core::term::{Markov, MovingAverageFilter, NoiseTerm};
use allan_core::trace::AddedTerm;
use measurement::{ChannelProfile, Quantity};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// A term's parameters by name.
pub(super) fn parameters(term: &FittedTerm, unit: &str) -> BTreeMap<String, Parameter> {
    let coefficient =
        Parameter { value: term.value, low: term.low, high: term.high, unit: coefficient_unit(&term.kind, unit) };
    let shapes = term.kind.shape().into_iter().zip(term.shape).filter(|((name, _), _)| !name.is_empty());
    let shape = |((name, value), (low, high)): ((&str, f64), (f64, f64))| {
        (name.to_owned(), Parameter { value, low, high, unit: shape_unit(name).to_owned() })
    };
    shapes.map(shape).chain([(term.kind.coefficient().to_owned(), coefficient)]).collect()
}

fn shape_unit(name: &str) -> &'static str {
    match name {
        "frequency" | "bandwidth" => "Hz",
        "time_constant" => "s",
        _ => "",
    }
}

/// A term that the declared model lacks.
pub(super) fn term_effect(term: &FittedTerm, found: &AddedTerm, unit: &str, period_s: f64) -> Effect {
    added_effect(term, found, unit, period_s, &meaning(&term.kind))
}

/// A filter that the declared model lacks, in a sensor whose own samples come at `internal_rate_hz`.
pub(super) fn filter_effect(
    (term, filter): (&FittedTerm, &MovingAverageFilter),
    found: &AddedTerm,
    unit: &str,
    period_s: f64,
    internal_rate_hz: f64,
) -> Effect {
    added_effect(term, found, unit, period_s, &filter_meaning(filter, internal_rate_hz))
}

fn added_effect(term: &FittedTerm, found: &AddedTerm, unit: &str, period_s: f64, meaning: &str) -> Effect {
    let residual = found.residual;
    let evidence = format!(
        "{:+.1} % at tau = {} s ({:.0} sigma) before it was added, which takes {:.0} sigma off the fit; {meaning}",
        100.0 * residual.excess,
        seconds(residual.n as f64 * period_s),
        residual.sigmas.abs(),
        found.score.sqrt(),
    );
    Effect { kind: term.kind.name().to_owned(), parameters: parameters(term, unit), evidence }
}

/// With its normal 95 % bounds; nothing here is negative.
fn estimated(estimate: MeasuredValue, unit: &str) -> Parameter {
    let half_width = NORMAL_975 * estimate.error;
    let (low, high) = ((estimate.value - half_width).max(0.0), estimate.value + half_width);
    Parameter { value: estimate.value, low, high, unit: unit.to_owned() }
}

/// A Markov term whose fourth moments show two levels.
pub(super) fn telegraph_effect(
    term: &FittedTerm,
    found: &AddedTerm,
    verdict: &KurtosisRatio,
    unit: &str,
    period_s: f64,
) -> Effect {
    let markov = term_effect(term, found, unit, period_s);
    let mut parameters = markov.parameters;
    parameters.remove("deviation");
    // Two levels, equally often: their distance is twice the standard deviation.
    let amplitude =
        Parameter { value: 2.0 * term.value, low: 2.0 * term.low, high: 2.0 * term.high, unit: unit.to_owned() };
    parameters.insert("amplitude".to_owned(), amplitude);
    let evidence = format!(
        "two levels: excess kurtosis {:.2} ± {:.2} of that of a telegraph signal, a Gaussian process has 0; {}",
        verdict.ratio, verdict.error, markov.evidence,
    );
    Effect { kind: "telegraph".to_owned(), parameters, evidence }
}

/// A process in the place of a walk that goes too far.
pub(super) fn unbounded_effect(found: &Unbounded, unit: &str) -> Effect {
    let evidence = format!(
        "a random walk of {:.1e} {} would take the bias {:.0} times as far in an hour as the biases of parts differ; {}",
        found.walk.value,
        coefficient_unit(&found.walk.kind, unit),
        found.too_far,
        meaning(&found.process.kind),
    );
    Effect { kind: found.process.kind.name().to_owned(), parameters: parameters(&found.process, unit), evidence }
}

/// A Markov term that stands in the place of the white noise.
pub(super) fn low_pass_effect(term: &FittedTerm, markov: Markov, found: &AddedTerm, period_s: f64) -> Effect {
    let corner = |time_constant: f64| 0.5 / (PI * time_constant);
    let (shortest, longest) = term.shape[0];
    let bandwidth = Parameter {
        value: corner(markov.time_constant),
        low: corner(longest),
        high: corner(shortest),
        unit: "Hz".to_owned(),
    };
    let evidence = format!(
        "{:+.1} % at tau = {} s ({:.0} sigma); all the white noise is correlated over {} s and none is left: \
         a low-pass filter of the first order",
        100.0 * found.residual.excess,
        seconds(found.residual.n as f64 * period_s),
        found.residual.sigmas.abs(),
        seconds(markov.time_constant),
    );
    Effect {
        kind: "filter_bandwidth".to_owned(),
        parameters: BTreeMap::from([("bandwidth".to_owned(), bandwidth)]),
        evidence,
    }
}

/// What a channel follows: temperature, supply, and the specific force on its axes as one effect.
pub(super) fn followed_effects(followed: &[(ChannelProfile, Sensitivity)], unit: &str) -> Vec<Effect> {
    let parameter = |followed: &Sensitivity, of: &str| {
        let (low, high) = followed.bounds();
        Parameter { value: followed.value, low, high, unit: format!("{unit}/{of}") }
    };
    let single = |cause: Quantity, kind: &str, of: &str, meaning: &str| {
        let (_, followed) = followed.iter().find(|(channel, _)| channel.quantity == cause)?;
        Some(Effect {
            kind: kind.to_owned(),
            parameters: BTreeMap::from([("sensitivity".to_owned(), parameter(followed, of))]),
            evidence: format!("follows the measured {kind}, {:.0} sigma; {meaning}", followed.sigmas()),
        })
    };
    let axes: Vec<_> = followed.iter().filter(|(channel, _)| channel.quantity == Quantity::SpecificForce).collect();
    let acceleration = (!axes.is_empty()).then(|| {
        let clearest = axes.iter().map(|(_, followed)| followed.sigmas()).fold(0.0, f64::max);
        Effect {
            kind: "acceleration".to_owned(),
            parameters: axes
                .iter()
                .map(|(channel, followed)| (format!("sensitivity_{}", channel.axis), parameter(followed, "g")))
                .collect(),
            evidence: format!("follows the measured specific force, {clearest:.0} sigma; g-sensitivity of the gyro"),
        }
    });
    let temperature = single(Quantity::Temperature, "temperature", "degC", "a bias that drifts with temperature");
    let supply = single(Quantity::SupplyVoltage, "supply", "V", "a bias that is not regulated");
    temperature.into_iter().chain(supply).chain(acceleration).collect()
}

/// A line that the spectrum shows.
pub(super) fn line_effect(line: &Line, unit: &str) -> Effect {
    let (kind, root) = (line.kind(), 2f64.sqrt());
    let parameters = match kind {
        NoiseTerm::Resonance(_) => {
            vec![("deviation", estimated(line.deviation, unit)), ("bandwidth", estimated(line.width, "Hz"))]
        }
        _ => {
            let MeasuredValue { value, error } = line.deviation;
            vec![("amplitude", estimated(MeasuredValue { value: root * value, error: root * error }, unit))]
        }
    };
    let frequency = ("frequency", estimated(line.frequency, "Hz"));
    let width = match line.width.value {
        width if width > 0.0 => format!("{width:.4} Hz wide"),
        _ => "no wider than the record resolves".to_owned(),
    };
    Effect {
        kind: kind.name().to_owned(),
        parameters: parameters.into_iter().chain([frequency]).map(|(name, value)| (name.to_owned(), value)).collect(),
        evidence: format!(
            "line at {:.4} Hz in the spectrum, {width}, {:.0} sigma, by chance anywhere {:.0e}; {}",
            line.frequency.value,
            line.statistic.sqrt(),
            line.p_value,
            meaning(&kind),
        ),
    }
}

/// A slow part that `channel` shares with others.
pub(super) fn common_effect(common: &Common, channel: ChannelProfile, unit: &str) -> Effect {
    let parameter = |of: BoundedEstimate, unit: &str| Parameter {
        value: of.value,
        low: of.low,
        high: of.high,
        unit: unit.to_owned(),
    };
    let others: Vec<&str> = common.channels.iter().filter(|other| **other != channel).map(|other| other.name).collect();
    Effect {
        kind: "common_mode".to_owned(),
        parameters: BTreeMap::from([
            ("deviation".to_owned(), parameter(common.shared.deviation, unit)),
            ("time_constant".to_owned(), parameter(common.shared.time_constant, "s")),
        ]),
        evidence: format!(
            "moves with {}: their spectra are e^{:.0} times as likely as those of channels with nothing in common, and no \
             measured cause explains it; a shared reference, supply or temperature gradient",
            others.join(" and "),
            common.gain,
        ),
    }
}

fn seconds(tau: f64) -> String {
    if tau < 0.1 { format!("{tau:.4}") } else { format!("{tau:.3}") }
}

/// What a term may physically be.
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
