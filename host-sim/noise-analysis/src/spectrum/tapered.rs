//! Transforms under sine tapers, for the lowest frequencies of a record.
//!
//! Averages under a few of them (K. Riedel and A. Sidorenko, "Minimum bias multiple taper spectral estimation", 1995) keep
//! a random walk from leaking, and lose next to nothing.

use super::periodogram::smooth_length;
use crate::grid::Grid;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use std::f64::consts::PI;
use std::ops::Range;

/// Sine tapers.
const TAPERS: usize = 3;
/// Lowest ordinate, in resolutions: below, the straight line that was taken off is missing.
const LOWEST: usize = 2;
/// A band is this part of its frequency wide.
const BAND: usize = 12;

/// Bands of ordinates below `last`, each a part of its frequency wide.
pub(super) fn ranges(last: usize) -> impl Iterator<Item = Range<usize>> {
    let mut from = LOWEST;
    std::iter::from_fn(move || {
        let range = from..(from + (from / BAND).max(1)).min(last);
        from = range.end;
        (!range.is_empty()).then_some(range)
    })
}

/// A record's transforms under the sine tapers.
pub(super) struct Tapered {
    pub sample_period: f64,
    /// Samples that were transformed.
    pub length: usize,
    transforms: Vec<Vec<Complex<f64>>>,
}

impl Tapered {
    pub(super) fn of(grid: &Grid) -> Option<Self> {
        let length = smooth_length(grid.values().len());
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length.max(2));
        let under = |taper: usize| {
            let mut input = transform.make_input_vec();
            let mut power = 0.0;
            for (at, (slot, value)) in input.iter_mut().zip(grid.values()).enumerate() {
                if value.is_finite() {
                    let weight = (PI * taper as f64 * (at + 1) as f64 / (length + 1) as f64).sin();
                    *slot = weight * value;
                    power += weight * weight;
                }
            }
            let mut output = transform.make_output_vec();
            // Fails only for buffers of the wrong length, and these are its own.
            transform.process(&mut input, &mut output).ok()?;
            let scale = (2.0 * grid.sample_period() / power / TAPERS as f64).sqrt();
            output.iter_mut().for_each(|bin| *bin *= scale);
            Some(output)
        };
        let transforms: Option<Vec<_>> = (1..=TAPERS).map(under).collect();
        Some(Self { sample_period: grid.sample_period(), length, transforms: transforms? })
    }

    /// Hz between ordinates.
    pub(super) fn resolution(&self) -> f64 {
        1.0 / (self.length as f64 * self.sample_period)
    }

    /// One-sided density that two records of one length have in common at an ordinate: in phase, and the mean over tapers.
    pub(super) fn common(&self, other: &Self, at: usize) -> f64 {
        self.transforms.iter().zip(&other.transforms).map(|(a, b)| (a[at] * b[at].conj()).re).sum()
    }
}
