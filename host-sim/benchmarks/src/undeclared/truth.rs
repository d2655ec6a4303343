//! Reference results that use the truth: the error of the true model, and the test with a known waveform.

use super::block_covariance::{BLOCKS, BlockNoises, block_means, environment_means, p_value};
use super::channel_under_test::ChannelUnderTest;
use super::draw::DrawnRecording;
use super::generator::TrueRecording;
use adis16405_driver::{Channel, GyroRange};
use allan_core::fit::fit_shapes;
use allan_core::model::Discrepancy;
use allan_core::model::FittedTerm;
use allan_core::term::{Markov, MovingAverageFilter, Resonance, Sinusoid};
use allan_core::{Cascade, Model, NoiseTerm};
use noise_analysis::{OCTAVES, OVERLAP};
use recordings::recording::{RecordedSample, Recording};
use simulation::{SAMPLE_RATE_HZ, output_register};
use virtual_sensor::{ChannelNoise, InjectedEffect, OutputRegister, SensorScenario};

/// Probability of a false alarm per channel of the analysis.
const FALSE_ALARM: f64 = 2e-4;

/// True for effects that are removed; false for terms of the true model.
fn is_removable(effect: &InjectedEffect) -> bool {
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

/// Deviances per point on the second half without removable effects, of which a common mode is one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TrueModelErrors {
    pub(super) model: f64,
    /// Deviance with coefficients and shapes fitted to the first half.
    pub(super) fitted: f64,
}

pub(super) fn true_model_errors(drawn: &DrawnRecording, channel: Channel) -> Option<TrueModelErrors> {
    let effects: Vec<InjectedEffect> =
        drawn.simulation.scenario.effects.iter().filter(|effect| !is_removable(effect)).cloned().collect();
    let model = model(drawn.simulation.noise.channel(output_register(channel)), channel, &effects);
    // Random streams go by index, so an effect is replaced by one of size 0.
    let hidden = SensorScenario {
        effects: drawn.simulation.scenario.effects.iter().map(zero_if_removable).collect(),
        ..drawn.simulation.scenario.clone()
    };
    let recording = TrueRecording { scenario: hidden, ..drawn.simulation.clone() }.record();
    let (first, second) = recording.samples.split_at(recording.samples.len() / 2);
    let curve = |samples: &[RecordedSample]| curve(samples, channel, recording.range);
    let mut kinds: Vec<NoiseTerm> = model.terms().iter().map(|term| term.kind).collect();
    kinds.dedup();
    let fitted = fit_shapes(&curve(first), &kinds);
    let error = |model: &Model| Some(Discrepancy::between(model, &curve(second))?.deviance_per_point);
    error(&model).zip(error(&fitted)).map(|(model, fitted)| TrueModelErrors { model, fitted })
}

fn zero_if_removable(effect: &InjectedEffect) -> InjectedEffect {
    let channel = effect.channels().first().copied().unwrap_or(OutputRegister::AuxAdc);
    if is_removable(effect) { InjectedEffect::RateRamp { channel, slope: 0.0 } } else { effect.clone() }
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
    let baseline = [
        FittedTerm::exact(white, noise.angle_random_walk),
        FittedTerm::exact(NoiseTerm::AngleRandomWalk, rounding),
        FittedTerm::exact(NoiseTerm::BiasInstability, noise.bias_instability),
        FittedTerm::exact(NoiseTerm::RateRandomWalk, noise.rate_random_walk),
    ];
    let added = effects.iter().filter(|effect| effect.channels().contains(&output_register(channel)));
    Model::new(period_s, baseline.into_iter().chain(added.filter_map(term)))
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

fn curve(samples: &[RecordedSample], channel: Channel, range: GyroRange) -> allan_core::Curve<OCTAVES> {
    let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
    for sample in samples {
        cascade.push(i32::from(sample.counts.get(channel)));
    }
    cascade.curve(1.0 / SAMPLE_RATE_HZ).scaled(channel.lsb(range))
}

/// True if a test with known channel and waveform, and estimated noise, detects the effect at the significance of the
/// analysis. `None` for other effects.
pub(super) fn detects_known_waveform(
    effect: &InjectedEffect,
    truth: &TrueRecording,
    recording: &Recording,
) -> Option<bool> {
    let channel = simulation::channel(*effect.channels().first()?);
    let course = || environment_means(&truth.environment(truth.samples()));
    let shape: Vec<f64> = match effect {
        InjectedEffect::RateRamp { .. } => (0..BLOCKS).map(|block| block as f64).collect(),
        InjectedEffect::BiasStep { time_s, .. } => {
            let at = time_s / truth.seconds * BLOCKS as f64;
            (0..BLOCKS).map(|block| (1.0 - (at - block as f64)).clamp(0.0, 1.0)).collect()
        }
        InjectedEffect::Temperature { .. } => course()[0].clone(),
        InjectedEffect::Supply { .. } => course()[1].clone(),
        _ => return None,
    };
    let lsb = channel.lsb(recording.range);
    let values: Vec<f64> = recording.samples.iter().map(|sample| f64::from(sample.counts.get(channel)) * lsb).collect();
    let place = ChannelUnderTest::new(truth, output_register(channel), &[]);
    let white = place.white_density() + lsb * lsb / 12.0 / SAMPLE_RATE_HZ;
    let p_value = p_value(&block_means(&values), &shape, &BlockNoises::new(truth.seconds), white);
    Some(p_value < FALSE_ALARM)
}

#[cfg(test)]
mod tests {
    use super::super::draw::RecordingGroup;
    use super::*;

    #[test]
    fn a_large_known_waveform_is_detected_and_an_absent_one_is_not() {
        let detected = |effect: &InjectedEffect| {
            let mut simulation = DrawnRecording::from_group(RecordingGroup::Nothing, 100.0, 3).simulation;
            simulation.scenario.effects = vec![effect.clone()];
            detects_known_waveform(effect, &simulation, &simulation.record())
        };
        let channel = OutputRegister::GyroX;
        let step = |size: f64| InjectedEffect::BiasStep { channel, time_s: 50.0, size };
        assert_eq!([detected(&step(1.0)), detected(&step(0.0))], [Some(true), Some(false)]);
        let ramp = |slope: f64| InjectedEffect::RateRamp { channel, slope };
        assert_eq!([detected(&ramp(0.05)), detected(&ramp(0.0))], [Some(true), Some(false)]);
        assert_eq!(detected(&InjectedEffect::Supply { channel, sensitivity: 100.0 }), Some(true));
        assert_eq!(detected(&InjectedEffect::Temperature { channel, sensitivity: 10.0 }), Some(true));
        assert_eq!(detected(&InjectedEffect::FilterBandwidth { taps_log2: 2 }), None);
    }
}
