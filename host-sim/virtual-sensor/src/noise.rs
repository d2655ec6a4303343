//! Noise with declared coefficients per channel (white noise, flicker noise, random walk and a constant value), and the
//! random processes of effects and environment.

use crate::registers::OutputRegister;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::PI;

/// The noise of one channel, in the channel's unit U (°/s, g, …) and seconds; coefficients of IEEE Std 952.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChannelNoise {
    /// Constant value, U.
    pub bias: f64,
    /// N, U·√s: white noise of standard deviation N·√fs at the sample rate fs.
    pub angle_random_walk: f64,
    /// B, U: flicker noise of one-sided density B²/(πf), whose Allan deviation is B·√(2 ln2/π) at every τ.
    pub bias_instability: f64,
    /// K, U/√s: random walk whose steps have standard deviation K·√Δt.
    pub rate_random_walk: f64,
}

/// The noise of all channels.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseModel {
    /// Channels in burst order.
    pub channels: [ChannelNoise; 12],
    /// Longest averaging time for which flicker noise is generated, s.
    pub longest_tau_s: f64,
}

impl NoiseModel {
    /// No noise: a level part at 5 V and 36 °C whose z accelerometer senses −1 g.
    pub fn noiseless() -> Self {
        let mut model = Self { channels: [ChannelNoise::default(); 12], longest_tau_s: 10_000.0 };
        for (channel, bias) in [
            (OutputRegister::Supply, 5.0),
            (OutputRegister::AcclZ, -1.0),
            (OutputRegister::MagnX, 0.2),
            (OutputRegister::MagnZ, 0.43),
            (OutputRegister::Temp, 36.0),
            (OutputRegister::AuxAdc, 0.5),
        ] {
            model.channel_mut(channel).bias = bias;
        }
        model
    }

    /// A part at rest whose gyros have the coefficients of L. Hristov, E. Iontchev, R. Miletiev, "Error modeling of MEMS
    /// ADIS 16405": N = 0.0368 °/√s, B = 0.0093 °/s, K = 0.0013 °/s^1.5.
    ///
    /// The accelerometers have the data sheet's velocity random walk (0.2 m/s/√h) and in-run bias (0.2 mg), the
    /// magnetometers its density (0.066 mgauss/√Hz); the other values are assumptions without a source.
    pub fn paper() -> Self {
        let mut model = Self::noiseless();
        for channel in OutputRegister::GYROS {
            let noise = model.channel_mut(channel);
            noise.angle_random_walk = 0.0368;
            noise.bias_instability = 0.0093;
            noise.rate_random_walk = 0.0013;
        }
        for channel in [OutputRegister::AcclX, OutputRegister::AcclY, OutputRegister::AcclZ] {
            let noise = model.channel_mut(channel);
            noise.angle_random_walk = 0.2 / 60.0 / 9.80665;
            noise.bias_instability = 0.2e-3;
            noise.rate_random_walk = 1e-5;
        }
        for channel in [OutputRegister::MagnX, OutputRegister::MagnY, OutputRegister::MagnZ] {
            // The one-sided density of white noise is √2·N.
            model.channel_mut(channel).angle_random_walk = 0.066e-3 / std::f64::consts::SQRT_2;
        }
        model.channel_mut(OutputRegister::Supply).angle_random_walk = 1e-4;
        model.channel_mut(OutputRegister::AuxAdc).angle_random_walk = 5e-5;
        model.channel_mut(OutputRegister::Temp).angle_random_walk = 2e-3;
        model.channel_mut(OutputRegister::Temp).rate_random_walk = 2e-3;
        model
    }

    /// The noise of one channel.
    pub fn channel(&self, channel: OutputRegister) -> &ChannelNoise {
        &self.channels[channel as usize]
    }

    /// The noise of one channel, for changes.
    pub fn channel_mut(&mut self, channel: OutputRegister) -> &mut ChannelNoise {
        &mut self.channels[channel as usize]
    }
}

/// Generates the values of all channels, sample by sample.
#[derive(Clone, Debug)]
pub struct NoiseSource {
    channels: [ChannelSource; 12],
}

impl NoiseSource {
    /// A source. Each channel has its own ChaCha8 stream, so its noise does not depend on other channels.
    pub fn new(model: &NoiseModel, seed: u64, sample_period_s: f64) -> Self {
        let channels = std::array::from_fn(|index| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(index as u64);
            ChannelSource {
                random,
                noise: model.channels[index],
                longest_tau_s: model.longest_tau_s,
                walk: 0.0,
                white: 0.0,
                step: 0.0,
                flicker: Vec::new(),
            }
        });
        let mut source = Self { channels };
        source.set_sample_period(sample_period_s);
        source
    }

    /// Changes the time between samples, s. The random walks continue; flicker noise starts again.
    pub fn set_sample_period(&mut self, sample_period_s: f64) {
        for channel in &mut self.channels {
            channel.set_sample_period(sample_period_s);
        }
    }

    /// The next value of every channel, in its unit.
    pub fn sample(&mut self) -> [f64; 12] {
        std::array::from_fn(|index| self.channels[index].sample())
    }

    /// The channels, in burst order.
    pub(crate) fn into_channels(self) -> [ChannelSource; 12] {
        self.channels
    }
}

/// Generates the values of one channel.
#[derive(Clone, Debug)]
pub(crate) struct ChannelSource {
    random: ChaCha8Rng,
    noise: ChannelNoise,
    longest_tau_s: f64,
    walk: f64,
    white: f64,
    step: f64,
    flicker: Vec<FlickerOctave>,
}

impl ChannelSource {
    pub(crate) fn set_sample_period(&mut self, sample_period_s: f64) {
        self.white = self.noise.angle_random_walk / sample_period_s.sqrt();
        self.step = self.noise.rate_random_walk * sample_period_s.sqrt();
        self.flicker.clear();
        if self.noise.bias_instability != 0.0 {
            let mut correlation_time_s = sample_period_s;
            while correlation_time_s <= 4.0 * self.longest_tau_s {
                let process = FlickerOctave::new(
                    self.noise.bias_instability,
                    sample_period_s / correlation_time_s,
                    &mut self.random,
                );
                self.flicker.push(process);
                correlation_time_s *= 2.0;
            }
        }
    }

    pub(crate) fn sample(&mut self) -> f64 {
        let mut value = self.noise.bias;
        if self.white != 0.0 {
            value += self.white * standard_normal(&mut self.random);
        }
        for process in &mut self.flicker {
            process.state = process.decay * process.state + process.drive * standard_normal(&mut self.random);
            value += process.state;
        }
        if self.step != 0.0 {
            self.walk += self.step * standard_normal(&mut self.random);
            value += self.walk;
        }
        value
    }
}

/// One of the Gauss-Markov processes that sum to flicker noise. Their correlation times are an octave apart.
#[derive(Clone, Copy, Debug)]
struct FlickerOctave {
    state: f64,
    decay: f64,
    drive: f64,
}

impl FlickerOctave {
    /// A process of variance v and correlation time T has the one-sided density 4vT/(1 + (2πfT)²). Summed over d(ln
    /// T)/ln 2 processes this is v/(f·ln 2), which equals B²/(πf) for v = B²·ln 2/π.
    fn new(bias_instability: f64, periods_per_correlation: f64, random: &mut ChaCha8Rng) -> Self {
        let sigma = bias_instability * (std::f64::consts::LN_2 / PI).sqrt();
        let decay = (-periods_per_correlation).exp();
        // This is 1 − decay², without cancellation for long correlation times.
        let drive = sigma * (-(-2.0 * periods_per_correlation).exp_m1()).sqrt();
        Self { state: sigma * standard_normal(random), decay, drive }
    }
}

/// First-order Gauss-Markov process of standard deviation 1.
#[derive(Clone, Debug)]
pub(crate) struct GaussMarkovProcess {
    time_constant_s: f64,
    state: Option<f64>,
}

impl GaussMarkovProcess {
    pub(crate) fn new(time_constant_s: f64) -> Self {
        Self { time_constant_s, state: None }
    }

    /// The value one period after the previous one.
    pub(crate) fn next(&mut self, period_s: f64, random: &mut ChaCha8Rng) -> f64 {
        let periods = period_s / self.time_constant_s;
        let state = match self.state {
            // `exp_m1` gives √(1 − decay²) without cancellation for long correlation times.
            Some(state) => (-periods).exp() * state + (-(-2.0 * periods).exp_m1()).sqrt() * standard_normal(random),
            None => standard_normal(random),
        };
        self.state = Some(state);
        state
    }
}

/// Narrow-band noise of standard deviation 1: a carrier with Gauss-Markov noise in phase and in quadrature.
#[derive(Clone, Debug)]
pub(crate) struct NarrowBandProcess {
    frequency_hz: f64,
    quadratures: [GaussMarkovProcess; 2],
}

impl NarrowBandProcess {
    /// `bandwidth_hz` is the width at half of the peak density.
    pub(crate) fn new(frequency_hz: f64, bandwidth_hz: f64) -> Self {
        // The covariance exp(−t/T) has a density of half width 1/(2πT).
        let envelope = GaussMarkovProcess::new(1.0 / (PI * bandwidth_hz));
        Self { frequency_hz, quadratures: [envelope.clone(), envelope] }
    }

    /// The value at `time_s`, one period after the previous one.
    pub(crate) fn next(&mut self, time_s: f64, period_s: f64, random: &mut ChaCha8Rng) -> f64 {
        let (sin, cos) = (2.0 * PI * (self.frequency_hz * time_s).fract()).sin_cos();
        let [in_phase, quadrature] = &mut self.quadratures;
        in_phase.next(period_s, random) * cos + quadrature.next(period_s, random) * sin
    }
}

/// Symmetric random telegraph signal of levels −½ and ½.
#[derive(Clone, Debug)]
pub(crate) struct TelegraphProcess {
    time_constant_s: f64,
    high: Option<bool>,
}

impl TelegraphProcess {
    pub(crate) fn new(time_constant_s: f64) -> Self {
        Self { time_constant_s, high: None }
    }

    /// The value one period after the previous one.
    pub(crate) fn next(&mut self, period_s: f64, random: &mut ChaCha8Rng) -> f64 {
        // The probability of an odd number of jumps in a period gives the covariance exp(−t/T) for any T.
        let odd = -0.5 * (-period_s / self.time_constant_s).exp_m1();
        let high = match self.high {
            Some(high) => high ^ random.random_bool(odd),
            None => random.random_bool(0.5),
        };
        self.high = Some(high);
        if high { 0.5 } else { -0.5 }
    }
}

fn standard_normal(random: &mut ChaCha8Rng) -> f64 {
    random.sample(StandardNormal)
}
