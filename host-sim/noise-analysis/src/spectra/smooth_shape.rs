//! The smooth part of a spectrum, as a sum of known shapes.
//!
//! Densities are fitted by Whittle's likelihood: an ordinate `P` of a spectrum is gamma distributed around its density
//! `S`, so the fit minimises `Σ g·(ln S + P/S)`, `g` being half the degrees of freedom of the ordinate. [`SpectralShape`]
//! is white, flicker and random-walk noise behind a digital filter; `Background` corrects it by local medians, which
//! lines hardly move.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use std::f64::consts::PI;
use std::ops::Range;

/// An average over neighbouring ordinates of a spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectralBand {
    /// Hz.
    pub frequency: f64,
    /// One-sided, unit²/Hz.
    pub density: f64,
    /// Number of independent ordinates that were averaged: half the degrees of freedom.
    pub ordinates: f64,
}

/// Rounds of the multiplicative fit, which bring the densities near enough for the scoring.
const MULTIPLICATIVE_ROUNDS: usize = 8;
/// Most rounds of the scoring, and the gain in ln likelihood of a round with which it ends: what is left to gain then is far less
/// than 1/2, by which the likelihood falls at one standard deviation.
const SCORING_ROUNDS: usize = 50;
const LEAST_GAIN: f64 = 1e-4;
/// Shortest part of a step of the scoring that is tried.
const SHORTEST_STEP: f64 = 1e-3;

/// Fits the densities of `TERMS` shapes whose values in each band are `bases`; returns `Σ g·(ln S + P/S)` with them.
///
/// Begins with each shape alone explaining an equal part of the bands. A few rounds multiply the densities by factors
/// that keep them non-negative and never lower the likelihood (C. Févotte and J. Idier, "Algorithms for nonnegative matrix
/// factorization with the β-divergence", Neural Computation 23, 2011, for the Itakura-Saito divergence, which is Whittle's
/// likelihood). Fisher's scoring, with steps that are halved until the likelihood grows, does the rest.
pub(super) fn fit_mixture<const TERMS: usize>(
    bands: &[SpectralBand],
    bases: &[[f64; TERMS]],
    densities: &mut [f64; TERMS],
) -> f64 {
    for (term, density) in densities.iter_mut().enumerate() {
        let shown = bands.iter().zip(bases).filter(|(_, basis)| basis[term] > 0.0);
        let (sum, weight) = shown.fold((0.0, 0.0), |(sum, weight), (band, basis)| {
            let alone = (band.density / basis[term]).max(f64::MIN_POSITIVE);
            (sum + band.ordinates * alone.ln(), weight + band.ordinates)
        });
        *density = if weight > 0.0 { (sum / weight).exp() / TERMS as f64 } else { 0.0 };
    }
    for _ in 0..MULTIPLICATIVE_ROUNDS {
        multiplicative_step(bands, bases, densities);
    }
    let mut objective = mixture_objective(bands, bases, densities);
    for _ in 0..SCORING_ROUNDS {
        let next = weighted_least_squares(bands, bases, densities);
        let step = |part: f64| -> [f64; TERMS] {
            std::array::from_fn(|term| densities[term] + part * (next[term] - densities[term]))
        };
        let parts = std::iter::successors(Some(1.0), |part| Some(part / 2.0)).take_while(|&part| part > SHORTEST_STEP);
        let tried = parts.map(|part| (mixture_objective(bands, bases, &step(part)), step(part)));
        let Some((likelier, reached)) = tried.into_iter().find(|(tried, _)| *tried < objective) else { break };
        let gain = objective - likelier;
        (objective, *densities) = (likelier, reached);
        if gain < LEAST_GAIN {
            break;
        }
    }
    objective
}

/// A round of Fisher's scoring: the densities that are not negative and whose sum is nearest to the bands, each weighted by the
/// inverse of its variance under the present `densities`. What is negative is set to 0, one term after another.
fn weighted_least_squares<const TERMS: usize>(
    bands: &[SpectralBand],
    bases: &[[f64; TERMS]],
    densities: &[f64; TERMS],
) -> [f64; TERMS] {
    // Of the information, the triangle that the loop below reads: rows up to the diagonal.
    let (mut information, mut pull) = ([[0.0; TERMS]; TERMS], [0.0; TERMS]);
    for (band, basis) in bands.iter().zip(bases) {
        let density = mixture_density(basis, densities);
        if density <= 0.0 {
            continue;
        }
        let relative: [f64; TERMS] = std::array::from_fn(|term| basis[term] / density);
        let towards = band.ordinates * band.density / density;
        for row in 0..TERMS {
            for column in 0..=row {
                information[row][column] += band.ordinates * relative[column] * relative[row];
            }
            pull[row] += towards * relative[row];
        }
    }
    // In units in which each term alone is known to 1.
    let scale: [f64; TERMS] = std::array::from_fn(|term| information[term][term].sqrt());
    let mut is_left_out: [bool; TERMS] = std::array::from_fn(|term| scale[term] == 0.0);
    loop {
        let entry = |row: usize, column: usize| {
            if is_left_out[row] || is_left_out[column] {
                f64::from(u8::from(row == column))
            } else {
                information[row.max(column)][row.min(column)] / (scale[row] * scale[column])
            }
        };
        let matrix = SMatrix::<f64, TERMS, TERMS>::from_fn(entry);
        let right =
            SVector::<f64, TERMS>::from_fn(|term, _| if is_left_out[term] { 0.0 } else { pull[term] / scale[term] });
        let Some(cholesky) = matrix.cholesky() else { return *densities };
        let solved = cholesky.solve(&right);
        if solved.iter().any(|value| !value.is_finite()) {
            return *densities;
        }
        let (least, value) = solved.argmin();
        if value >= 0.0 {
            return std::array::from_fn(|term| if is_left_out[term] { 0.0 } else { solved[term] / scale[term] });
        }
        is_left_out[least] = true;
    }
}

/// A round of the multiplicative fit.
fn multiplicative_step<const TERMS: usize>(
    bands: &[SpectralBand],
    bases: &[[f64; TERMS]],
    densities: &mut [f64; TERMS],
) {
    let (mut pull, mut push) = ([0.0; TERMS], [0.0; TERMS]);
    for (band, basis) in bands.iter().zip(bases) {
        let density = mixture_density(basis, densities);
        if density <= 0.0 {
            continue;
        }
        for term in 0..TERMS {
            let weight = band.ordinates * basis[term] / density;
            pull[term] += weight * band.density / density;
            push[term] += weight;
        }
    }
    for term in (0..TERMS).filter(|&term| push[term] > 0.0) {
        densities[term] *= (pull[term] / push[term]).sqrt();
    }
}

/// Density of the mixture where its shapes have the values `basis`.
pub(super) fn mixture_density<const TERMS: usize>(basis: &[f64; TERMS], densities: &[f64; TERMS]) -> f64 {
    basis.iter().zip(densities).map(|(basis, density)| basis * density).sum()
}

/// `Σ g·(ln S + P/S)` over the bands, `S` being the mixture.
fn mixture_objective<const TERMS: usize>(
    bands: &[SpectralBand],
    bases: &[[f64; TERMS]],
    densities: &[f64; TERMS],
) -> f64 {
    let of_band = |(band, basis): (&SpectralBand, &[f64; TERMS])| {
        let density = mixture_density(basis, densities).max(f64::MIN_POSITIVE);
        band.ordinates * (density.ln() + band.density / density)
    };
    bands.iter().zip(bases).map(of_band).sum()
}

/// Longest filter that is tried: two cascaded averages of `2^6` samples each, the largest setting of the ADIS16405.
const LARGEST_TAPS_LOG2: u32 = 6;

/// White, 1/f and 1/f² noise behind the filter, and an unfiltered floor.
const TERMS: usize = 4;

/// A sum of power laws behind a filter.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectralShape {
    sample_period: f64,
    /// Taps of each of the filter's two cascaded averages; 1 for no filter.
    pub taps: u32,
    /// Densities at 1 Hz of the filtered white, 1/f and 1/f² noise, and of the floor, unit²/Hz.
    pub densities: [f64; TERMS],
}

impl SpectralShape {
    /// The likeliest shape over all lengths of the filter, without a filter if `bands` is empty.
    #[must_use]
    pub fn fit(bands: &[SpectralBand], sample_period: f64) -> Self {
        let candidates = (0..=LARGEST_TAPS_LOG2).map(|log2| Self::fit_with_taps(bands, sample_period, 1 << log2));
        let likeliest = candidates.min_by(|(_, a), (_, b)| a.total_cmp(b));
        likeliest.map_or(Self { sample_period, taps: 1, densities: [0.0; TERMS] }, |(shape, _)| shape)
    }

    /// Density at `frequency` in Hz, unit²/Hz.
    #[must_use]
    pub fn density(&self, frequency: f64) -> f64 {
        let basis = shape_basis(frequency, self.sample_period, self.taps);
        basis.iter().zip(self.densities).map(|(basis, density)| basis * density).sum()
    }

    /// N in unit·√s: the root of half the density of the white noise before the filter. Only of a spectrum that is known to
    /// be behind a filter: in white noise nothing tells the filtered noise from the floor, and
    /// [`fit_white_noise`](super::fit_white_noise) chooses between them.
    #[must_use]
    pub fn angle_random_walk(&self) -> f64 {
        (self.densities[0] / 2.0).sqrt()
    }

    /// Relative standard deviation of [`angle_random_walk`](Self::angle_random_walk) when the other terms are fitted as
    /// well, by the Fisher information in `bands`; `None` where there is no white noise.
    #[must_use]
    pub fn angle_random_walk_error(&self, bands: &[SpectralBand]) -> Option<f64> {
        // Fisher information on the logarithms of the densities that are not 0.
        let present: Vec<usize> = (0..TERMS).filter(|&term| self.densities[term] > 0.0).collect();
        if present.first() != Some(&0) {
            return None;
        }
        let mut information = DMatrix::zeros(present.len(), present.len());
        for band in bands {
            let basis = shape_basis(band.frequency, self.sample_period, self.taps);
            let total = self.density(band.frequency);
            let fractions = present.iter().map(|&term| basis[term] * self.densities[term] / total);
            let fractions = DVector::from_iterator(present.len(), fractions);
            information += band.ordinates * &fractions * fractions.transpose();
        }
        let variance = information.cholesky()?.inverse()[(0, 0)];
        Some(variance.sqrt() / 2.0)
    }

    /// The likeliest shape with a filter of this length, and its objective.
    fn fit_with_taps(bands: &[SpectralBand], sample_period: f64, taps: u32) -> (Self, f64) {
        let basis = |band: &SpectralBand| shape_basis(band.frequency, sample_period, taps);
        let bases: Vec<[f64; TERMS]> = bands.iter().map(basis).collect();
        let mut shape = Self { sample_period, taps, densities: [0.0; TERMS] };
        let objective = fit_mixture(bands, &bases, &mut shape.densities);
        (shape, objective)
    }
}

/// Values of the terms for a density of 1 at 1 Hz. Without a filter the floor is the same as the white noise, and left out.
fn shape_basis(frequency: f64, sample_period: f64, taps: u32) -> [f64; TERMS] {
    let sine = (PI * frequency * sample_period).sin();
    let gain = filter_gain(frequency, sample_period, taps, sine);
    let walk = PI * sample_period / sine;
    [gain, gain / frequency, gain * walk * walk, if taps > 1 { 1.0 } else { 0.0 }]
}

/// Square root of the density of a sampled random walk: 1/f² with its aliases, `(π·dt/sin(πf·dt))²`.
pub(super) fn walk_amplitude(frequency: f64, sample_period: f64) -> f64 {
    PI * sample_period / (PI * frequency * sample_period).sin()
}

/// Power gain of two cascaded averages over `taps` samples each (a Bartlett window), at a frequency whose phase in one sample has
/// this `sine`.
pub(super) fn filter_gain(frequency: f64, sample_period: f64, taps: u32, sine: f64) -> f64 {
    if taps == 1 || sine == 0.0 {
        return 1.0;
    }
    let taps = f64::from(taps);
    ((taps * PI * frequency * sample_period).sin() / (taps * sine)).powi(4)
}

/// Ordinates below this multiple of the resolution are left to the drift of the record.
const LOWEST: usize = 3;
/// Number of equal bands over the linear part of the spectrum; narrow enough to resolve the nulls of a filter.
const BANDS: usize = 512;
/// Ordinates on either side of a local median, at most.
pub(super) const WINDOW: usize = 512;
/// Variance of the median of exponential variables over that of their mean: 1/ln²2.
const MEDIAN_LOSS: f64 = 2.08;
/// Floor of the background, as a fraction of the density of the median band: below it the spectrum is what the taper leaks.
const FLOOR: f64 = 1e-7;

/// A spectrum without its lines: a smooth shape with a local correction.
pub(super) struct Background<'a> {
    /// Factor on the shape at a frequency in Hz.
    known: &'a dyn Fn(f64) -> f64,
    shape: SpectralShape,
    floor: f64,
    resolution: f64,
    ordinates: usize,
    /// Independent estimates that each ordinate is the mean of.
    looks: f64,
}

/// The level of a spectrum around an ordinate.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalLevel {
    pub value: f64,
    /// Number of ordinates whose mean would vary as much as `value`.
    pub ordinates: f64,
}

impl<'a> Background<'a> {
    /// Fits the background of `density`, given at the multiples of `resolution` Hz from 0 on, each the mean of `looks` independent
    /// estimates; `None` if that is fewer than 8 bands, or if a band has no power.
    pub(super) fn fit(
        density: &[f64],
        looks: f64,
        known: &'a dyn Fn(f64) -> f64,
        resolution: f64,
        sample_period: f64,
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
            shape: SpectralShape::fit(&bands, sample_period),
            floor: FLOOR * median(&mut bands.iter().map(|band| band.density).collect::<Vec<f64>>()),
            resolution,
            ordinates: density.len(),
            looks,
        })
    }

    /// Density at `bin` resolutions, before the local correction.
    pub(super) fn shape_at(&self, bin: f64) -> f64 {
        let frequency = bin * self.resolution;
        (self.known)(frequency) * (self.shape.density(frequency) + self.floor)
    }

    /// Local correction around `bin`: the median of ordinates that have been divided by [`shape_at`](Self::shape_at).
    pub(super) fn level(&self, whitened: &[f64], bin: usize) -> LocalLevel {
        let widest = WINDOW.min(self.ordinates / 16).max(8);
        let low = bin.saturating_sub(widest.min(bin * 2 / 3)).max(LOWEST);
        // The last ordinate is left out: it has a single degree of freedom.
        let high = (bin + widest.min(2 * bin)).min(self.ordinates - 2);
        let mut window = whitened[low..=high].to_vec();
        let value = median(&mut window) / expected_median(window.len(), self.looks);
        LocalLevel { value, ordinates: window.len() as f64 / MEDIAN_LOSS }
    }
}

/// Bands of ordinates up to the end of a spectrum: an eighth of the frequency wide at first, then all of one width.
fn background_bands(ordinates: usize) -> impl Iterator<Item = Range<usize>> {
    let widest = (ordinates / BANDS).max(1);
    let mut start = LOWEST;
    std::iter::from_fn(move || {
        let range = start..start + (start / 8).clamp(1, widest);
        start = range.end;
        (range.end < ordinates).then_some(range)
    })
}

/// The middle value, or the mean of the two in the middle; 0 of an empty slice.
pub(super) fn median(values: &mut [f64]) -> f64 {
    let Some(last) = values.len().checked_sub(1) else {
        return 0.0;
    };
    let (lower, &mut upper, _) = values.select_nth_unstable_by(values.len() / 2, f64::total_cmp);
    if last % 2 == 0 { upper } else { (upper + lower.iter().copied().fold(0.0, f64::max)) / 2.0 }
}

/// Expected median of `count` variables that are each the mean of `looks` exponential ones of mean 1. The expected order statistic
/// of rank `j` of exponential variables is the sum of `1/i` over the last `j` of `1 … count`; the median of a gamma variable of
/// shape g, 4 or more, is within 0.3 % `1 − 1/(3g)` of its mean.
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
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [3.0, 1.0, 2.0, 9.0]), 2.5);
    }
}
