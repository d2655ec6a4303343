//! Simulated output of a sensor with known noise coefficients: filtered by two cascaded averages and rounded to counts.

use noise_analysis::samples::uniform_series::UniformSeries;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::{PI, TAU};
use virtual_sensor::CascadedBoxFilter;
use virtual_sensor::NoiseSource;
use virtual_sensor::{NoiseModel, OutputRegister};

pub(crate) const RATE_HZ: f64 = 204.8;
/// LSB of the gyros in their widest range, deg/s.
const LSB: f64 = 0.05;

/// N, B and K of the noise, a signal that is added before the filter, and the length of the filter.
pub(crate) struct Output<'a> {
    pub(crate) noise: [f64; 3],
    pub(crate) taps_log2: u8,
    pub(crate) added: &'a [f64],
}

/// The gyro of the paper, with the part's default filter.
pub(crate) const PAPER: Output<'static> = Output { noise: [0.0368, 0.0093, 0.0013], taps_log2: 2, added: &[] };

impl Output<'_> {
    pub(crate) fn samples(&self, samples: usize, seed: u64) -> UniformSeries {
        let mut model = NoiseModel::noiseless();
        let gyro = model.channel_mut(OutputRegister::GyroX);
        [gyro.angle_random_walk, gyro.bias_instability, gyro.rate_random_walk] = self.noise;
        let mut source = NoiseSource::new(&model, seed, 1.0 / RATE_HZ);
        let mut filter = CascadedBoxFilter::new(self.taps_log2);
        let value = |at: usize| {
            let added = self.added.get(at).copied().unwrap_or(0.0);
            (filter.filter(source.sample()[OutputRegister::GyroX as usize] + added) / LSB).round() * LSB
        };
        UniformSeries::new(1.0 / RATE_HZ, (0..samples).map(value).collect())
    }
}

/// A sinusoid whose phase, in rad, is the number of its frequency in Hz.
pub(crate) fn sine(amplitude: f64, frequency: f64, samples: usize) -> Vec<f64> {
    (0..samples).map(|at| amplitude * (TAU * frequency * at as f64 / RATE_HZ + frequency).cos()).collect()
}

/// A damped oscillation driven by noise: a carrier whose two quadratures are first-order Markov processes. Its density is a
/// Lorentz curve of full width `width` Hz.
pub(crate) fn resonance(deviation: f64, frequency: f64, width: f64, samples: usize, seed: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut gauss = || random.sample::<f64, _>(StandardNormal);
    let decay = (-PI * width / RATE_HZ).exp();
    let drive = (1.0 - decay * decay).sqrt();
    let (mut in_phase, mut quadrature) = (gauss(), gauss());
    let value = |at: usize| {
        in_phase = decay * in_phase + drive * gauss();
        quadrature = decay * quadrature + drive * gauss();
        let phase = TAU * frequency * at as f64 / RATE_HZ;
        deviation * (in_phase * phase.cos() + quadrature * phase.sin())
    };
    (0..samples).map(value).collect()
}

/// Amplitude gain of the filter: each of two averages over `2^taps_log2` samples gives a ratio of sines.
pub(crate) fn gain(frequency: f64, taps_log2: u8) -> f64 {
    let taps = f64::from(1 << taps_log2);
    let half = PI * frequency / RATE_HZ;
    ((taps * half).sin() / (taps * half.sin())).powi(2)
}
