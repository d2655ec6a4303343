//! The coefficients of a model by all samples: Whittle's likelihood of the discrete cosine transform of a record.
//!
//! ```text
//! samples ─► cosine transform ─► squares, averaged over bands ─► likeliest densities ─► profile likelihood ─► 95 % bounds
//! ```
//!
//! The even continuation of a record has no jump at its ends. The cosines are the principal components of white noise and of a random
//! walk whose first value is unknown: their coefficients are independent, with the variance `S(k/2T)/dt` of the two-sided density `S`, so
//! that the likelihood of white noise with a random walk is exact, without a taper. That of flicker noise has the expected squares of
//! its lowest coefficients, which [`flicker_leakage`] gives.

use super::cosine_spectrum::flicker_leakage;
use super::line_models::Sine;
use super::transforms;
use super::whittle::{Sign, SpectralBand, fit_mixture, fit_mixture_with};
use crate::distributions::NORMAL_975;
use crate::samples::uniform_series::UniformSeries;
use allan_core::model::FittedTerm;
use allan_core::term::{MovingAverageFilter, Process};
use allan_core::{Model, NoiseTerm};
use std::f64::consts::PI;
use std::ops::Range;

/// Fewest samples.
const LEAST_SAMPLES: usize = 1024;
/// Largest share of samples that may be interpolated: they have less noise than the others.
const MOST_INTERPOLATED: f64 = 1e-3;
/// Relative width of a band, and the number of equal bands at which its growth ends: narrow enough for the nulls of a filter.
const BANDS_PER_E_FOLD: usize = 16;
const BANDS: usize = 512;
/// Frequencies in a band at which the densities are evaluated, at most.
const POINTS_IN_BAND: usize = 8;
/// Coefficients on either side of a line that are left out.
const LINE_COEFFICIENTS: f64 = 8.0;
/// Largest part of the density of filtered white noise that the ends of the record may leak.
const MOST_LEAKAGE: f64 = 0.1;
/// Factor by which a bound is bracketed, and relative width at which its search ends.
const BRACKET: f64 = 2.0;
const PRECISION: f64 = 1e-3;

/// The `model` with the coefficients and the bounds that the samples of `series` give to its noise; its shapes are kept, and so are its
/// lines, whose frequencies are left out.
///
/// A bound is where the likelihood, with all other coefficients at their likeliest, is `exp(−1.96²/2)` of its maximum. Flicker noise and
/// random walks pass the filter of the model. `None` if more than a thousandth of the samples is missing, or a long gap, if there are
/// fewer than 1,024, or if the model has a ramp.
#[must_use]
pub fn fit_to_samples(series: &UniformSeries, model: &Model) -> Option<Model> {
    if model.terms().iter().any(|term| term.kind == NoiseTerm::RateRamp) {
        return None;
    }
    let (filled, replaced) = series.interpolated();
    let mut filled = filled.into_owned();
    for term in model.terms() {
        if let NoiseTerm::Sinusoid(line) = term.kind {
            filled = Sine::fit_near(&filled, line.frequency, 0.5 / series.duration()).subtracted_from(&filled);
        }
    }
    let values = filled.values();
    let is_whole = values.len() >= LEAST_SAMPLES && values.iter().all(|value| value.is_finite());
    if !is_whole || replaced > MOST_INTERPOLATED {
        return None;
    }
    let period = series.sample_period();
    let resolution = 0.5 / series.duration();
    let is_noise = |term: &&FittedTerm| !matches!(term.kind, NoiseTerm::Sinusoid(_));
    let kinds: Vec<NoiseTerm> = model.terms().iter().filter(is_noise).map(|term| term.kind).collect();
    let is_line = |order: usize| {
        model.terms().iter().any(|term| match term.kind {
            NoiseTerm::Sinusoid(line) => (order as f64 - line.frequency / resolution).abs() < LINE_COEFFICIENTS,
            _ => false,
        })
    };
    let squares = squared_coefficients(values, series.mean());
    let shapes = Shapes { kinds: &kinds, filtered: FilteredNoise::find(&kinds, period), period, resolution };
    let is_kept = |orders: &Range<usize>| !orders.clone().any(is_line) && !shapes.is_leakage(orders, values.len());
    let orders = bands(squares.len()).filter(is_kept);
    let (bands, bases): (Vec<SpectralBand>, Vec<Vec<f64>>) = orders
        .map(|orders| {
            let density = period * squares[orders.clone()].iter().sum::<f64>() / orders.len() as f64;
            let frequency = resolution * (orders.start + orders.end - 1) as f64 / 2.0;
            // One real number has half the degrees of freedom of an ordinate of a Fourier transform.
            let band = SpectralBand { frequency, density, ordinates: 0.5 * orders.len() as f64 };
            (band, shapes.in_band(&orders, values.len()))
        })
        .unzip();
    let mut densities = vec![0.0; kinds.len()];
    let objective = fit_mixture(&bands, &bases, Sign::NonNegative, &mut densities);
    let profile = Profile { bands: &bands, bases: &bases, densities: &densities, objective };
    let mut fitted = (0..kinds.len()).map(|term| profile.coefficient(term));
    let terms = model.terms().iter().map(|term| {
        let (value, low, high) = if is_noise(&term) { fitted.next()? } else { (term.value, term.low, term.high) };
        Some(FittedTerm { value, low, high, ..*term })
    });
    Some(Model::new(model.sample_period(), terms.collect::<Option<Vec<FittedTerm>>>()?))
}

/// Squares of the coefficients of the cosine transform of `values` around `mean`, of the orders 1, 2, 3 …, normalised so that those of
/// white noise have its variance.
fn squared_coefficients(values: &[f64], mean: f64) -> Vec<f64> {
    let count = values.len();
    // The transform of the even samples, followed by the odd ones in reverse, turned by a quarter of its phase (J. Makhoul, "A fast
    // cosine transform in one and two dimensions", IEEE Trans. ASSP 28, 1980).
    let transform = transforms::forward(count);
    let mut input: Vec<f64> = values.iter().step_by(2).map(|value| value - mean).collect();
    input.extend(values.iter().skip(1).step_by(2).rev().map(|value| value - mean));
    let mut output = transform.make_output_vec();
    if transform.process(&mut input, &mut output).is_err() {
        return Vec::new();
    }
    let mut squares = vec![0.0; count - 1];
    for (order, value) in output.iter().enumerate().skip(1) {
        let (sine, cosine) = (PI * order as f64 / (2 * count) as f64).sin_cos();
        let turned = [value.re * cosine + value.im * sine, value.im * cosine - value.re * sine];
        squares[order - 1] = 2.0 / count as f64 * turned[0].powi(2);
        squares[count - order - 1] = 2.0 / count as f64 * turned[1].powi(2);
    }
    squares
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

/// White noise behind the filter of a model.
struct FilteredNoise {
    filter: MovingAverageFilter,
    /// Covariance at each lag in samples, times the sample period, for a coefficient of 1.
    covariances: Vec<f64>,
}

impl FilteredNoise {
    fn find(kinds: &[NoiseTerm], period: f64) -> Option<Self> {
        let filter = kinds.iter().find_map(|kind| match kind {
            NoiseTerm::Filtered(filter) => Some(*filter),
            _ => None,
        })?;
        let reach = (f64::from(filter.stages) * f64::from(filter.taps) / filter.decimation) as u32;
        // The covariance is half the second difference of the variance of sums.
        let sum = |samples: f64| filter.sum_variance(samples.abs(), period);
        let covariance = |lag: f64| (sum(lag + 1.0) - 2.0 * sum(lag) + sum(lag - 1.0)) / 2.0;
        Some(Self { filter, covariances: (0..=reach).map(|lag| period * covariance(lag.into())).collect() })
    }

    /// Expected square of the coefficient of this order of `count` samples, times the sample period: the density, and what the ends of
    /// the record leak into the nulls of the filter.
    fn expected(&self, order: f64, count: usize) -> f64 {
        let (phase, count) = (PI * order / count as f64, count as f64);
        let of_lag = |(lag, covariance): (usize, &f64)| {
            let lag = lag as f64;
            let both_sides = if lag == 0.0 { 1.0 } else { 2.0 };
            both_sides * covariance * ((count - lag) * (phase * lag).cos() - (phase * lag).sin() / phase.sin()) / count
        };
        self.covariances.iter().enumerate().map(of_lag).sum()
    }
}

/// The densities of the terms of a model.
struct Shapes<'a> {
    kinds: &'a [NoiseTerm],
    filtered: Option<FilteredNoise>,
    period: f64,
    /// Frequency of the coefficient of order 1, Hz.
    resolution: f64,
}

impl Shapes<'_> {
    /// The mean of each in a band of the coefficients of `count` samples.
    fn in_band(&self, indices: &Range<usize>, count: usize) -> Vec<f64> {
        let points = indices.len().min(POINTS_IN_BAND);
        let order = |point: usize| {
            let part = (point as f64 + 0.5) / points as f64;
            0.5 + indices.start as f64 + part * indices.len() as f64
        };
        let mean =
            |kind: &NoiseTerm| (0..points).map(|at| self.at(kind, order(at), count)).sum::<f64>() / points as f64;
        self.kinds.iter().map(mean).collect()
    }

    /// That of a term at a coefficient of this order.
    fn at(&self, kind: &NoiseTerm, order: f64, count: usize) -> f64 {
        let frequency = order * self.resolution;
        let density = || kind.process().density(frequency, self.period);
        match (kind, &self.filtered) {
            (NoiseTerm::Filtered(_), Some(filtered)) => filtered.expected(order, count),
            (NoiseTerm::BiasInstability, _) => density() * self.gain(frequency) * flicker_leakage(order),
            (NoiseTerm::RateRandomWalk | NoiseTerm::Markov(_), _) => density() * self.gain(frequency),
            _ => density(),
        }
    }

    /// Whether the ends of the record leak into the first, the middle or the last coefficient of a band behind the filter: few
    /// numbers make what is seen there, so that it scatters more than an average of independent coefficients.
    fn is_leakage(&self, indices: &Range<usize>, count: usize) -> bool {
        let Some(filtered) = &self.filtered else { return false };
        [indices.start + 1, indices.start.midpoint(indices.end) + 1, indices.end].into_iter().any(|order| {
            let density = filtered.filter.density(order as f64 * self.resolution, self.period);
            (filtered.expected(order as f64, count) - density).abs() > MOST_LEAKAGE * density
        })
    }

    /// Power gain of the filter of the model.
    fn gain(&self, frequency: f64) -> f64 {
        let Some(MovingAverageFilter { stages, taps, decimation }) = self.filtered.as_ref().map(|of| of.filter) else {
            return 1.0;
        };
        let half = PI * frequency * self.period / decimation;
        let ratio = (f64::from(taps) * half).sin() / (f64::from(taps) * half.sin());
        ratio.powi(2 * i32::from(stages))
    }
}

/// The likelihood around its maximum.
struct Profile<'a> {
    bands: &'a [SpectralBand],
    bases: &'a [Vec<f64>],
    /// At the maximum.
    densities: &'a [f64],
    objective: f64,
}

impl Profile<'_> {
    /// The coefficient of a term and its 95 % bounds. A density is the square of a coefficient.
    fn coefficient(&self, term: usize) -> (f64, f64, f64) {
        let value = self.densities[term];
        // Where the term alone explains the spectrum, for one that is not in it.
        let alone = self.bands.iter().zip(self.bases).map(|(band, basis)| band.density / basis[term]);
        let scale = if value > 0.0 { value } else { alone.fold(f64::INFINITY, f64::min) };
        let high = self.bound(term, value, scale, BRACKET);
        let low = if self.is_within(term, 0.0) { 0.0 } else { self.bound(term, value, scale, 1.0 / BRACKET) };
        (value.sqrt(), low.sqrt(), high.sqrt())
    }

    /// The density beyond `value` at which the likelihood has fallen; it is sought from `scale` on by `factor`.
    fn bound(&self, term: usize, value: f64, scale: f64, factor: f64) -> f64 {
        let (mut inside, mut outside) = (value, scale);
        if value == 0.0 {
            while !self.is_within(term, outside) && outside > f64::MIN_POSITIVE {
                outside /= factor;
            }
        }
        while self.is_within(term, outside) && outside.is_finite() && outside > f64::MIN_POSITIVE {
            (inside, outside) = (outside, outside * factor);
        }
        while (outside - inside).abs() > PRECISION * outside.max(inside) {
            let middle = (inside + outside) / 2.0;
            if self.is_within(term, middle) { inside = middle } else { outside = middle }
        }
        (inside + outside) / 2.0
    }

    fn is_within(&self, term: usize, density: f64) -> bool {
        let mut densities = self.densities.to_vec();
        densities[term] = density;
        let objective = fit_mixture_with(self.bands, self.bases, Sign::NonNegative, Some(term), &mut densities);
        objective - self.objective < NORMAL_975 * NORMAL_975 / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cosine of an order at a sample, with which the coefficients of white noise have its variance.
    fn cosine(order: usize, at: usize, count: usize) -> f64 {
        (2.0 / count as f64).sqrt() * (PI * (order * (2 * at + 1)) as f64 / (2 * count) as f64).cos()
    }

    #[test]
    fn the_squares_are_those_of_the_sums_with_each_cosine() {
        for count in [12, 15] {
            let values: Vec<f64> = (0..count).map(|at| f64::from((at * at * 7 + at) as u32 % 11)).collect();
            let squares = squared_coefficients(&values, values.iter().sum::<f64>() / count as f64);
            for order in 1..count {
                let sum: f64 = values.iter().enumerate().map(|(at, value)| value * cosine(order, at, count)).sum();
                assert!((squares[order - 1] - sum * sum).abs() < 1e-9, "{count}, {order}");
            }
        }
    }

    /// White noise of variance 1/dt behind two averages over 4 values has the covariances of the triangle (1, 2, 3, 4, 3, 2, 1)/16 with
    /// itself, 44, 40, 31, 20, 10, 4 and 1 of 256.
    #[test]
    fn coefficients_of_filtered_noise_have_the_squares_of_its_covariance() {
        let covariances = [44.0, 40.0, 31.0, 20.0, 10.0, 4.0, 1.0].map(|of| of / 256.0);
        let kinds = [NoiseTerm::Filtered(MovingAverageFilter::bartlett(4))];
        let filtered = FilteredNoise::find(&kinds, 0.01).expect("a filter");
        let count = 40;
        for order in 1..count {
            let pair = |a: usize, b: usize| {
                covariances.get(a.abs_diff(b)).map_or(0.0, |of| of * cosine(order, a, count) * cosine(order, b, count))
            };
            let expected: f64 = (0..count).flat_map(|a| (0..count).map(move |b| (a, b))).map(|(a, b)| pair(a, b)).sum();
            let found = filtered.expected(order as f64, count);
            assert!((found - expected).abs() < 1e-9, "{order}: {found}, {expected}");
        }
    }
}
