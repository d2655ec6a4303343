//! What the truth knows: the parameters of an effect, and the error of the true model on data that it has not seen.

use super::draw::Case;
use adis16405_driver::{Channel, GyroRange};
use allan_core::fit::fit_shapes;
use allan_core::model::Discrepancy;
use allan_core::model::FittedTerm;
use allan_core::term::{Markov, MovingAverageFilter, Resonance, Sinusoid};
use allan_core::{Cascade, Model, NoiseTerm};
use firmware::{OCTAVES, OVERLAP};
use recordings::recording::Sample;
use simulation::output_register;
use simulation::{SAMPLE_RATE_HZ, Simulation, SimulationError};
use virtual_sensor::{ChannelNoise, InjectedEffect, OutputRegister, SensorScenario};

/// Names and values of the parameters of `effect` as a report calls them; times count from the part's start.
pub(super) fn parameters(effect: &InjectedEffect) -> Vec<(&'static str, f64)> {
    match *effect {
        InjectedEffect::Sinusoid { frequency_hz, amplitude, .. } => {
            vec![("frequency", frequency_hz), ("amplitude", amplitude)]
        }
        InjectedEffect::Resonance { frequency_hz, bandwidth_hz, deviation, .. } => {
            vec![("frequency", frequency_hz), ("bandwidth", bandwidth_hz), ("deviation", deviation)]
        }
        InjectedEffect::Markov { time_constant_s, deviation, .. }
        | InjectedEffect::CommonMode { time_constant_s, deviation, .. } => {
            vec![("time_constant", time_constant_s), ("deviation", deviation)]
        }
        InjectedEffect::Telegraph { time_constant_s, amplitude, .. } => {
            vec![("time_constant", time_constant_s), ("amplitude", amplitude)]
        }
        InjectedEffect::Quantization { coefficient, .. } => vec![("value", coefficient)],
        InjectedEffect::RateRamp { slope, .. } => vec![("slope", slope)],
        InjectedEffect::FilterBandwidth { taps_log2 } => vec![("taps", f64::from(1u32 << taps_log2))],
        InjectedEffect::Temperature { sensitivity, .. } | InjectedEffect::Supply { sensitivity, .. } => {
            vec![("sensitivity", sensitivity)]
        }
        InjectedEffect::Acceleration { sensitivity: [x, y, z], .. } => {
            vec![("sensitivity_x", x), ("sensitivity_y", y), ("sensitivity_z", z)]
        }
        InjectedEffect::Spikes { rate_per_hour, size, .. } => vec![("rate", rate_per_hour), ("size", size)],
        InjectedEffect::BiasStep { time_s, size, .. } => vec![("time", time_s), ("size", size)],
        InjectedEffect::DroppedSamples { fraction } | InjectedEffect::RepeatedSamples { fraction } => {
            vec![("fraction", fraction)]
        }
        InjectedEffect::SampleClock { ratio } => vec![("rate_hz", SAMPLE_RATE_HZ * ratio)],
    }
}

/// Whether the effect can be taken out of the data; else it is a term of the true model.
fn can_be_taken_out(effect: &InjectedEffect) -> bool {
    !matches!(
        effect,
        InjectedEffect::Sinusoid { .. }
            | InjectedEffect::Resonance { .. }
            | InjectedEffect::Markov { .. }
            | InjectedEffect::Telegraph { .. }
            | InjectedEffect::Quantization { .. }
            | InjectedEffect::RateRamp { .. }
            | InjectedEffect::FilterBandwidth { .. }
    )
}

/// What the truth reaches as `deviance_per_point` on the second half of a record, from which a true estimator would
/// have taken out what can be. A common mode counts as taken out: the channels tell it from what they do not share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct UnseenError {
    /// Of the true model.
    pub(super) model: f64,
    /// Of the true terms, their coefficients and shapes fitted to the first half, as those of any model must be.
    pub(super) fitted: f64,
}

/// Of `channel`; `None` where there is too little data.
///
/// # Errors
/// The recording without the effects cannot be made.
pub(super) fn unseen_error(case: &Case, channel: Channel) -> Result<Option<UnseenError>, SimulationError> {
    let effects: Vec<InjectedEffect> =
        case.simulation.scenario.effects.iter().filter(|effect| !can_be_taken_out(effect)).cloned().collect();
    let model = model(case.simulation.noise.channel(output_register(channel)), channel, &effects);
    // Random streams go by the order of the effects, so the place of those that are taken out is kept by size 0.
    let hidden = SensorScenario {
        effects: case.simulation.scenario.effects.iter().map(nothing_if_taken_out).collect(),
        ..case.simulation.scenario.clone()
    };
    let recording = Simulation { scenario: hidden, ..case.simulation.clone() }.run(|_| ())?;
    let (first, second) = recording.samples.split_at(recording.samples.len() / 2);
    let curve = |samples: &[Sample]| curve(samples, channel, recording.range);
    let mut kinds: Vec<NoiseTerm> = model.terms().iter().map(|term| term.kind).collect();
    kinds.dedup();
    let fitted = fit_shapes(&curve(first), &kinds);
    let error = |model: &Model| Some(Discrepancy::between(model, &curve(second))?.deviance_per_point);
    Ok(error(&model).zip(error(&fitted)).map(|(model, fitted)| UnseenError { model, fitted }))
}

fn nothing_if_taken_out(effect: &InjectedEffect) -> InjectedEffect {
    let channel = effect.channels().first().copied().unwrap_or(OutputRegister::AuxAdc);
    if can_be_taken_out(effect) { InjectedEffect::RateRamp { channel, slope: 0.0 } } else { effect.clone() }
}

fn model(noise: &ChannelNoise, channel: Channel, effects: &[InjectedEffect]) -> Model {
    let period_s = 1.0 / SAMPLE_RATE_HZ;
    let rounding = channel.lsb(GyroRange::Dps300) * (period_s / 12.0).sqrt();
    let taps = effects.iter().find_map(|effect| match effect {
        InjectedEffect::FilterBandwidth { taps_log2 } => Some(1u16 << taps_log2),
        _ => None,
    });
    let white =
        taps.map_or(NoiseTerm::AngleRandomWalk, |taps| NoiseTerm::Filtered(MovingAverageFilter::bartlett(taps)));
    let declared = [
        FittedTerm::exact(white, noise.angle_random_walk),
        FittedTerm::exact(NoiseTerm::AngleRandomWalk, rounding),
        FittedTerm::exact(NoiseTerm::BiasInstability, noise.bias_instability),
        FittedTerm::exact(NoiseTerm::RateRandomWalk, noise.rate_random_walk),
    ];
    let own = effects.iter().filter(|effect| effect.channels().contains(&output_register(channel)));
    Model::new(period_s, declared.into_iter().chain(own.filter_map(term)))
}

fn term(effect: &InjectedEffect) -> Option<FittedTerm> {
    let (kind, value) = match *effect {
        InjectedEffect::Sinusoid { frequency_hz, amplitude, .. } => {
            (NoiseTerm::Sinusoid(Sinusoid { frequency: frequency_hz }), amplitude)
        }
        InjectedEffect::Resonance { frequency_hz, bandwidth_hz, deviation, .. } => {
            (NoiseTerm::Resonance(Resonance { frequency: frequency_hz, bandwidth: bandwidth_hz }), deviation)
        }
        InjectedEffect::Markov { time_constant_s, deviation, .. } => {
            (NoiseTerm::Markov(Markov { time_constant: time_constant_s }), deviation)
        }
        InjectedEffect::Telegraph { time_constant_s, amplitude, .. } => {
            (NoiseTerm::Markov(Markov { time_constant: time_constant_s }), 0.5 * amplitude)
        }
        InjectedEffect::Quantization { coefficient, .. } => (NoiseTerm::Quantization, coefficient),
        InjectedEffect::RateRamp { slope, .. } => (NoiseTerm::RateRamp, slope.abs()),
        _ => return None,
    };
    Some(FittedTerm::exact(kind, value))
}

fn curve(samples: &[Sample], channel: Channel, range: GyroRange) -> allan_core::Curve<OCTAVES> {
    let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
    for sample in samples {
        cascade.push(i32::from(sample.counts.get(channel)));
    }
    cascade.curve(1.0 / SAMPLE_RATE_HZ).scaled(channel.lsb(range))
}
