//! Simulated channels of a sensor with a digital filter and a clock of its own, for tests.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// A channel of a simulated part: white noise behind two moving averages, read every `decimation` values.
pub(crate) struct RecordedChannel {
    /// Values that each moving average takes.
    pub taps: usize,
    /// Values of the part's clock from one sample to the next.
    pub decimation: f64,
    /// Deviation of a sample if the reader took the means of the noise over its sample periods, without a filter, counts.
    pub deviation: f64,
    pub samples: usize,
    pub seed: u64,
}

/// The counts of a channel. The moving averages are taken as differences of running sums of simulated noise, which has
/// nothing in common with the closed form of the model.
pub(crate) fn read(channel: &RecordedChannel) -> Vec<i32> {
    let &RecordedChannel { taps, decimation, deviation, samples, seed } = channel;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let values = (samples as f64 * decimation) as usize + 2 * taps + 2;
    let scale = deviation * decimation.sqrt();
    let noise: Vec<f64> = (0..values).map(|_| scale * random.sample::<f64, _>(StandardNormal)).collect();
    let average = |values: &[f64]| -> Vec<f64> {
        let mut sum: f64 = values[..taps].iter().sum();
        let mut averages = vec![sum / taps as f64];
        for (old, new) in values.iter().zip(&values[taps..]) {
            sum += new - old;
            averages.push(sum / taps as f64);
        }
        averages
    };
    let filtered = average(&average(&noise));
    // The reader's phase against the part's clock moves through all values.
    let phase = (0.618_034 * seed as f64).fract();
    (0..samples).map(|at| filtered[((at as f64 + phase) * decimation) as usize].round() as i32).collect()
}
