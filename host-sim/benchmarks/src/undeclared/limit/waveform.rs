//! Waveforms that are known up to their size, in noise that walks: regression on the means of blocks.

use super::needed;
use super::spectrum::Record;
use crate::undeclared::place::{Place, Scene};
use nalgebra::DVector;
use noise_analysis::detectors::block_means::BLOCKS;
use noise_analysis::detectors::block_means::{NoiseCovariance, flicker_covariance, markov_covariance};
use virtual_sensor::EffectSource;
use virtual_sensor::{OutputRegister, SensorScenario};

/// The size at the limit of a waveform of block means `shape`, for size 1, that could be at `looks` places.
pub(crate) fn smallest(looks: f64, place: &Place<'_>, shape: impl Fn(usize) -> f64) -> f64 {
    let values: Vec<f64> = (0..BLOCKS).map(shape).collect();
    (needed(looks) / ratio(&values, place)).sqrt()
}

/// Length of a block, s.
pub(crate) fn block_s(record: Record) -> f64 {
    record.seconds / BLOCKS as f64
}

/// Expected log likelihood ratio of `values`, one a block, against a constant level in what is known of the noise.
pub(crate) fn ratio(values: &[f64], place: &Place<'_>) -> f64 {
    let block_s = block_s(place.record);
    // Of the mean of a block.
    let white = (place.white() + place.resolution().powi(2) / 12.0 * place.record.period_s) / block_s;
    let walk = place.noise.rate_random_walk.powi(2) * block_s / white;
    let mut coloured = flicker_covariance();
    coloured.iter_mut().for_each(|entry| *entry *= place.noise.bias_instability.powi(2) / white);
    for (time_s, variance) in place.processes() {
        for (entry, unit) in coloured.iter_mut().zip(markov_covariance(time_s / block_s)) {
            *entry += variance / white * unit;
        }
    }
    let numbers: Vec<usize> = (0..BLOCKS).collect();
    let fills = vec![1.0; BLOCKS];
    let values = DVector::from_column_slice(values);
    let energy = |noise: NoiseCovariance| values.dot(&noise.weighted(&values));
    0.5 * NoiseCovariance::with_coloured(&numbers, &fills, &coloured, walk).map_or(0.0, energy) / white
}

/// What the surroundings do to `channel`, as means of blocks.
pub(crate) fn course(scene: &Scene<'_>, channel: OutputRegister) -> Vec<f64> {
    let Record { seconds, period_s } = scene.record;
    let mut source =
        EffectSource::new(&SensorScenario { environment: scene.surroundings, effects: Vec::new() }, scene.seed);
    let width = (seconds / period_s / BLOCKS as f64) as usize;
    (0..BLOCKS)
        .map(|block| {
            let value = |at: usize| {
                let mut values = [0.0; 12];
                source.disturb(&mut values, (block * width + at) as f64 * period_s, period_s);
                values[channel as usize]
            };
            (0..width).map(value).sum::<f64>() / width as f64
        })
        .collect()
}
