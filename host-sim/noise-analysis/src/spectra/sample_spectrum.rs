//! The spectrum of a record by all its samples, in bands.
//!
//! ```text
//! samples ─► cosine transform ─► squares, averaged over bands ─┐
//! means   ─► cosine transform ─► the lower half of the bands ──┼─► spectrum
//! samples ─► Welch's spectrum ─► the bands above them ─────────┘
//! ```
//!
//! The even continuation of a record has no jump at its ends. The cosines are the principal components of white noise and of a random
//! walk whose first value is unknown: their coefficients are independent, with the variance `S(k/2T)/dt` of the two-sided density `S`.

use super::lines::without_sines_at;
use super::transforms::cosine_transform;
use super::welch::Welch;
use super::whittle::SpectralBand;
use crate::samples::rounding::Rounding;
use crate::samples::uniform_series::UniformSeries;
use std::ops::Range;

/// Fewest samples.
const LEAST_SAMPLES: usize = 1024;
/// Largest share of samples that may be interpolated where coefficients are fitted: they have less noise than the others.
const MOST_INTERPOLATED: f64 = 1e-3;
/// Relative width of a band, and the number of equal bands at which its growth ends: narrow enough for the nulls of a filter.
const BANDS_PER_E_FOLD: usize = 16;
const BANDS: usize = 512;
/// Coefficients, and points of Welch's spectrum, on either side of a line that are left out.
const LINE_COEFFICIENTS: f64 = 8.0;
const LINE_POINTS: f64 = 4.0;
/// Neighbouring bands of Welch's spectrum that are one where it is used alone: the nulls of 2 × 64 taps are two of these apart.
const JOINED: usize = 2;
/// Rounds in which the harmonic mean of a density is found, each of which leaves less than half of the error.
const HARMONIC_ROUNDS: usize = 10;
/// Part of the rate of means up to which their coefficients are used, and the lowest point of Welch's spectrum: below, the window
/// spreads drift over several points.
const OF_MEANS: f64 = 0.25;
const LOWEST_POINT: f64 = 8.0;

/// The spectrum of all samples of a record without its lines, two-sided.
pub struct SampleSpectrum {
    pub(super) bands: Vec<SampleBand>,
    /// Samples or means whose cosine transform it has.
    pub(super) count: usize,
    /// Samples of a mean, and seconds between samples.
    pub(super) samples_per_mean: u64,
    pub(super) period: f64,
    /// Frequency of the coefficient of order 1, and distance of the points of Welch's spectrum, Hz.
    pub(super) resolution: f64,
    pub(super) point_resolution: f64,
    /// Rounding of the samples.
    pub(super) rounding: Rounding,
    /// Share of the samples that are interpolated.
    pub(super) interpolated: f64,
}

/// An average over neighbouring frequencies.
pub(super) struct SampleBand {
    pub(super) measured: SpectralBand,
    pub(super) place: Place,
}

/// The coefficients that a band averages.
#[derive(PartialEq)]
pub(super) enum Place {
    /// Squares of the coefficients of the cosine transform, of the orders 1, 2, 3 … from index 0 on.
    Coefficients(Range<usize>),
    /// Points of Welch's spectrum.
    Points(Vec<usize>),
}

impl SampleSpectrum {
    /// The spectrum of a series with `lines` at these frequencies in Hz. `None` if a long gap is missing, or if there are fewer than 1,024 samples.
    #[must_use]
    pub fn of_samples(series: &UniformSeries, lines: &[f64]) -> Option<Self> {
        Self::of_values(series, 1, lines, f64::INFINITY)
    }

    /// The same of a series of means of so many samples each, and of Welch's spectrum of the samples.
    #[must_use]
    pub fn of_means(means: &UniformSeries, samples_per_mean: u64, welch: &Welch, lines: &[f64]) -> Option<Self> {
        let below = OF_MEANS / means.sample_period();
        let mut spectrum = Self::of_values(means, samples_per_mean, lines, below)?;
        spectrum.point_resolution = welch.resolution();
        spectrum.bands.extend(bands_of_points(welch, lines, below.max(LOWEST_POINT * welch.resolution()), 1));
        Some(spectrum)
    }

    /// From Welch's spectrum of samples with this rounding alone, which leaves out long gaps too; `lines` are at these frequencies in Hz.
    ///
    /// The error of the best interpolation is uncorrelated with all other samples, and its variance is the harmonic mean of the density: a share
    /// of `interpolated` samples lacks as much white noise.
    pub(crate) fn of_welch(welch: &Welch, rounding: &Rounding, lines: &[f64], interpolated: f64) -> Self {
        let mut bands: Vec<SampleBand> =
            bands_of_points(welch, lines, LOWEST_POINT * welch.resolution(), JOINED).collect();
        let measured: Vec<(f64, f64)> = bands.iter().map(|of| (of.measured.ordinates, of.measured.density)).collect();
        for _ in 0..if interpolated > 0.0 { HARMONIC_ROUNDS } else { 0 } {
            let inverse = |of: &SampleBand| of.measured.ordinates / of.measured.density.max(f64::MIN_POSITIVE);
            let ordinates: f64 = measured.iter().map(|(ordinates, _)| ordinates).sum();
            let error = ordinates / bands.iter().map(inverse).sum::<f64>();
            let complete = |density: f64| density + interpolated * (error - density);
            bands.iter_mut().zip(&measured).for_each(|(band, (_, density))| band.measured.density = complete(*density));
        }
        Self {
            bands,
            count: 0,
            samples_per_mean: 1,
            period: welch.sample_period(),
            resolution: welch.resolution(),
            point_resolution: welch.resolution(),
            rounding: rounding.clone(),
            interpolated,
        }
    }

    /// True if the bands of another spectrum average the same coefficients, so that a model has the same densities there.
    pub(crate) fn has_bands_of(&self, other: &Self) -> bool {
        let layout = |of: &Self| (of.count, of.samples_per_mean, of.period, of.resolution, of.point_resolution);
        layout(self) == layout(other)
            && self.bands.iter().map(|of| &of.place).eq(other.bands.iter().map(|of| &of.place))
    }

    /// True if at most a thousandth of the samples is interpolated.
    pub(crate) fn has_all_noise(&self) -> bool {
        self.interpolated <= MOST_INTERPOLATED
    }

    /// Number of its bands.
    pub(crate) fn bands(&self) -> usize {
        self.bands.len()
    }

    /// The bands of the coefficients of `series` below a frequency.
    fn of_values(series: &UniformSeries, samples_per_mean: u64, lines: &[f64], below: f64) -> Option<Self> {
        let (filled, interpolated) = series.interpolated();
        let (period, resolution) = (series.sample_period(), 0.5 / series.duration());
        // Means show a line at its alias.
        let shown: Vec<f64> = lines.iter().map(|line| (line - (line * period).round() / period).abs()).collect();
        let filled = without_sines_at(&filled, shown.iter().copied());
        let values = filled.values();
        let is_whole = values.len() >= LEAST_SAMPLES && values.iter().all(|value| value.is_finite());
        if !is_whole {
            return None;
        }
        let squares = squared_coefficients(values, series.mean());
        let is_line =
            |order: usize| shown.iter().any(|line| (order as f64 - line / resolution).abs() < LINE_COEFFICIENTS);
        let is_kept = |orders: &Range<usize>| (orders.end as f64) * resolution < below && !orders.clone().any(is_line);
        let band = |orders: Range<usize>| {
            let density = period * squares[orders.clone()].iter().sum::<f64>() / orders.len() as f64;
            let frequency = resolution * (orders.start + orders.end - 1) as f64 / 2.0;
            // One real number has half the degrees of freedom of an ordinate of a Fourier transform.
            let measured = SpectralBand { frequency, density, ordinates: 0.5 * orders.len() as f64 };
            SampleBand { measured, place: Place::Coefficients(orders) }
        };
        Some(Self {
            bands: bands(squares.len()).filter(is_kept).map(band).collect(),
            count: values.len(),
            samples_per_mean,
            period: period / samples_per_mean as f64,
            resolution,
            point_resolution: resolution,
            rounding: series.rounding().clone(),
            interpolated,
        })
    }
}

/// The bands of Welch's spectrum above a frequency, so many of them `joined`.
fn bands_of_points(welch: &Welch, lines: &[f64], above: f64, joined: usize) -> impl Iterator<Item = SampleBand> {
    let reach = LINE_POINTS * welch.resolution();
    let is_line = |frequency: f64| lines.iter().any(|line| (frequency - line).abs() < reach);
    let band = |points: Vec<usize>| {
        let average = welch.average(&points);
        // Two-sided.
        let measured = SpectralBand { density: average.density / 2.0, ..average };
        SampleBand { measured, place: Place::Points(points) }
    };
    let bands = welch.band_points((above / welch.resolution()).ceil() as usize, is_line);
    bands.chunks(joined).map(<[Vec<usize>]>::concat).map(band).collect::<Vec<SampleBand>>().into_iter()
}

/// Squares of the coefficients of the cosine transform of `values` around `mean`, of the orders 1, 2, 3 …, normalised so that those of
/// white noise have its variance.
fn squared_coefficients(values: &[f64], mean: f64) -> Vec<f64> {
    let transform = cosine_transform(values.iter().map(|value| value - mean));
    transform.into_iter().skip(1).map(|of| 2.0 / values.len() as f64 * of.powi(2)).collect()
}

/// Bands of `count` coefficients, as indices of their squares: narrow ones at low orders.
fn bands(count: usize) -> impl Iterator<Item = Range<usize>> {
    let widest = (count / BANDS).max(1);
    let next = move |from: usize| {
        let width = ((from + 1) / BANDS_PER_E_FOLD).clamp(1, widest);
        (from < count).then(|| from..(from + width).min(count))
    };
    std::iter::successors(next(0), move |band| next(band.end))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn the_squares_are_those_of_the_sums_with_each_cosine() {
        for count in [12, 15] {
            let values: Vec<f64> = (0..count).map(|at| f64::from((at * at * 7 + at) as u32 % 11)).collect();
            let squares = squared_coefficients(&values, values.iter().sum::<f64>() / count as f64);
            for order in 1..count {
                let cosine = |at: usize| {
                    (2.0 / count as f64).sqrt() * (PI * (order * (2 * at + 1)) as f64 / (2 * count) as f64).cos()
                };
                let sum: f64 = values.iter().enumerate().map(|(at, value)| value * cosine(at)).sum();
                assert!((squares[order - 1] - sum * sum).abs() < 1e-9, "{count}, {order}");
            }
        }
    }
}
