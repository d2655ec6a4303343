//! The curve of a part that moves, as it mostly is.
//!
//! A burst of vibration of some minutes raises the mean of a part, and is not what comes after it. The median of the
//! epochs hardly knows of it.

use super::control::LONGEST_TAKEN_OVER;
use allan_core::{AllanPoint, Curve};

/// The curve of `part` with the median of its `epochs` at the octaves that they tell well.
///
/// The median of variances with `ν` degrees of freedom is low by `(1 − 2/(9ν))³` (E. Wilson and M. Hilferty, 1931), which
/// is taken off. It scatters by a fourth more than the mean; the bounds do not say that.
#[must_use]
pub fn typical<const POINTS: usize>(part: &Curve<POINTS>, epochs: &[Curve<POINTS>]) -> Curve<POINTS> {
    let mut typical = part.clone();
    typical.replace_avar(|point| median(epochs, point.n).unwrap_or(point.avar));
    typical
}

fn median<const POINTS: usize>(epochs: &[Curve<POINTS>], n: u64) -> Option<f64> {
    let told = |epoch: &Curve<POINTS>| {
        let point = epoch.points().iter().find(|point| point.n == n)?;
        (n * LONGEST_TAKEN_OVER <= epoch.samples()).then_some(*point)
    };
    let points: Vec<AllanPoint> = epochs.iter().filter_map(told).collect();
    let mut avars: Vec<f64> = points.iter().map(|point| point.avar).collect();
    avars.sort_by(f64::total_cmp);
    let (lower, upper) = (avars.get(avars.len().checked_sub(1)? / 2)?, avars.get(avars.len() / 2)?);
    let edf = points.iter().map(|point| point.edf).sum::<f64>() / points.len() as f64;
    Some((lower + upper) / 2.0 / (1.0 - 2.0 / (9.0 * edf)).powi(3))
}
