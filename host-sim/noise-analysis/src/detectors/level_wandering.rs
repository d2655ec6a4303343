//! A noise level that grows and falls all the time, as a Gauss-Markov process of its logarithm.
//!
//! Levels of blocks of several lengths are compared with later ones; the length that shows it most measures it.

use super::log_levels::LogLevels;
use super::noise_levels::{BlockLevels, DIFFERENCES};
use super::telegraph_models::{gauss_markov_log_likelihood, gauss_markov_posterior};
use crate::distributions::upper_tail;
use crate::effects::WanderingLevel;
use crate::effects::findings::{SIGNIFICANCE, TOLD_APART};
use std::ops::Range;

/// Numbers of blocks of the lengths that are tried.
const BLOCKS: Range<usize> = 64..2049;
/// Differences between two blocks that are compared: twice the longest filter, whose noise correlates no farther.
const APART: usize = 128;
/// Part of the blocks without which it shows as well: a longest knock, or another time that is unlike the rest.
const APART_FROM_STRETCH: f64 = 0.1;
/// Least relative standard deviation: two of them are apart as the levels of the least [change](super::level_change).
const LEAST_DEVIATION: f64 = 0.025;

/// By the levels of blocks of [`DIFFERENCES`], each of which begins `block_s` after the one before.
pub(super) fn find(levels: &BlockLevels, block_s: f64) -> Option<WanderingLevel> {
    let lengths = (0..usize::BITS).filter(|doublings| BLOCKS.contains(&(levels.count >> doublings)));
    let tried: Vec<(f64, u32, LogLevels)> = lengths
        .filter_map(|doublings| {
            let of_blocks = LogLevels::new(&levels.doubled(doublings))?;
            let lag = 1 + APART.div_ceil(DIFFERENCES << doublings);
            Some((correlation(&of_blocks.around_mean(), lag), doublings, of_blocks))
        })
        .collect();
    let count = tried.len() as f64;
    let (sigmas, doublings, of_blocks) = tried.into_iter().max_by(|(a, ..), (b, ..)| a.total_cmp(b))?;
    let p_value = (count * upper_tail(sigmas)).min(1.0);
    if p_value >= SIGNIFICANCE {
        return None;
    }
    let around_mean = of_blocks.around_mean();
    if gauss_markov_log_likelihood(&around_mean) - of_blocks.log_likelihood_of_change()? < TOLD_APART.ln() {
        return None;
    }
    let (time, deviation) = gauss_markov_posterior(&around_mean);
    // The deviation has half the logarithm of the mean square.
    let deviation = deviation.scaled(0.5);
    let time_constant_s = time.scaled(block_s * f64::from(1_u32 << doublings));
    (deviation.value > LEAST_DEVIATION).then_some(WanderingLevel { deviation, time_constant_s, p_value })
}

/// Correlation of values with those `lag` later, in standard deviations of that of independent ones: the smaller one of that of all values,
/// and that without the stretch that is farthest from the others.
fn correlation(values: &[f64], lag: usize) -> f64 {
    let mut without = values.to_vec();
    let length = (APART_FROM_STRETCH * values.len() as f64).ceil() as usize;
    let distance = |from: usize| values[from..from + length].iter().filter(|of| of.is_finite()).sum::<f64>().abs();
    let farthest = (0..=values.len() - length).max_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    farthest.into_iter().for_each(|from| without[from..from + length].fill(f64::NAN));
    let sigmas = |values: &[f64]| {
        let present = || values.iter().filter(|of| of.is_finite());
        let count = present().count() as f64;
        let mean = present().sum::<f64>() / count;
        let variance = present().map(|of| (of - mean).powi(2)).sum::<f64>() / count;
        let pairs = values.iter().zip(&values[lag..]).map(|(one, later)| (one - mean) * (later - mean));
        let (pairs, sum) =
            pairs.filter(|of| of.is_finite()).fold((0.0, 0.0), |(pairs, sum), of| (pairs + 1.0, sum + of));
        if variance > 0.0 && pairs > 0.0 { sum / (variance * f64::sqrt(pairs)) } else { 0.0 }
    };
    sigmas(values).min(sigmas(&without))
}
