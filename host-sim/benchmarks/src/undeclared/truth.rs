//! Reference results from the truth: the error of the true model on unseen data, and whether a test that is given the
//! channel and the waveform of an effect detects it.

use super::draw::DrawnRecording;
use adis16405_driver::{Channel, GyroRange};
use allan_core::check::ModelError;
use allan_core::fit::fit_shapes;
use allan_core::model::Term;
use allan_core::term::{Filter, Markov, Resonance, Sinusoid};
use allan_core::{Cascade, Kind, Model};
use measurement::Measurement;
use noise_analysis::trace::Series;
use noise_analysis::trace::block::Blocks;
use noise_analysis::trace::evidence::Evidence;
use noise_analysis::trace::level::SIGNIFICANCE;
use noise_analysis::trace::noises::NoiseTable;
use noise_analysis::{OCTAVES, OVERLAP};
use recordings::recording::Sample;
use simulation::output_register;
use simulation::record::{RecordError, SAMPLE_RATE_HZ, Simulation};
use virtual_sensor::{ChannelNoise, Effect, Hidden, OutputRegister};

/// Whether an estimator could remove the effect from the data. Other effects are terms of the true model.
fn is_removable(effect: &Effect) -> bool {
    !matches!(
        effect,
        Effect::Sinusoid { .. }
            | Effect::Resonance { .. }
            | Effect::Markov { .. }
            | Effect::Telegraph { .. }
            | Effect::Quantization { .. }
            | Effect::RateRamp { .. }
            | Effect::FilterBandwidth { .. }
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
) -> Result<Option<TrueModelErrors>, RecordError> {
    let effects: Vec<Effect> =
        drawn.simulation.hidden.effects.iter().filter(|effect| !is_removable(effect)).cloned().collect();
    let model = model(drawn.simulation.noise.channel(output_register(channel)), channel, &effects);
    // Each effect has the random stream of its index, so a removed effect is replaced by one of size 0.
    let hidden = Hidden {
        effects: drawn.simulation.hidden.effects.iter().map(zero_if_removable).collect(),
        ..drawn.simulation.hidden.clone()
    };
    let recording = Simulation { hidden, ..drawn.simulation.clone() }.run(|_| ())?;
    let (first, second) = recording.samples.split_at(recording.samples.len() / 2);
    let curve = |samples: &[Sample]| curve(samples, channel, recording.range);
    let mut kinds: Vec<Kind> = model.terms().iter().map(|term| term.kind).collect();
    kinds.dedup();
    let fitted = fit_shapes(&curve(first), &kinds);
    let error = |model: &Model| Some(ModelError::between(model, &curve(second))?.deviance_per_point);
    Ok(error(&model).zip(error(&fitted)).map(|(model, fitted)| TrueModelErrors { model, fitted }))
}

fn zero_if_removable(effect: &Effect) -> Effect {
    let channel = effect.channels().first().copied().unwrap_or(OutputRegister::AuxAdc);
    if is_removable(effect) { Effect::RateRamp { channel, slope: 0.0 } } else { effect.clone() }
}

/// The true model of `channel` with `effects`.
fn model(noise: &ChannelNoise, channel: Channel, effects: &[Effect]) -> Model {
    let period_s = 1.0 / SAMPLE_RATE_HZ;
    let rounding = channel.lsb(GyroRange::Dps300) * (period_s / 12.0).sqrt();
    let taps = effects.iter().find_map(|effect| match effect {
        Effect::FilterBandwidth { taps_log2 } => Some(1u16 << taps_log2),
        _ => None,
    });
    let white = taps.map_or(Kind::AngleRandomWalk, |taps| Kind::Filtered(Filter::bartlett(taps)));
    let baseline = [
        Term::exact(white, noise.angle_random_walk),
        Term::exact(Kind::AngleRandomWalk, rounding),
        Term::exact(Kind::BiasInstability, noise.bias_instability),
        Term::exact(Kind::RateRandomWalk, noise.rate_random_walk),
    ];
    let added = effects.iter().filter(|effect| effect.channels().contains(&output_register(channel)));
    Model::new(period_s, baseline.into_iter().chain(added.filter_map(term)))
}

fn term(effect: &Effect) -> Option<Term> {
    let (kind, value) = match *effect {
        Effect::Sinusoid { frequency_hz, amplitude, .. } => {
            (Kind::Sinusoid(Sinusoid { frequency: frequency_hz }), amplitude)
        }
        Effect::Resonance { frequency_hz, bandwidth_hz, deviation, .. } => {
            (Kind::Resonance(Resonance { frequency: frequency_hz, bandwidth: bandwidth_hz }), deviation)
        }
        Effect::Markov { time_constant_s, deviation, .. } => {
            (Kind::Markov(Markov { time_constant: time_constant_s }), deviation)
        }
        Effect::Telegraph { time_constant_s, amplitude, .. } => {
            (Kind::Markov(Markov { time_constant: time_constant_s }), 0.5 * amplitude)
        }
        Effect::Quantization { coefficient, .. } => (Kind::Quantization, coefficient),
        Effect::RateRamp { slope, .. } => (Kind::RateRamp, slope.abs()),
        _ => return None,
    };
    Some(Term::exact(kind, value))
}

fn curve(samples: &[Sample], channel: Channel, range: GyroRange) -> allan_core::Curve<OCTAVES> {
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
pub(super) fn detects_known_waveform(effect: &Effect, measurement: &Measurement, begin_s: f64) -> Option<bool> {
    let series = |channel: Channel| Series::of(measurement, &measurement.profile.channels[channel as usize]);
    let own = series(simulation::channel(*effect.channels().first()?));
    let blocks = Blocks::of(&own)?;
    let waveform = match effect {
        Effect::RateRamp { .. } => blocks.ramp(),
        Effect::BiasStep { time_s, .. } => blocks.step_at(((time_s - begin_s) / own.period_s).max(0.0) as u64),
        Effect::Temperature { .. } => Blocks::of(&series(Channel::Temp))?.means,
        Effect::Supply { .. } => Blocks::of(&series(Channel::Supply))?.means,
        _ => return None,
    };
    let noises = NoiseTable::default().of(&blocks);
    let estimate = Evidence::of(&blocks, &noises, &[]).shape(&waveform)?;
    Some(estimate.p_value < SIGNIFICANCE)
}

#[cfg(test)]
mod tests {
    use super::super::draw::RecordingGroup;
    use super::*;

    #[test]
    fn a_large_known_waveform_is_detected_and_an_absent_one_is_not() {
        let detected = |effect: &Effect| {
            let mut simulation = DrawnRecording::from_group(RecordingGroup::Nothing, 100.0, 3).simulation;
            simulation.hidden.effects = vec![effect.clone()];
            let recording = simulation.run(|_| ()).unwrap();
            detects_known_waveform(effect, &recordings::timeline::measurement(&recording, None).unwrap(), 0.2)
        };
        let channel = OutputRegister::GyroX;
        let step = |size: f64| Effect::BiasStep { channel, time_s: 50.0, size };
        assert_eq!([detected(&step(1.0)), detected(&step(0.0))], [Some(true), Some(false)]);
        let ramp = |slope: f64| Effect::RateRamp { channel, slope };
        assert_eq!([detected(&ramp(0.05)), detected(&ramp(0.0))], [Some(true), Some(false)]);
        assert_eq!(detected(&Effect::Supply { channel, sensitivity: 100.0 }), Some(true));
        assert_eq!(detected(&Effect::Temperature { channel, sensitivity: 10.0 }), Some(true));
        assert_eq!(detected(&Effect::FilterBandwidth { taps_log2: 2 }), None);
    }
}
