//! The smooth part of a spectrum as a sum of known shapes. [`SpectralShape`], fitted by Whittle's likelihood, is white,
//! flicker and random-walk noise behind a digital filter; `Background` corrects it by local medians.

use super::whittle::{Sign, SpectralBand, fit_mixture, information, mixture_density};
use crate::robust::median;
use allan_core::term::{MovingAverageFilter, Process};
use nalgebra::DMatrix;
use std::f64::consts::PI;
use std::ops::Range;

/// Longest filter: two averages of `2^6` samples, the largest setting of the ADIS16405.
const LARGEST_TAPS_LOG2: u32 = 6;

/// Most taps of a slowly read filter, a [`MovingAverageFilter`].
const MOST_TAPS: u32 = 128;

/// Filters that a shape may be behind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Filters {
    Without,
    /// Any; each sample is one of this many values.
    ReadEvery(u32),
}

/// White, 1/f and 1/f² noise behind the filter, and an unfiltered floor.
const TERMS: usize = 4;

/// A sum of power laws behind a filter.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectralShape {
    sample_period: f64,
    /// Taps of each of the filter's two cascaded averages; 1 for no filter.
    pub taps: u32,
    /// The filter, if not every value is read.
    read_slowly: Option<MovingAverageFilter>,
    /// At 1 Hz: filtered white, 1/f and 1/f² noise, and the floor, unit²/Hz.
    pub densities: [f64; TERMS],
}

impl SpectralShape {
    /// The likeliest shape over all filter lengths; slowly read filters if each sample is one of several values.
    #[must_use]
    pub(super) fn fit(bands: &[SpectralBand], sample_period: f64, filters: Filters) -> Self {
        let fit = |taps: u32, decimation: u32| Self::fit_with_filter(bands, sample_period, (taps, decimation));
        let (read_every, largest) = match filters {
            Filters::Without => (1, 0),
            Filters::ReadEvery(values) => (values, LARGEST_TAPS_LOG2),
        };
        let own_rate = (0..=largest).map(|log2| fit(1 << log2, 1));
        let Some((shape, objective)) = own_rate.min_by(|(_, a), (_, b)| a.total_cmp(b)) else {
            return Self { sample_period, taps: 1, read_slowly: None, densities: [0.0; TERMS] };
        };
        let taps = shape.taps.saturating_mul(read_every);
        let slow = (read_every > 1 && taps <= MOST_TAPS).then(|| fit(taps, read_every));
        slow.filter(|slow| slow.1 < objective).map_or(shape, |(shape, _)| shape)
    }

    /// Density at `frequency` in Hz, unit²/Hz.
    #[must_use]
    pub fn density(&self, frequency: f64) -> f64 {
        mixture_density(&self.basis(frequency), &self.densities)
    }

    /// N in unit·√s: the root of half the density of the white noise before the filter. Only of a spectrum that is known to
    /// be behind a filter: in white noise nothing tells the filtered noise from the floor.
    #[must_use]
    pub fn angle_random_walk(&self) -> f64 {
        (self.densities[0] / 2.0).sqrt()
    }

    /// Relative standard deviation of [`angle_random_walk`](Self::angle_random_walk) beside the other terms (Fisher
    /// information in `bands`); `None` without white noise.
    #[must_use]
    pub fn angle_random_walk_error(&self, bands: &[SpectralBand]) -> Option<f64> {
        // Information on the logarithms of non-zero densities.
        let present: Vec<usize> = (0..TERMS).filter(|&term| self.densities[term] > 0.0).collect();
        if present.first() != Some(&0) {
            return None;
        }
        let bases: Vec<[f64; TERMS]> = bands.iter().map(|band| self.basis(band.frequency)).collect();
        let of_densities = information(bands, &bases, &self.densities);
        let entry = |row: usize, column: usize| {
            let (row, column) = (present[row], present[column]);
            self.densities[row] * self.densities[column] * of_densities[(row, column)]
        };
        let information = DMatrix::from_fn(present.len(), present.len(), entry);
        let variance = information.cholesky()?.inverse()[(0, 0)];
        Some(variance.sqrt() / 2.0)
    }

    /// The likeliest shape with these taps and decimation, and its objective.
    fn fit_with_filter(bands: &[SpectralBand], sample_period: f64, (taps, decimation): (u32, u32)) -> (Self, f64) {
        let slow = MovingAverageFilter { decimation: decimation.into(), ..MovingAverageFilter::bartlett(taps as u16) };
        let read_slowly = (decimation > 1).then_some(slow);
        let mut shape = Self { sample_period, taps, read_slowly, densities: [0.0; TERMS] };
        let bases: Vec<[f64; TERMS]> = bands.iter().map(|band| shape.basis(band.frequency)).collect();
        let objective = fit_mixture(bands, &bases, Sign::NonNegative, &mut shape.densities);
        (shape, objective)
    }

    /// Terms for a density of 1 at 1 Hz. Without a filter the floor is left out: it equals the white noise.
    fn basis(&self, frequency: f64) -> [f64; TERMS] {
        let sine = (PI * frequency * self.sample_period).sin();
        let gain = self.gain(frequency, sine);
        let walk = PI * self.sample_period / sine;
        [gain, gain / frequency, gain * walk * walk, if self.taps > 1 { 1.0 } else { 0.0 }]
    }

    /// Power gain at a frequency with this `sine` of its phase per sample; includes aliases if read slowly.
    fn gain(&self, frequency: f64, sine: f64) -> f64 {
        match &self.read_slowly {
            Some(filter) => filter.density(frequency, self.sample_period),
            None => filter_gain(frequency, self.sample_period, self.taps, sine),
        }
    }
}

/// Root of a sampled walk's density: `π·dt/sin(πf·dt)`.
pub(super) fn walk_amplitude(frequency: f64, sample_period: f64) -> f64 {
    PI * sample_period / (PI * frequency * sample_period).sin()
}

/// Power gain of two cascaded averages over `taps` samples (Bartlett), with this `sine` of the phase per sample.
pub(super) fn filter_gain(frequency: f64, sample_period: f64, taps: u32, sine: f64) -> f64 {
    if taps == 1 || sine == 0.0 {
        return 1.0;
    }
    let taps = f64::from(taps);
    ((taps * PI * frequency * sample_period).sin() / (taps * sine)).powi(4)
}

/// Lowest ordinate, resolutions; below is drift.
const LOWEST: usize = 3;
/// Bands over the linear part, narrow enough for a filter's nulls.
const BANDS: usize = 512;
/// Most ordinates per side of a local median.
pub(super) const WINDOW: usize = 512;
/// Variance of the median of exponential variables over that of their mean: 1/ln²2.
const MEDIAN_LOSS: f64 = 2.08;
/// Floor of the background over the median band's density: below is leakage.
const FLOOR: f64 = 1e-7;

/// A spectrum without its lines: smooth shape and local correction.
pub(super) struct Background<'a> {
    /// Factor on the shape at a frequency in Hz.
    known: &'a dyn Fn(f64) -> f64,
    shape: SpectralShape,
    floor: f64,
    resolution: f64,
    ordinates: usize,
    /// Independent estimates per ordinate.
    looks: f64,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct LocalLevel {
    pub value: f64,
    /// Equivalent number of averaged ordinates.
    pub ordinates: f64,
}

impl<'a> Background<'a> {
    /// Fits the background of `density` at multiples of `resolution` Hz; `None` below 8 bands, or without power.
    pub(super) fn fit(
        density: &[f64],
        looks: f64,
        known: &'a dyn Fn(f64) -> f64,
        resolution: f64,
        (sample_period, filters): (f64, Filters),
    ) -> Option<Self> {
        let bands: Vec<SpectralBand> = background_bands(density.len())
            .map(|range| {
                let frequency = resolution * (range.start + range.end - 1) as f64 / 2.0;
                let median = median(&mut density[range.clone()].to_vec());
                SpectralBand {
                    frequency,
                    density: median / expected_median(range.len(), looks) / known(frequency),
                    ordinates: (range.len() as f64 / MEDIAN_LOSS).max(1.0),
                }
            })
            .collect();
        let enough = bands.len() >= 8 && bands.iter().all(|band| band.density > 0.0);
        enough.then(|| Self {
            known,
            shape: SpectralShape::fit(&bands, sample_period, filters),
            floor: FLOOR * median(&mut bands.iter().map(|band| band.density).collect::<Vec<f64>>()),
            resolution,
            ordinates: density.len(),
            looks,
        })
    }

    /// At `bin` resolutions, without the local correction.
    pub(super) fn shape_at(&self, bin: f64) -> f64 {
        let frequency = bin * self.resolution;
        (self.known)(frequency) * (self.shape.density(frequency) + self.floor)
    }

    /// Local correction around `bin`: median of ordinates over [`shape_at`](Self::shape_at).
    pub(super) fn level(&self, whitened: &[f64], bin: usize) -> LocalLevel {
        let widest = WINDOW.min(self.ordinates / 16).max(8);
        let low = bin.saturating_sub(widest.min(bin * 2 / 3)).max(LOWEST);
        // The last ordinate has a single degree of freedom.
        let high = (bin + widest.min(2 * bin)).min(self.ordinates - 2);
        let mut window = whitened[low..=high].to_vec();
        let value = median(&mut window) / expected_median(window.len(), self.looks);
        LocalLevel { value, ordinates: window.len() as f64 / MEDIAN_LOSS }
    }
}

/// Bands an eighth of their frequency wide at first, then of one width.
fn background_bands(ordinates: usize) -> impl Iterator<Item = Range<usize>> {
    let widest = (ordinates / BANDS).max(1);
    let mut start = LOWEST;
    std::iter::from_fn(move || {
        let range = start..start + (start / 8).clamp(1, widest);
        start = range.end;
        (range.end < ordinates).then_some(range)
    })
}

/// Expected median of `count` means of `looks` exponential variables of mean 1.
fn expected_median(count: usize, looks: f64) -> f64 {
    if looks > 1.0 {
        return 1.0 - 1.0 / (3.0 * looks);
    }
    let order = |rank: usize| (count - rank + 1..=count).map(|i| 1.0 / i as f64).sum::<f64>();
    match count {
        0 => 1.0,
        odd if odd % 2 == 1 => order(odd / 2 + 1),
        even => (order(even / 2) + order(even / 2 + 1)) / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_exponential_variables_have_the_known_expectation() {
        for (count, expected) in [(1, 1.0), (2, 1.0), (3, 1.0 / 3.0 + 0.5), (100_001, std::f64::consts::LN_2)] {
            assert!((expected_median(count, 1.0) - expected).abs() < 1e-5, "{count}");
        }
    }
}
