//! The spectrum of a whole record, at the resolution that its length allows.

use crate::grid::Grid;
use realfft::RealFftPlanner;
use std::f64::consts::PI;

/// Ordinates per resolution `1/T`: between two of them a sine loses at most 0.9 dB of its peak.
pub(super) const PADDING: usize = 2;

/// Share of the record over which the taper rises, and falls. It costs a line 0.2 dB; without it, the record's two ends
/// leak into the nulls of the part's filter.
const RISE: f64 = 0.05;

/// `2·dt/Σw²·|X(f)|²` under a tapered window at multiples of half a resolution.
pub(super) struct Periodogram {
    /// Hz between the ordinates of [`density`](Self::density).
    spacing: f64,
    density: Vec<f64>,
}

impl Periodogram {
    /// Of the samples without their straight line. Up to 1 % of them, at the end, is left out for a length that
    /// transforms quickly. `None` for a record without two samples.
    pub(super) fn of(grid: &Grid) -> Option<Self> {
        let length = smooth_length(grid.values().len());
        let values = &grid.values()[..length];
        if values.iter().filter(|value| value.is_finite()).count() < 2 {
            return None;
        }
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(PADDING * length);
        let mut input = transform.make_input_vec();
        let mut power = 0.0;
        for (at, (slot, value)) in input.iter_mut().zip(values).enumerate() {
            if value.is_finite() {
                let weight = taper(at, length);
                *slot = weight * value;
                power += weight * weight;
            }
        }
        let mut output = transform.make_output_vec();
        // Fails only for buffers of the wrong length, and these are its own.
        transform.process(&mut input, &mut output).ok()?;
        let scale = 2.0 * grid.sample_period() / power;
        Some(Self {
            spacing: 1.0 / (PADDING as f64 * length as f64 * grid.sample_period()),
            density: output.iter().map(|bin| scale * bin.norm_sqr()).collect(),
        })
    }

    /// Resolution `1/T`, Hz.
    pub(super) fn resolution(&self) -> f64 {
        PADDING as f64 * self.spacing
    }

    /// Ordinates at the multiples of the resolution, which white noise leaves independent, from 0 Hz.
    pub(super) fn independent(&self) -> Vec<f64> {
        self.density.iter().copied().step_by(PADDING).collect()
    }

    /// All ordinates, [`PADDING`] to a resolution, from 0 Hz.
    pub(super) fn padded(&self) -> &[f64] {
        &self.density
    }
}

/// Weight of sample `at` of `length`: 1, and a half cosine at either end.
pub(super) fn taper(at: usize, length: usize) -> f64 {
    let from_end = at.min(length - 1 - at) as f64 + 0.5;
    let rise = (RISE * length as f64).max(1.0);
    if from_end < rise { (1.0 - (PI * from_end / rise).cos()) / 2.0 } else { 1.0 }
}

/// The largest length up to `length` without a prime factor above 7.
pub(super) fn smooth_length(length: usize) -> usize {
    (1..=length).rev().find(|&candidate| is_smooth(candidate)).unwrap_or(0)
}

fn is_smooth(mut length: usize) -> bool {
    for factor in [2, 3, 5, 7] {
        while length.is_multiple_of(factor) {
            length /= factor;
        }
    }
    length == 1
}
