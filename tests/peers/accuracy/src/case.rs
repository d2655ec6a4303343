//! The three cases: series with known noise.

use virtual_sensor::{NoiseModel, NoiseSource, OutputRegister};

/// Samples of a series.
pub(crate) const SAMPLES: usize = 1_000_000;
/// Seconds between samples.
pub(crate) const SAMPLE_PERIOD: f64 = 0.01;
/// Number of series that are generated together, one per channel.
pub(crate) const BATCH: usize = 6;

/// N, B, K; `None` if a method gives no value.
pub(crate) type Coefficients = [Option<f64>; 3];

/// A mixture of white noise, flicker noise and random walk, in an arbitrary unit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Case {
    pub(crate) name: &'static str,
    /// The true N, B, K.
    pub(crate) truth: [f64; 3],
}

/// The cases. A curve has its minimum where `N²/τ = K²τ/3`: near 100 s, or near 1000 s for the weak random walk.
pub(crate) const CASES: [Case; 3] = [
    Case { name: "S1", truth: [2e-3, 0.0, 3.464e-5] },
    Case { name: "S2", truth: [2e-3, 4e-4, 3.464e-5] },
    Case { name: "S3", truth: [2e-3, 0.0, 3.464e-6] },
];

impl Case {
    /// [`BATCH`] independent series of [`SAMPLES`] samples.
    pub(crate) fn series(&self, seed: u64) -> Vec<Vec<f64>> {
        let channels = &OutputRegister::ALL[1..=BATCH];
        let mut model = NoiseModel::noiseless();
        for &channel in channels {
            let noise = model.channel_mut(channel);
            noise.bias = 0.0;
            [noise.angle_random_walk, noise.bias_instability, noise.rate_random_walk] = self.truth;
        }
        let mut source = NoiseSource::new(&model, seed, SAMPLE_PERIOD);
        let mut series = vec![Vec::new(); BATCH];
        for _ in 0..SAMPLES {
            let values = source.sample();
            for (series, &channel) in series.iter_mut().zip(channels) {
                series.push(values[channel as usize]);
            }
        }
        series
    }
}
