//! The detection limit: the size that a test with knowledge of the truth detects in half of the recordings.
//!
//! At the limit the expected log likelihood ratio against the best description without the effect is `z²/2`, where `z`
//! is the normal quantile of 1 % over the number of places (frequencies, times, directions). Free in that description
//! are N, B and K, and for a telegraph signal a Markov process, for a common mode independent processes.
//!
//! The *strength* is the smaller of size over limit and of `z` over that at the limit ([`strength`]). `z` saturates for
//! slow processes and drift, and grows with the root of a number of events.
//!
//! | effect | log likelihood ratio |
//! |---|---|
//! | Markov, resonance, quantization, filter | Whittle's, over the Fourier frequencies |
//! | common mode | Whittle's, one process in all channels against independent processes |
//! | telegraph | hidden Markov chain against Kalman filter, on a simulated signal |
//! | sinusoid, acceleration | matched filter, with the density of the noise at their frequencies |
//! | ramp, step, temperature, supply | block means, with the variances of their cosines by the exact covariance |
//! | spikes | mixture of normal distributions |
//! | dropped and repeated samples | Poisson counts |
//! | sample clock | deviation beyond the tolerance of the host's clock |

use super::block_covariance::{BLOCKS, BlockNoise, BlockNoises, WaveformTest, environment_means};
use super::channel_under_test::{
    ChannelUnderTest, RecordLength, filter_gain, markov_density, quantization_density, resonance_density, squares,
};
use super::effect::{GYROS, size};
use super::generator::TrueRecording;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use statrs::distribution::{ContinuousCDF, DiscreteCDF, Normal, Poisson};
use std::f64::consts::{LN_2, PI};
use virtual_sensor::{InjectedEffect, OutputRegister};

/// Tolerance of a crystal, ±50 ppm, uniformly distributed.
pub(super) const HOST_CLOCK_TOLERANCE: f64 = 50e-6;
const FALSE_ALARM: f64 = 0.01;
const TIME_CONSTANTS: f64 = 12.0;
pub(super) const TIMES: f64 = 40.0;
const AXES: f64 = 3.0;
/// Steps per correlation time; the level is constant within a step.
const TELEGRAPH_STEPS: f64 = 20.0;
/// Number of simulated steps; the ratio is proportional to it.
const TELEGRAPH_LENGTH: usize = 20_000;

pub(super) fn strength(effect: &InjectedEffect, recording: &TrueRecording, others: &[InjectedEffect]) -> f64 {
    let of_size = size(effect) / smallest_size(effect, recording, others);
    let in_channel = |channel: OutputRegister| ChannelUnderTest::new(recording, channel, others);
    let of_z = |ratio: f64, required: f64| (ratio / required).max(0.0).sqrt();
    match *effect {
        InjectedEffect::Markov { channel, time_constant_s, deviation } => {
            let place = in_channel(channel);
            let density = |frequency: f64| markov_density(time_constant_s, place.record.period_s, frequency);
            of_size.min(of_z(ratio_of_process(&place, None, deviation, density), required_ratio(TIME_CONSTANTS)))
        }
        InjectedEffect::RateRamp { channel, .. }
        | InjectedEffect::BiasStep { channel, .. }
        | InjectedEffect::Temperature { channel, .. }
        | InjectedEffect::Supply { channel, .. } => {
            let Some((values, places)) = waveform(effect, recording) else { return of_size };
            let values: Vec<f64> = values.iter().map(|value| size(effect) * value).collect();
            of_size.min(of_z(waveform_test(&in_channel(channel)).ratio(&values), required_ratio(places)))
        }
        // The rarest spikes may not occur in the record at all.
        InjectedEffect::Spikes { rate_per_hour, .. } => {
            of_size.min((rate_per_hour * recording.seconds / 3600.0 / smallest_count(0.0)).sqrt())
        }
        InjectedEffect::DroppedSamples { .. } | InjectedEffect::RepeatedSamples { .. } => of_size.sqrt(),
        _ => of_size,
    }
}

/// Size of `unit` at the limit, in the presence of `others`.
pub(super) fn smallest_size(unit: &InjectedEffect, recording: &TrueRecording, others: &[InjectedEffect]) -> f64 {
    let record = RecordLength::new(recording);
    let (seconds, period_s) = (record.seconds, record.period_s);
    let samples = seconds / period_s;
    let in_channel = |channel: OutputRegister| ChannelUnderTest::new(recording, channel, others);
    match *unit {
        InjectedEffect::Sinusoid { channel, frequency_hz, .. } => {
            let noise = in_channel(channel).density_before_filter(frequency_hz);
            (required_ratio(0.5 * samples) / record.ratio_of_sinusoid(noise)).sqrt()
        }
        InjectedEffect::Resonance { channel, frequency_hz, bandwidth_hz, .. } => {
            let density = |frequency: f64| resonance_density(frequency_hz, bandwidth_hz, period_s, frequency);
            let places = 0.5 / period_s / bandwidth_hz;
            smallest_deviation(&in_channel(channel), places, Some((frequency_hz, bandwidth_hz)), density)
        }
        InjectedEffect::Markov { channel, time_constant_s, .. } => {
            smallest_markov(&in_channel(channel), time_constant_s)
        }
        InjectedEffect::Telegraph { channel, time_constant_s, .. } => {
            smallest_telegraph(&in_channel(channel), time_constant_s, recording.seed)
        }
        InjectedEffect::CommonMode { time_constant_s, .. } => {
            let gyros = GYROS.map(in_channel);
            let separate = gyros.each_ref().map(|gyro| |frequency: f64| gyro.density_before_filter(frequency));
            let separate: [&dyn Fn(f64) -> f64; 3] = [&separate[0], &separate[1], &separate[2]];
            let density = |frequency: f64| markov_density(time_constant_s, period_s, frequency);
            solve_size(required_ratio(TIME_CONSTANTS), |size| {
                record.ratio_of_common_mode(|frequency| size * size * density(frequency), &separate)
            })
        }
        InjectedEffect::Quantization { channel, .. } => {
            let place = in_channel(channel);
            let density = |frequency: f64| quantization_density(period_s, frequency) / place.gain(frequency);
            smallest_deviation(&place, 1.0, None, density)
        }
        InjectedEffect::FilterBandwidth { taps_log2 } => {
            let place = in_channel(OutputRegister::GyroX);
            let truth = |frequency: f64| {
                let rounding = place.rounding_density(frequency);
                (place.density(frequency) - rounding) * filter_gain(taps_log2, period_s, frequency) + rounding
            };
            // The size of a filter is always 1, and its strength is the ratio of `z`.
            (required_ratio(1.0) / ratio_against_baseline(&place, None, truth)).sqrt()
        }
        InjectedEffect::RateRamp { channel, .. }
        | InjectedEffect::BiasStep { channel, .. }
        | InjectedEffect::Temperature { channel, .. }
        | InjectedEffect::Supply { channel, .. } => {
            let Some((values, places)) = waveform(unit, recording) else { return f64::INFINITY };
            let test = waveform_test(&in_channel(channel));
            solve_size(required_ratio(places), |size| {
                test.ratio(&values.iter().map(|value| size * value).collect::<Vec<f64>>())
            })
        }
        InjectedEffect::Acceleration { channel, .. } => {
            let (place, motion) = (in_channel(channel), recording.scenario.environment.motion);
            let force = |frequency: f64| {
                motion.deviation_g.powi(2) * markov_density(motion.time_constant_s, period_s, frequency)
            };
            let noise = |frequency: f64| place.density_before_filter(frequency);
            (required_ratio(AXES) / record.ratio_of_waveform(force, noise)).sqrt()
        }
        InjectedEffect::Spikes { channel, rate_per_hour, .. } => {
            let place = in_channel(channel);
            let probability = rate_per_hour * period_s / 3600.0;
            let relative = solve_size(required_ratio(1.0), |size| ratio_of_spikes(samples, probability, size));
            relative / record.mean(|frequency| period_s / place.density_before_filter(frequency)).sqrt()
        }
        InjectedEffect::DroppedSamples { .. } => smallest_count(0.0) / samples,
        InjectedEffect::RepeatedSamples { .. } => {
            let equal = |&channel: &OutputRegister| in_channel(channel).equal_probability();
            smallest_count(samples * OutputRegister::INERTIAL.iter().map(equal).product::<f64>()) / samples
        }
        // The limit is the host's tolerance: half of the hosts err in the direction of the effect.
        InjectedEffect::SampleClock { .. } => HOST_CLOCK_TOLERANCE,
    }
}

fn smallest_markov(place: &ChannelUnderTest<'_>, time_constant_s: f64) -> f64 {
    let period_s = place.record.period_s;
    smallest_deviation(place, TIME_CONSTANTS, None, |frequency| markov_density(time_constant_s, period_s, frequency))
}

/// Smallest amplitude that is detected and distinguished from a Markov process.
fn smallest_telegraph(place: &ChannelUnderTest<'_>, time_constant_s: f64, seed: u64) -> f64 {
    let density = place.density_before_filter(0.5 / (PI * time_constant_s));
    let unit = (density / time_constant_s).sqrt();
    let distinguished = solve_size(required_ratio(1.0), |relative| {
        ratio_of_telegraph(relative * unit, time_constant_s, density, place.record, seed)
    });
    (2.0 * smallest_markov(place, time_constant_s)).max(unit * distinguished)
}

/// Deviation at the limit of a process of density `unit_density` with `places` places; `peak` is centre and width, Hz.
pub(super) fn smallest_deviation(
    place: &ChannelUnderTest<'_>,
    places: f64,
    peak: Option<(f64, f64)>,
    unit_density: impl Fn(f64) -> f64,
) -> f64 {
    // Sizes are relative to the white noise, so that the search begins near the result.
    let white = place.noise.angle_random_walk / place.record.period_s.sqrt();
    let ratio = |relative: f64| ratio_of_process(place, peak, relative * white, &unit_density);
    white * solve_size(required_ratio(places), ratio)
}

fn ratio_of_process(
    place: &ChannelUnderTest<'_>,
    peak: Option<(f64, f64)>,
    deviation: f64,
    unit_density: impl Fn(f64) -> f64,
) -> f64 {
    let truth = |frequency: f64| {
        place.density(frequency) + deviation * deviation * place.gain(frequency) * unit_density(frequency)
    };
    ratio_against_baseline(place, peak, truth)
}

fn ratio_against_baseline(place: &ChannelUnderTest<'_>, peak: Option<(f64, f64)>, truth: impl Fn(f64) -> f64) -> f64 {
    let known = |frequency: f64| place.known_density(frequency);
    place.record.ratio_against_baseline(place.noise, (|frequency| place.noise_gains(frequency), known), peak, truth)
}

/// `z²/2` for `places` places.
pub(super) fn required_ratio(places: f64) -> f64 {
    let z = Normal::standard().inverse_cdf(1.0 - FALSE_ALARM / places.max(1.0));
    0.5 * z * z
}

/// Solves `ratio(size) = required` to one part in 10⁹; `ratio` increases.
pub(super) fn solve_size(required: f64, ratio: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (1e-9f64, 1e6f64);
    while high > (1.0 + 1e-9) * low {
        let middle = (low * high).sqrt();
        if ratio(middle) < required { low = middle } else { high = middle }
    }
    (low * high).sqrt()
}

/// Expected log likelihood ratio of two levels `amplitude` apart against a Gauss-Markov process of equal covariance.
pub(super) fn ratio_of_telegraph(
    amplitude: f64,
    time_constant_s: f64,
    density: f64,
    record: RecordLength,
    seed: u64,
) -> f64 {
    let step_s = (time_constant_s / TELEGRAPH_STEPS).max(record.period_s);
    let noise = density / step_s;
    let (half, decay) = (0.5 * amplitude, (-step_s / time_constant_s).exp());
    let variance = half * half;
    let stay = 0.5 * (1.0 + decay);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut up, mut belief) = (true, 0.5);
    let (mut estimate, mut uncertainty) = (0.0, variance);
    let mut ratio = 0.0;
    for _ in 0..TELEGRAPH_LENGTH {
        up ^= !random.random_bool(stay);
        let white: f64 = random.sample(StandardNormal);
        let value = if up { half } else { -half } + noise.sqrt() * white;

        let [above, below] = [half, -half].map(|level| -0.5 * (value - level).powi(2) / noise);
        let nearer = above.max(below);
        let (above, below) = (belief * (above - nearer).exp(), (1.0 - belief) * (below - nearer).exp());
        let total = (above + below).max(f64::MIN_POSITIVE);
        ratio += total.ln() + nearer - 0.5 * noise.ln();
        belief = stay * above / total + (1.0 - stay) * below / total;

        let spread = uncertainty + noise;
        let error: f64 = value - estimate;
        ratio += 0.5 * (error * error / spread + spread.ln());
        let gain = uncertainty / spread;
        estimate = decay * (estimate + gain * error);
        uncertainty = decay * decay * uncertainty * (1.0 - gain) + (1.0 - decay * decay) * variance;
    }
    ratio * record.seconds / step_s / TELEGRAPH_LENGTH as f64
}

/// Expected log likelihood ratio for `samples` samples, a fraction `probability` of which is shifted by ±`size` σ.
pub(super) fn ratio_of_spikes(samples: f64, probability: f64, size: f64) -> f64 {
    let step = 0.05;
    // Larger sizes would overflow, and are far above the limit.
    let size = size.min(37.0);
    let gain = |value: f64| {
        let raised = 0.5 * ((size * value - 0.5 * size * size).exp() + (-size * value - 0.5 * size * size).exp());
        (probability * (raised - 1.0)).ln_1p()
    };
    let mean = |centre: f64| {
        let density = |deviation: f64| (-0.5 * deviation * deviation).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let at = |k: i32| f64::from(k) * step;
        (-160..=160).map(|k| step * density(at(k)) * gain(centre + at(k))).sum::<f64>()
    };
    samples * ((1.0 - probability) * mean(0.0) + probability * mean(size))
}

/// Mean number of events at the limit, in addition to a mean of `by_chance`.
pub(super) fn smallest_count(by_chance: f64) -> f64 {
    // This is the probability of more than `count` events by chance.
    let exceeds = |count: u64| Poisson::new(by_chance).map_or(0.0, |distribution| distribution.sf(count));
    let mut fewest = 1_u64;
    while exceeds(fewest - 1) > FALSE_ALARM {
        fewest += 1;
    }
    // The median of a Poisson variable is its mean − 1/3; for one event the mean is ln 2.
    if fewest == 1 { LN_2 } else { fewest as f64 - 1.0 / 3.0 - by_chance }
}

fn waveform(effect: &InjectedEffect, recording: &TrueRecording) -> Option<(Vec<f64>, f64)> {
    let block_s = block_s(RecordLength::new(recording));
    let of_environment = || environment_means(&recording.environment(recording.samples()));
    match effect {
        InjectedEffect::RateRamp { .. } => Some(((0..BLOCKS).map(|block| block as f64 * block_s).collect(), 1.0)),
        InjectedEffect::BiasStep { time_s, .. } => {
            let at = time_s / block_s;
            Some(((0..BLOCKS).map(|block| (1.0 - (at - block as f64)).clamp(0.0, 1.0)).collect(), TIMES))
        }
        InjectedEffect::Temperature { .. } => {
            let [means, _] = of_environment();
            Some((means, 1.0))
        }
        InjectedEffect::Supply { .. } => {
            let [_, means] = of_environment();
            Some((means, 1.0))
        }
        _ => None,
    }
}

fn block_s(record: RecordLength) -> f64 {
    record.seconds / BLOCKS as f64
}

pub(super) fn waveform_test(place: &ChannelUnderTest<'_>) -> WaveformTest {
    let rounding = place.resolution().powi(2) / 12.0 * place.record.period_s;
    let processes: Vec<(f64, f64)> = place.processes().collect();
    let noise = BlockNoise {
        white: place.white_density() + rounding,
        flicker: place.noise.bias_instability,
        walk: place.noise.rate_random_walk,
        processes: &processes,
    };
    WaveformTest::new(&noise, squares(place.noise), &BlockNoises::new(place.record.seconds))
}
