//! Noise with declared coefficients: white noise, flicker noise, random walk and a constant, per channel.

use crate::output::OutputRegister;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// The noise of one channel, in the channel's unit U (deg/s, g, …) and seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChannelNoise {
    /// Constant value, U.
    pub bias: f64,
    /// N, U·√s: white noise of standard deviation N·√fs at the sample rate fs.
    pub angle_random_walk: f64,
    /// B, U: flicker noise of one-sided density B²/(πf), whose Allan deviation is B·√(2 ln2/π) at every τ.
    pub bias_instability: f64,
    /// K, U/√s: random walk that grows by K·√Δt a step.
    pub rate_random_walk: f64,
}

/// The noise of all channels.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseModel {
    /// Channels in burst order.
    pub channels: [ChannelNoise; 12],
    /// Flicker noise is generated for averaging times up to this one, s.
    pub longest_tau_s: f64,
}

impl NoiseModel {
    /// No noise at all: a level part at 5 V and 36 °C. z points so that it senses −1 g.
    pub fn still() -> Self {
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

    /// A part at rest whose gyros have the coefficients of the paper (N = 0.0368 deg/√s, B = 0.0093 deg/s,
    /// K = 0.0013 deg/s^1.5).
    ///
    /// The accelerometers have the data sheet's velocity random walk (0.2 m/s/√h) and in-run bias (0.2 mg), the
    /// magnetometers its density (0.066 mgauss/√Hz); the rest are plausible values without a source.
    pub fn paper() -> Self {
        let mut model = Self::still();
        for channel in [OutputRegister::GyroX, OutputRegister::GyroY, OutputRegister::GyroZ] {
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
            // A one-sided density is √2·N.
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

    /// The noise of one channel, to be changed.
    pub fn channel_mut(&mut self, channel: OutputRegister) -> &mut ChannelNoise {
        &mut self.channels[channel as usize]
    }
}

/// Generates the values of all channels, sample by sample.
#[derive(Clone, Debug)]
pub struct NoiseSource {
    channels: [ChannelSource; 12],
    longest_tau_s: f64,
}

impl NoiseSource {
    /// One ChaCha8 stream a channel, so that a channel's noise does not depend on that of the others.
    pub fn new(model: &NoiseModel, seed: u64, sample_period_s: f64) -> Self {
        let channels = std::array::from_fn(|index| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(index as u64);
            ChannelSource {
                random,
                noise: model.channels[index],
                walk: 0.0,
                white: 0.0,
                step: 0.0,
                flicker: Vec::new(),
            }
        });
        let mut source = Self { channels, longest_tau_s: model.longest_tau_s };
        source.set_sample_period(sample_period_s);
        source
    }

    /// Changes the time between samples, s. The random walks go on from where they are; flicker noise starts anew.
    pub fn set_sample_period(&mut self, sample_period_s: f64) {
        for channel in &mut self.channels {
            channel.set_sample_period(sample_period_s, self.longest_tau_s);
        }
    }

    /// The next value of every channel, in its unit.
    pub fn sample(&mut self) -> [f64; 12] {
        std::array::from_fn(|index| self.channels[index].sample())
    }
}

#[derive(Clone, Debug)]
struct ChannelSource {
    random: ChaCha8Rng,
    noise: ChannelNoise,
    walk: f64,
    white: f64,
    step: f64,
    flicker: Vec<GaussMarkov>,
}

impl ChannelSource {
    fn set_sample_period(&mut self, sample_period_s: f64, longest_tau_s: f64) {
        self.white = self.noise.angle_random_walk / sample_period_s.sqrt();
        self.step = self.noise.rate_random_walk * sample_period_s.sqrt();
        self.flicker.clear();
        if self.noise.bias_instability != 0.0 {
            let mut correlation_time_s = sample_period_s;
            while correlation_time_s <= 4.0 * longest_tau_s {
                let process = GaussMarkov::octave_of_flicker(
                    self.noise.bias_instability,
                    sample_period_s / correlation_time_s,
                    &mut self.random,
                );
                self.flicker.push(process);
                correlation_time_s *= 2.0;
            }
        }
    }

    fn sample(&mut self) -> f64 {
        let mut value = self.noise.bias;
        if self.white != 0.0 {
            value += self.white * gauss(&mut self.random);
        }
        for process in &mut self.flicker {
            process.state = process.decay * process.state + process.drive * gauss(&mut self.random);
            value += process.state;
        }
        if self.step != 0.0 {
            self.walk += self.step * gauss(&mut self.random);
            value += self.walk;
        }
        value
    }
}

/// First-order Gauss-Markov process.
#[derive(Clone, Copy, Debug)]
struct GaussMarkov {
    state: f64,
    decay: f64,
    drive: f64,
}

impl GaussMarkov {
    /// One of the processes, an octave of correlation time apart, that sum to flicker noise.
    ///
    /// A process of variance v and correlation time T has the one-sided density 4vT/(1 + (2πfT)²). Summed over
    /// d(ln T)/ln 2 processes that is v/(f·ln 2); equal to B²/(πf) if v = B²·ln 2/π.
    fn octave_of_flicker(bias_instability: f64, periods_per_correlation: f64, random: &mut ChaCha8Rng) -> Self {
        let sigma = bias_instability * (std::f64::consts::LN_2 / std::f64::consts::PI).sqrt();
        let decay = (-periods_per_correlation).exp();
        // 1 − decay², without cancellation for long correlation times.
        let drive = sigma * (-(-2.0 * periods_per_correlation).exp_m1()).sqrt();
        Self { state: sigma * gauss(random), decay, drive }
    }
}

/// A standard normal number.
pub(super) fn gauss(random: &mut ChaCha8Rng) -> f64 {
    random.sample(StandardNormal)
}

#[cfg(test)]
mod tests {
    use super::{NoiseModel, NoiseSource, OutputRegister};

    const SAMPLES: usize = 1 << 14;
    const SEEDS: u64 = 60;

    /// Allan variance at averaging factor `n`, sample period 1 s, by its definition (IEEE Std 952), no overlap.
    fn allan_variance(values: &[f64], n: usize) -> f64 {
        let means: Vec<f64> = values.chunks_exact(n).map(|chunk| chunk.iter().sum::<f64>() / n as f64).collect();
        let differences = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2));
        differences.sum::<f64>() / (2.0 * (means.len() - 1) as f64)
    }

    /// Mean over the seeds, and its standard error.
    fn mean_allan_variance(model: &NoiseModel, n: usize) -> (f64, f64) {
        let variances: Vec<f64> = (0..SEEDS)
            .map(|seed| {
                let mut source = NoiseSource::new(model, seed, 1.0);
                let values: Vec<f64> = (0..SAMPLES).map(|_| source.sample()[OutputRegister::GyroX as usize]).collect();
                allan_variance(&values, n)
            })
            .collect();
        let mean = variances.iter().sum::<f64>() / SEEDS as f64;
        let spread = variances.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (SEEDS - 1) as f64;
        (mean, (spread / SEEDS as f64).sqrt())
    }

    fn check(model: &NoiseModel, n: usize, expected: f64, bias: f64) {
        let (mean, error) = mean_allan_variance(model, n);
        assert!(
            (mean - expected).abs() < 5.0 * error + bias * expected,
            "n = {n}: {mean:e} ± {error:e}, expected {expected:e}"
        );
    }

    #[test]
    fn each_coefficient_is_what_it_says() {
        let mut model = NoiseModel::still();
        let gyro = model.channel_mut(OutputRegister::GyroX);
        gyro.angle_random_walk = 2.0;
        for n in [1, 16, 128] {
            check(&model, n, 4.0 / n as f64, 0.0);
        }

        let mut model = NoiseModel::still();
        model.channel_mut(OutputRegister::GyroX).rate_random_walk = 0.5;
        for n in [1, 16, 128] {
            // K²τ/3 for a continuous walk; sampled at n points a factor 1 + 1/(2n²).
            let tau = n as f64;
            check(&model, n, 0.25 * tau / 3.0 * (1.0 + 0.5 / (tau * tau)), 0.0);
        }

        let mut model = NoiseModel::still();
        model.channel_mut(OutputRegister::GyroX).bias_instability = 3.0;
        for n in [32, 256] {
            // Processes an octave apart ripple by less than 1 %; those shorter than the sample period are missing, as
            // is aliasing: about 1/n each.
            let expected = 9.0 * 2.0 * std::f64::consts::LN_2 / std::f64::consts::PI;
            check(&model, n, expected, 0.01 + 2.0 / n as f64);
        }
    }

    #[test]
    fn channels_and_seeds_are_independent_and_repeatable() {
        let model = NoiseModel::paper();
        let first: Vec<_> = (0..3).map(|seed| NoiseSource::new(&model, seed, 1.0).sample()).collect();
        assert_eq!(first[0], NoiseSource::new(&model, 0, 1.0).sample());
        assert_ne!(first[0], first[1]);
        assert_ne!(first[0][OutputRegister::GyroX as usize], first[0][OutputRegister::GyroY as usize]);

        let mut quiet = model.clone();
        *quiet.channel_mut(OutputRegister::GyroX) = Default::default();
        let changed = NoiseSource::new(&quiet, 0, 1.0).sample();
        assert_eq!(changed[OutputRegister::GyroY as usize], first[0][OutputRegister::GyroY as usize]);
    }
}
