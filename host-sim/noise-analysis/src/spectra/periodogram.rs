//! Discrete Fourier transforms of a whole record: the tapered periodogram, at the resolution that the record's length
//! allows, and transforms under sine tapers for its lowest frequencies.

use super::transforms::BufferedTransform;
use crate::samples::uniform_series::UniformSeries;
use fourier::Complex;
use std::f64::consts::PI;
use std::ops::Range;

/// Ordinates per resolution `1/T`: between two of them a sinusoid loses at most 0.9 dB of its peak.
pub(super) const PADDING: usize = 2;

/// Fraction of the record over which the taper rises, and again falls. It costs a sinusoid 0.2 dB; without it, the jump
/// from the record's end to its beginning leaks into the nulls of a digital filter.
const RISE: f64 = 0.05;

/// `2·dt/Σw²·|X(f)|²` under the taper `w`, at the multiples of half a resolution.
#[derive(Clone)]
pub(super) struct Periodogram {
    /// Hz between the ordinates of `density`.
    spacing: f64,
    density: Vec<f64>,
    /// Periodograms that each ordinate is the mean of.
    looks: u32,
}

impl Periodogram {
    /// Transforms samples whose straight line has been removed, with short gaps interpolated. Up to 1 % of them, at the end, are left out so that the
    /// length has no large prime factor. `None` for a record of fewer than two samples.
    pub(super) fn new(series: &UniformSeries) -> Option<Self> {
        let length = smooth_length(series.values().len());
        let (filled, _) = series.interpolated();
        let values = &filled.values()[..length];
        if values.iter().filter(|value| value.is_finite()).count() < 2 {
            return None;
        }
        let mut transform = BufferedTransform::new(PADDING * length);
        let mut power = 0.0;
        for (at, (slot, value)) in transform.input().iter_mut().zip(values).enumerate() {
            let weight = taper(at, length);
            if value.is_finite() {
                *slot = weight * value;
            }
            // An interpolated sample has hardly any white noise of its own.
            if series.values()[at].is_finite() {
                power += weight * weight;
            }
        }
        let scale = 2.0 * series.sample_period() / power;
        Some(Self {
            spacing: 1.0 / (PADDING as f64 * length as f64 * series.sample_period()),
            density: transform.output()?.iter().map(|bin| scale * bin.norm_sqr()).collect(),
            looks: 1,
        })
    }

    /// Makes this the mean of the periodograms that it is made of and of another of the same length.
    pub(super) fn average_with(&mut self, other: &Self) {
        self.looks += other.looks;
        let weight = f64::from(other.looks) / f64::from(self.looks);
        for (mean, ordinate) in self.density.iter_mut().zip(&other.density) {
            *mean += weight * (ordinate - *mean);
        }
    }

    /// Independent estimates that each ordinate is the mean of.
    pub(super) fn looks(&self) -> f64 {
        f64::from(self.looks)
    }

    /// Sets one of the [`padded`](Self::padded) ordinates.
    pub(super) fn replace(&mut self, at: usize, density: f64) {
        self.density[at] = density;
    }

    /// Resolution `1/T`, Hz.
    pub(super) fn resolution(&self) -> f64 {
        PADDING as f64 * self.spacing
    }

    /// Ordinates at the multiples of the resolution, from 0 Hz; those of white noise are independent of each other.
    pub(super) fn independent(&self) -> impl Iterator<Item = f64> {
        self.density.iter().copied().step_by(PADDING)
    }

    /// All ordinates, [`PADDING`] to a resolution, from 0 Hz.
    pub(super) fn padded(&self) -> &[f64] {
        &self.density
    }
}

/// Weight of sample `at` of `length`: 1, with a half cosine at either end (a Tukey window).
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

/// Number of sine tapers.
const TAPERS: usize = 3;
/// Lowest ordinate in use, in resolutions; removing the straight line has removed power below it.
const LOWEST: usize = 2;
/// A band is this fraction of its frequency wide: 1/12.
const BAND: usize = 12;

/// Bands of ordinates from [`LOWEST`] up to `last`, each 1/[`BAND`] of its frequency wide.
pub(super) fn low_frequency_bands(last: usize) -> impl Iterator<Item = Range<usize>> {
    let mut from = LOWEST;
    std::iter::from_fn(move || {
        let range = from..(from + (from / BAND).max(1)).min(last);
        from = range.end;
        (!range.is_empty()).then_some(range)
    })
}

/// Transforms of a record under the sine tapers (K. Riedel and A. Sidorenko, "Minimum bias multiple taper spectral
/// estimation", IEEE Trans. Signal Process. 43, 1995): little of a random walk leaks to higher frequencies, and the
/// average over the tapers uses nearly all of the record.
pub(super) struct SineTapered {
    pub sample_period: f64,
    /// Number of samples that were transformed.
    pub length: usize,
    transforms: Vec<Vec<Complex<f64>>>,
}

impl SineTapered {
    pub(super) fn new(series: &UniformSeries) -> Option<Self> {
        let length = smooth_length(series.values().len());
        let (filled, _) = series.interpolated();
        let transform = fourier::forward(length.max(2));
        let under = |taper: usize| {
            let mut input = transform.make_input_vec();
            let mut power = 0.0;
            for (at, (slot, value)) in input.iter_mut().zip(filled.values()).enumerate() {
                if value.is_finite() {
                    let weight = (PI * taper as f64 * (at + 1) as f64 / (length + 1) as f64).sin();
                    *slot = weight * value;
                    power += weight * weight;
                }
            }
            let mut output = transform.make_output_vec();
            // An error means buffers of the wrong length; these are the planner's own.
            transform.process(&mut input, &mut output).ok()?;
            let scale = (2.0 * series.sample_period() / power / TAPERS as f64).sqrt();
            output.iter_mut().for_each(|bin| *bin *= scale);
            Some(output)
        };
        let transforms: Option<Vec<_>> = (1..=TAPERS).map(under).collect();
        Some(Self { sample_period: series.sample_period(), length, transforms: transforms? })
    }

    /// Hz between ordinates.
    pub(super) fn resolution(&self) -> f64 {
        1.0 / (self.length as f64 * self.sample_period)
    }

    /// Real part of the one-sided cross-spectral density with a record of the same length, at an ordinate, averaged over
    /// the tapers.
    pub(super) fn cross_density(&self, other: &Self, at: usize) -> f64 {
        self.transforms.iter().zip(&other.transforms).map(|(a, b)| (a[at] * b[at].conj()).re).sum()
    }
}
