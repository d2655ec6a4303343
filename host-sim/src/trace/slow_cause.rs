//! How a channel follows a slow cause, such as the temperature: from the course of both.
//!
//! In the differences of the Allan variance a cause that takes the whole record to move has a few degrees of freedom, and
//! any other slow noise hides it. Here it is judged on means of stretches of the record, as a [ramp](super::rate_ramp) is:
//! by the likelihood ratio under noise whose mixture is free with the cause and without.

use super::block::{BLOCKS, Blocks, Whitening, residual, size};
use super::normal::upper_tail;
use super::rate_ramp::NOISE_GAIN;
use super::{SIGNIFICANCE, Series, bias_step};

/// How a channel follows a cause.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// In the channel's unit over the cause's.
    pub sensitivity: f64,
    /// Standard deviation of the sensitivity.
    pub error: f64,
}

/// Looks for the course of `cause`, of the same samples, in `series`: beyond a ramp, and more than a step explains.
#[must_use]
pub fn find(series: &Series, cause: &Series) -> Option<Followed> {
    if cause.slots != series.slots {
        return None;
    }
    let (blocks, course) = (Blocks::of(series)?, Blocks::of(cause)?.means);
    let flat = |means: &[f64]| means.iter().all(|mean| *mean == means[0]);
    if blocks.numbers.len() < BLOCKS / 4 || flat(&blocks.means) || flat(&course) {
        return None;
    }
    let noises = blocks.noises();
    let least = |shapes: &[Vec<f64>]| {
        let of = |noise: &Whitening| noise.deviance(residual(noise, &blocks.means, shapes));
        noises.iter().map(of).fold(f64::INFINITY, f64::min)
    };
    let ramp: Vec<f64> = blocks.numbers.iter().map(|&number| number as f64).collect();
    let (plain, with_ramp, with_both) =
        (least(&[]), least(std::slice::from_ref(&ramp)), least(&[ramp.clone(), course.clone()]));
    let z = (with_ramp - with_both - NOISE_GAIN).max(0.0).sqrt();
    // The steps are many: they are looked at last.
    if 2.0 * upper_tail(z) > SIGNIFICANCE || plain - with_both < bias_step::gain(&blocks, &noises, plain) {
        return None;
    }
    let (sensitivity, error) = size(&noises, &blocks.means, &course, &[]);
    Some(Followed { sensitivity, error })
}
