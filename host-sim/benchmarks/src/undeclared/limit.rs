//! The smallest effect that any test could see.
//!
//! A likelihood-ratio test that knows the truth sees an effect in half of the recordings when the expected logarithm of
//! the likelihood ratio, of the truth against the best description without the effect, is `z²/2`: exactly so for
//! Gaussian data whose mean is shifted by `z` standard deviations, nearly so for the others. `z` is the point that a
//! standard normal number exceeds with 1 %, divided by the number of places (frequencies, times, directions) where the
//! effect could be: that much nobody can know. "Best description" leaves N, B and K free; a telegraph signal has to
//! be told from a Markov process as well, a common mode from independent ones. Everything is known of the other effect of
//! a pair: it is more noise, or a filter, or nothing.
//!
//! | effect | log likelihood ratio |
//! |---|---|
//! | Markov, resonance, quantization, filter | Whittle's, over the Fourier frequencies |
//! | common mode | the same, of the coherent against the separate channels |
//! | telegraph | hidden Markov chain against Kalman filter, on a simulated path |
//! | sinusoid, acceleration | matched filter in the noise at their frequencies |
//! | ramp, step, temperature, supply | regression on block means with the covariance of the noise |
//! | spikes | mixture of normal laws |
//! | lost and repeated samples | Poisson count; sample clock: the host's clock |

pub(super) mod chain;
pub(super) mod events;
pub(super) mod spectrum;
pub(super) mod unknown_noise;
pub(super) mod waveform;

use super::place::{Place, Scene};
use super::shape::GYROS;
use noise_analysis::distributions::quantile;
use noise_analysis::trace::sample_clock::HOST_CLOCK;
use std::f64::consts::PI;
use virtual_sensor::{InjectedEffect, OutputRegister};

/// Probability of a false alarm at which the limit is set.
const FALSE_ALARM: f64 = 0.01;
/// Octaves of time constants that can be told apart in half an hour.
const TIME_CONSTANTS: f64 = 12.0;
/// Independent times of a step.
const TIMES: f64 = 40.0;
/// Axes along which a force may act.
const AXES: f64 = 3.0;

/// The size that an effect shaped like `shape` has at the limit, `others` being there already.
pub(super) fn smallest(shape: &InjectedEffect, scene: &Scene<'_>, others: &[InjectedEffect]) -> f64 {
    let record = scene.record;
    let (seconds, period_s) = (record.seconds, record.period_s);
    let samples = seconds / period_s;
    let in_channel = |channel: OutputRegister| Place::of(scene, channel, others);
    match *shape {
        InjectedEffect::Sinusoid { channel, frequency_hz, .. } => {
            (needed(0.5 * samples) / record.line(in_channel(channel).sensed(frequency_hz))).sqrt()
        }
        InjectedEffect::Resonance { channel, frequency_hz, bandwidth_hz, .. } => {
            let density = |frequency: f64| spectrum::resonance(frequency_hz, bandwidth_hz, period_s, frequency);
            let looks = 0.5 / period_s / bandwidth_hz;
            deviation(&in_channel(channel), looks, Some((frequency_hz, bandwidth_hz)), density)
        }
        InjectedEffect::Markov { channel, time_constant_s, .. } => markov(&in_channel(channel), time_constant_s),
        InjectedEffect::Telegraph { channel, time_constant_s, .. } => {
            telegraph(&in_channel(channel), time_constant_s, scene.seed)
        }
        InjectedEffect::CommonMode { time_constant_s, .. } => {
            let places = GYROS.map(in_channel);
            let alone = places.each_ref().map(|place| |frequency: f64| place.sensed(frequency));
            let alone: [&dyn Fn(f64) -> f64; 3] = [&alone[0], &alone[1], &alone[2]];
            let shape = |frequency: f64| spectrum::markov(time_constant_s, period_s, frequency);
            size(needed(TIME_CONSTANTS), |size| record.coherent(|frequency| size * size * shape(frequency), &alone))
        }
        InjectedEffect::Quantization { channel, .. } => {
            let place = in_channel(channel);
            // It comes behind the filter.
            let density = |frequency: f64| spectrum::quantization(period_s, frequency) / place.gain(frequency);
            deviation(&place, 1.0, None, density)
        }
        InjectedEffect::FilterBandwidth { taps_log2 } => {
            let place = in_channel(OutputRegister::GyroX);
            let truth = |frequency: f64| {
                let rounding = place.rounding(frequency);
                (place.density(frequency) - rounding) * spectrum::filter(taps_log2, period_s, frequency) + rounding
            };
            // There is no half a filter: how far it is from the limit is its strength.
            (needed(1.0) / against_declared(&place, None, truth)).sqrt()
        }
        InjectedEffect::RateRamp { channel, .. } => {
            waveform::smallest(1.0, &in_channel(channel), |block| block as f64 * waveform::block_s(record))
        }
        InjectedEffect::BiasStep { channel, time_s, .. } => {
            let at = time_s / waveform::block_s(record);
            waveform::smallest(TIMES, &in_channel(channel), |block| (1.0 - (at - block as f64)).clamp(0.0, 1.0))
        }
        InjectedEffect::Temperature { channel, .. } => {
            let course = waveform::course(scene, OutputRegister::Temp);
            waveform::smallest(1.0, &in_channel(channel), |block| course[block])
        }
        InjectedEffect::Supply { channel, .. } => {
            let course = waveform::course(scene, OutputRegister::Supply);
            waveform::smallest(1.0, &in_channel(channel), |block| course[block])
        }
        InjectedEffect::Acceleration { channel, .. } => {
            let (place, motion) = (in_channel(channel), scene.surroundings.motion);
            let force = |frequency: f64| {
                motion.deviation_g.powi(2) * spectrum::markov(motion.time_constant_s, period_s, frequency)
            };
            (needed(AXES) / record.matched(force, |frequency| place.sensed(frequency))).sqrt()
        }
        InjectedEffect::Spikes { channel, rate_per_hour, .. } => {
            let place = in_channel(channel);
            let probability = rate_per_hour * period_s / 3600.0;
            let of_noise = size(needed(1.0), |size| events::spikes(samples, probability, size));
            of_noise / record.mean(|frequency| period_s / place.sensed(frequency)).sqrt()
        }
        InjectedEffect::DroppedSamples { .. } => events::count(0.0) / samples,
        InjectedEffect::RepeatedSamples { .. } => {
            let equal = |&channel: &OutputRegister| in_channel(channel).equal_by_chance();
            events::count(samples * OutputRegister::INERTIAL.iter().map(equal).product::<f64>()) / samples
        }
        InjectedEffect::SampleClock { .. } => size(needed(1.0), |off| events::clock(off * HOST_CLOCK)) * HOST_CLOCK,
    }
}

fn markov(place: &Place<'_>, time_constant_s: f64) -> f64 {
    let period_s = place.record.period_s;
    deviation(place, TIME_CONSTANTS, None, |frequency| spectrum::markov(time_constant_s, period_s, frequency))
}

/// Seen at all, and told from a Markov process.
fn telegraph(place: &Place<'_>, time_constant_s: f64, seed: u64) -> f64 {
    let density = place.sensed(0.5 / (PI * time_constant_s));
    let from_markov = |amplitude: f64| {
        let record = place.record;
        chain::telegraph_from_markov(amplitude, time_constant_s, density, record.period_s, record.seconds, seed)
    };
    let unit = (density / time_constant_s).sqrt();
    (2.0 * markov(place, time_constant_s)).max(unit * size(needed(1.0), |relative| from_markov(relative * unit)))
}

/// The deviation at which a process is at the limit that has, for a deviation of 1, the density `shape`.
fn deviation(place: &Place<'_>, looks: f64, peak: Option<(f64, f64)>, shape: impl Fn(f64) -> f64) -> f64 {
    // In units of the white noise of a sample, so that the search begins near.
    let white = place.noise.angle_random_walk / place.record.period_s.sqrt();
    let ratio = |relative: f64| {
        let square = (relative * white).powi(2);
        let truth = |frequency: f64| place.density(frequency) + square * place.gain(frequency) * shape(frequency);
        against_declared(place, peak, truth)
    };
    white * size(needed(looks), ratio)
}

fn against_declared(place: &Place<'_>, peak: Option<(f64, f64)>, truth: impl Fn(f64) -> f64) -> f64 {
    let known = |frequency: f64| place.known(frequency);
    place.record.against_declared(place.noise, (|frequency| place.gain(frequency), known), peak, truth)
}

/// The log likelihood ratio at which half of the effects are seen that could be at `places`.
pub(super) fn needed(places: f64) -> f64 {
    let z = quantile(FALSE_ALARM / places.max(1.0));
    0.5 * z * z
}

/// The size at which `ratio(size)`, which grows with the size, is `needed`.
pub(super) fn size(needed: f64, ratio: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (1e-9f64, 1e6f64);
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if ratio(middle) < needed { low = middle } else { high = middle }
    }
    (low * high).sqrt()
}
