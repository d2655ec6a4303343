//! Transforms of a whole record: the tapered periodogram, and sine tapers for the lowest frequencies.

use super::transforms::BufferedTransform;
use crate::samples::uniform_series::UniformSeries;
use fourier::Complex;
use std::f64::consts::PI;
use std::ops::Range;

/// Ordinates per resolution `1/T`; a sinusoid between two loses at most 0.9 dB.
pub(super) const PADDING: usize = 2;

/// Fraction of the record over which the taper rises and falls, against the end's jump in a filter's nulls.
const RISE: f64 = 0.05;

/// `2·dt/Σw²·|X(f)|²` under the taper `w`, at the multiples of a fraction of the resolution.
#[derive(Clone)]
pub(super) struct Periodogram {
    /// Ordinates per resolution.
    padding: usize,
    /// Hz between ordinates.
    spacing: f64,
    density: Vec<f64>,
    /// Periodograms averaged in each ordinate.
    looks: u32,
}

impl Periodogram {
    /// Transforms samples without their straight line, with short gaps interpolated; drops up to 1 % at the end.
    pub(super) fn new(series: &UniformSeries) -> Option<Self> {
        Self::padded_by(PADDING, series)
    }

    /// [`new`](Self::new) with `padding` ordinates per resolution.
    pub(super) fn padded_by(padding: usize, series: &UniformSeries) -> Option<Self> {
        let length = smooth_length(series.values().len());
        let (filled, _) = series.interpolated();
        let values = &filled.values()[..length];
        if values.iter().filter(|value| value.is_finite()).count() < 2 {
            return None;
        }
        let mut transform = BufferedTransform::new(padding * length);
        let mut power = 0.0;
        for (at, (slot, value)) in transform.input().iter_mut().zip(values).enumerate() {
            let weight = taper(at, length);
            if value.is_finite() {
                *slot = weight * value;
            }
            // An interpolated sample has hardly any white noise.
            if series.values()[at].is_finite() {
                power += weight * weight;
            }
        }
        let scale = 2.0 * series.sample_period() / power;
        Some(Self {
            padding,
            spacing: 1.0 / (padding as f64 * length as f64 * series.sample_period()),
            density: transform.output()?.iter().map(|bin| scale * bin.norm_sqr()).collect(),
            looks: 1,
        })
    }

    pub(super) fn average_with(&mut self, other: &Self) {
        self.looks += other.looks;
        let weight = f64::from(other.looks) / f64::from(self.looks);
        for (mean, ordinate) in self.density.iter_mut().zip(&other.density) {
            *mean += weight * (ordinate - *mean);
        }
    }

    /// Independent estimates per ordinate.
    pub(super) fn looks(&self) -> f64 {
        f64::from(self.looks)
    }

    pub(super) fn replace(&mut self, at: usize, density: f64) {
        self.density[at] = density;
    }

    pub(super) fn resolution(&self) -> f64 {
        self.padding as f64 * self.spacing
    }

    /// Ordinates at multiples of the resolution, from 0 Hz: independent in white noise.
    pub(super) fn independent(&self) -> impl Iterator<Item = f64> {
        self.density.iter().copied().step_by(self.padding)
    }

    /// The ordinate nearest to an `order`, resolutions; 0 above the last one.
    pub(super) fn at(&self, order: f64) -> f64 {
        self.density.get((order * self.padding as f64).round() as usize).copied().unwrap_or(0.0)
    }

    /// All ordinates, [`PADDING`] per resolution unless [`padded_by`](Self::padded_by) others, from 0 Hz.
    pub(super) fn padded(&self) -> &[f64] {
        &self.density
    }
}

/// Tukey window: weight of sample `at` of `length`.
pub(super) fn taper(at: usize, length: usize) -> f64 {
    let from_end = at.min(length - 1 - at) as f64 + 0.5;
    let rise = (RISE * length as f64).max(1.0);
    if from_end < rise { (1.0 - (PI * from_end / rise).cos()) / 2.0 } else { 1.0 }
}

/// Power of a sinusoid under the taper at a distance in resolutions, over that at its frequency. The taper is a rectangle convolved with half
/// a period of a cosine.
pub(super) fn taper_response(distance: f64) -> f64 {
    let sinc = |of: f64| if of.abs() < 1e-6 { 1.0 } else { of.sin() / of };
    // cos(πx)/(1 − 4x²), whose limit at x = ½ is π/4.
    let (x, edge) = (RISE * distance, 0.5 - (RISE * distance).abs());
    let cosine = if edge.abs() < 1e-6 { PI / 4.0 } else { (PI * x).cos() / (1.0 - 4.0 * x * x) };
    (sinc(PI * (1.0 - RISE) * distance) * cosine).powi(2)
}

/// Largest length up to `length` without a prime factor above 7.
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

const TAPERS: usize = 3;
/// Lowest ordinate in use, resolutions; removing the line took power below.
const LOWEST: usize = 2;
/// Relative width of a band: 1/12.
const BAND: usize = 12;

/// Bands from [`LOWEST`] to `last`, 1/[`BAND`] of their frequency wide.
pub(super) fn low_frequency_bands(last: usize) -> impl Iterator<Item = Range<usize>> {
    let mut from = LOWEST;
    std::iter::from_fn(move || {
        let range = from..(from + (from / BAND).max(1)).min(last);
        from = range.end;
        (!range.is_empty()).then_some(range)
    })
}

/// Transforms under sine tapers (K. Riedel and A. Sidorenko, IEEE Trans. Signal Process. 43, 1995).
pub(super) struct SineTapered {
    pub sample_period: f64,
    /// Transformed samples.
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
            transform.process(&mut input, &mut output).ok()?;
            let scale = (2.0 * series.sample_period() / power / TAPERS as f64).sqrt();
            output.iter_mut().for_each(|bin| *bin *= scale);
            Some(output)
        };
        let transforms: Option<Vec<_>> = (1..=TAPERS).map(under).collect();
        Some(Self { sample_period: series.sample_period(), length, transforms: transforms? })
    }

    pub(super) fn resolution(&self) -> f64 {
        1.0 / (self.length as f64 * self.sample_period)
    }

    /// Real one-sided cross-spectral density at an ordinate, averaged over the tapers.
    pub(super) fn cross_density(&self, other: &Self, at: usize) -> f64 {
        self.transforms.iter().zip(&other.transforms).map(|(a, b)| (a[at] * b[at].conj()).re).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::{taper, taper_response};
    use std::f64::consts::TAU;

    /// The transform of the taper itself, on and off the limits of the closed form.
    #[test]
    fn the_response_of_the_taper_is_its_transform() {
        const LENGTH: usize = 20_000;
        let power = |distance: f64| {
            let terms = (0..LENGTH).map(|at| (taper(at, LENGTH), TAU * distance * at as f64 / LENGTH as f64));
            let (re, im) = terms
                .fold((0.0, 0.0), |(re, im), (weight, angle)| (re + weight * angle.cos(), im + weight * angle.sin()));
            re * re + im * im
        };
        for distance in [0.3, 1.0, 2.5, 7.3, 10.0, 23.4] {
            let (expected, found) = (power(distance) / power(0.0), taper_response(distance));
            assert!((found - expected).abs() < 1e-3 * expected + 1e-9, "{distance}: {found} {expected}");
        }
    }
}
