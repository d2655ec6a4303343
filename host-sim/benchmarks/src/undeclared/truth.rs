//! Reference results from the truth: the error of the true model on unseen data, and whether a test that is given the
//! channel and the waveform of an effect detects it.

use super::draw::DrawnRecording;
use adis16405_driver::{Channel, GyroRange};
use allan_core::fit::fit_shapes;
use allan_core::model::Discrepancy;
use allan_core::model::FittedTerm;
use allan_core::term::{Markov, MovingAverageFilter, Resonance, Sinusoid};
use allan_core::{Cascade, Model, NoiseTerm};
use measurement::Measurement;
use noise_analysis::detectors::bias::SIGNIFICANCE;
use noise_analysis::detectors::block_means::BlockMeans;
use noise_analysis::detectors::block_means::NoiseGrids;
use noise_analysis::detectors::gls_regression::GlsRegression;
use noise_analysis::series::Series;
use noise_analysis::{OCTAVES, OVERLAP};
use recordings::recording::RecordedSample;
use simulation::output_register;
use simulation::{SAMPLE_RATE_HZ, Simulation, SimulationError};
use virtual_sensor::{ChannelNoise, InjectedEffect, OutputRegister, SensorScenario};

/// Whether an estimator could remove the effect from the data. Other effects are terms of the true model.
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

/// Deviance per point on the second half of a recording without its removable effects. A common mode is removable, by
/// the other channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TrueModelErrors {
    /// Of the true model.
    pub(super) model: f64,
    /// Of the true terms with coefficients and shapes that are fitted to the first half.
    pub(super) fitted: f64,
}

/// The errors in `channel`; `None` where the recording is too short.
///
/// # Errors
/// The recording without the removable effects cannot be simulated.
pub(super) fn true_model_errors(
    drawn: &DrawnRecording,
    channel: Channel,
) -> Result<Option<TrueModelErrors>, SimulationError> {
    let effects: Vec<InjectedEffect> =
        drawn.simulation.scenario.effects.iter().filter(|effect| !is_removable(effect)).cloned().collect();
    let model = model(drawn.simulation.noise.channel(output_register(channel)), channel, &effects);
    // Each effect has the random stream of its index, so a removed effect is replaced by one of size 0.
    let hidden = SensorScenario {
        effects: drawn.simulation.scenario.effects.iter().map(zero_if_removable).collect(),
        ..drawn.simulation.scenario.clone()
    };
    let recording = Simulation { scenario: hidden, ..drawn.simulation.clone() }.run(|_| ())?;
    let (first, second) = recording.samples.split_at(recording.samples.len() / 2);
    let curve = |samples: &[RecordedSample]| curve(samples, channel, recording.range);
    let mut kinds: Vec<NoiseTerm> = model.terms().iter().map(|term| term.kind).collect();
    kinds.dedup();
    let fitted = fit_shapes(&curve(first), &kinds);
    let error = |model: &Model| Some(Discrepancy::between(model, &curve(second))?.deviance_per_point);
    Ok(error(&model).zip(error(&fitted)).map(|(model, fitted)| TrueModelErrors { model, fitted }))
}

fn zero_if_removable(effect: &InjectedEffect) -> InjectedEffect {
    let channel = effect.channels().first().copied().unwrap_or(OutputRegister::AuxAdc);
    if is_removable(effect) { InjectedEffect::RateRamp { channel, slope: 0.0 } } else { effect.clone() }
}

/// The true model of `channel` with `effects`.
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

/// Whether a test that is given channel and waveform of `effect`, but estimates the noise, detects it at the significance
/// level of the analysis; `None` for effects that are not a known waveform of the bias. `begin_s` is the time from the start
/// of the sensor to the first sample.
///
/// The slowest noise has few periods in a recording, from which the test estimates both its size and the effect: Student's
/// distribution with few degrees of freedom. This is an upper limit for methods that have to find channel and waveform too.
pub(super) fn detects_known_waveform(effect: &InjectedEffect, measurement: &Measurement, begin_s: f64) -> Option<bool> {
    let series =
        |channel: Channel| Series::from_measurement(measurement, &measurement.profile.channels[channel as usize]);
    let own = series(simulation::channel(*effect.channels().first()?));
    let blocks = BlockMeans::from_series(&own)?;
    let waveform = match effect {
        InjectedEffect::RateRamp { .. } => blocks.ramp(),
        InjectedEffect::BiasStep { time_s, .. } => blocks.step_at(((time_s - begin_s) / own.period_s).max(0.0) as u64),
        InjectedEffect::Temperature { .. } => BlockMeans::from_series(&series(Channel::Temp))?.means,
        InjectedEffect::Supply { .. } => BlockMeans::from_series(&series(Channel::Supply))?.means,
        _ => return None,
    };
    let noises = NoiseGrids::default().get(&blocks);
    let estimate = GlsRegression::new(&blocks, &noises, &[]).estimate(&waveform)?;
    Some(estimate.p_value < SIGNIFICANCE)
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
            let recording = simulation.run(|_| ()).unwrap();
            detects_known_waveform(effect, &recordings::time_base::measurement(&recording, None).unwrap(), 0.2)
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
