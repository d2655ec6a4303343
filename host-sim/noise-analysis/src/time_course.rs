//! What moves while a record is made, and what a model is worth that knows it.
//!
//! ```text
//! Series ─► Parts ─► Stationarity ─► which part of the fitted half predicts best ─► typical: as it mostly is
//!             │
//!             └─► epochs ─► Moving: level and line, epoch by epoch ─► Tracked: each epoch foretold from those before
//!                                                                   ├► drift: how far they may go in the unseen half
//!                                                                   ├► Companion: the line as another channel shows it
//!                                                                   └► Controls: the same without knowing any effect
//! ```
//!
//! The record is cut in the middle. Verdicts, shapes and gains come from the fitted half alone. [`tracking`] looks at the
//! unseen half too, at each epoch after it was foretold, and [`companion`] at that of another channel: their results are
//! kept apart from those of models that have seen nothing of it.

pub mod companion;
pub mod control;
pub mod drift;
pub mod moving;
pub mod parts;
pub mod stationarity;
pub mod tracking;
pub mod typical;

#[cfg(test)]
mod tests;

pub use parts::Parts;
pub use stationarity::{Stationarity, stationarity};

use allan_core::{AllanPoint, Curve};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Chance, over all that is compared in a channel, at which something that stands still is taken to move.
pub const SIGNIFICANCE: f64 = 0.01;

/// `mean edf·(ln(m/v) + v/m − 1)` over the octaves with `n ≤ M/8`, of variances that no single model gives.
///
/// The figure of [`ModelError`](allan_core::model::Discrepancy), but with the degrees of freedom of the kind of noise that
/// the curve itself shows: the same for all that is compared, so that a model which claims to be uncertain gains nothing.
pub fn deviance_per_point<const POINTS: usize>(curve: &Curve<POINTS>, modelled: impl Fn(u64) -> f64) -> f64 {
    let points = || curve.points().iter().filter(|point| point.n <= curve.samples() / 8);
    let of = |point: &AllanPoint| {
        let ratio = point.avar / modelled(point.n);
        point.edf * (ratio - 1.0 - ratio.ln())
    };
    points().map(of).sum::<f64>() / points().count() as f64
}

/// Probability of a χ² of `freedom` degrees above `value`.
fn chi_square_tail(value: f64, freedom: f64) -> f64 {
    // Degrees of freedom are numbers of epochs, above 0.
    ChiSquared::new(freedom).map_or(1.0, |law| law.sf(value.max(0.0)))
}
