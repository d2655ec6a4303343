//! Fourier transforms of real numbers in double precision, whose plans are made once for each length.
//!
//! The transforms of `rustfft` are generic, so that a crate that plans one compiles all of them. This crate plans for all others: they are
//! compiled once.

use realfft::RealFftPlanner;
use std::sync::{Arc, Mutex, PoisonError};

pub use realfft::num_complex::Complex;
pub use realfft::{ComplexToReal, RealToComplex};

/// Lengths that are kept: those of one analysis are of the whole record, of its half, of its means and of stretches, each with and without
/// padding.
const KEPT: usize = 16;

/// The lengths that were asked for last, the latest first, each with a planner that keeps the plans for it.
static PLANNERS: Mutex<Vec<(usize, RealFftPlanner<f64>)>> = Mutex::new(Vec::new());

/// The transform of `length` real numbers, 2 or more, to `length/2 + 1` complex ones: `X_k = Σ x_j·exp(−2πi·jk/length)`.
pub fn forward(length: usize) -> Arc<dyn RealToComplex<f64>> {
    planned(length, RealFftPlanner::plan_fft_forward)
}

/// The transform of `length/2 + 1` complex numbers to `length` real ones, 2 or more: the inverse of [`forward`] times `length`.
pub fn inverse(length: usize) -> Arc<dyn ComplexToReal<f64>> {
    planned(length, RealFftPlanner::plan_fft_inverse)
}

fn planned<P>(length: usize, plan: impl FnOnce(&mut RealFftPlanner<f64>, usize) -> P) -> P {
    let mut planners = PLANNERS.lock().unwrap_or_else(PoisonError::into_inner);
    let kept = planners.iter().position(|(of, _)| *of == length).map(|at| planners.remove(at).1);
    let mut planner = kept.unwrap_or_else(RealFftPlanner::new);
    let planned = plan(&mut planner, length);
    planners.insert(0, (length, planner));
    planners.truncate(KEPT);
    planned
}
