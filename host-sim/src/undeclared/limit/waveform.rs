//! Waveforms that are known up to their size, in noise that walks: regression on the means of blocks.

use super::spectrum::Record;
use crate::sensor::ChannelNoise;
use crate::trace::block::BLOCKS;
use crate::trace::noises::Noise;
use nalgebra::DVector;

/// Expected log likelihood ratio of `values`, one a block, against a constant level in the declared noise.
pub(crate) fn ratio(values: &[f64], noise: &ChannelNoise, resolution: f64, record: Record) -> f64 {
    let block_s = record.seconds / BLOCKS as f64;
    // Of the mean of a block.
    let white = (noise.angle_random_walk.powi(2) + resolution * resolution / 12.0 * record.period_s) / block_s;
    let flicker = noise.bias_instability.powi(2) / white;
    let walk = noise.rate_random_walk.powi(2) * block_s / white;
    let numbers: Vec<usize> = (0..BLOCKS).collect();
    let fills = vec![1.0; BLOCKS];
    let values = DVector::from_column_slice(values);
    let energy = |noise: Noise| values.dot(&noise.whitened(&values));
    0.5 * Noise::of(&numbers, &fills, flicker, walk).map_or(0.0, energy) / white
}
