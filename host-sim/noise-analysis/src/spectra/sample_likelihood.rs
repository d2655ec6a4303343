//! The coefficients of a model by all samples: Whittle's likelihood of the discrete cosine transform of a record.
//!
//! ```text
//! samples ─► cosine transform ─► squares, averaged over bands ─┐
//! means   ─► cosine transform ─► the lower half of the bands ──┼─► likeliest densities ─► profile likelihood ─► 95 % bounds
//! samples ─► Welch's spectrum ─► the bands above them ─────────┘
//! ```
//!
//! The even continuation of a record has no jump at its ends. The cosines are the principal components of white noise and of a random
//! walk whose first value is unknown: their coefficients are independent, with the variance `S(k/2T)/dt` of the two-sided density `S`, so
//! that the likelihood of white noise with a random walk is exact, without a taper. That of flicker noise has the expected squares of
//! its lowest coefficients, which [`flicker_leakage`] gives.
//!
//! Of a record whose means alone are kept, the coefficients of the means have the density of the samples, weighted by what a mean lets
//! through and with its aliases, and the averaged spectrum of the samples has what is above.

use super::cosine_spectrum::flicker_leakage;
use super::line_models::Sine;
use super::transforms;
use super::welch::Welch;
use super::whittle::{Sign, SpectralBand, fit_mixture, fit_mixture_with};
use crate::distributions::NORMAL_975;
use crate::samples::correlated_rounding::Rounding;
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
/// Frequencies in a band at which the densities are evaluated, at most: of samples, and of means, which have no null of a filter.
const POINTS_IN_BAND: usize = 8;
const POINTS_IN_BAND_OF_MEANS: usize = 2;
/// Coefficients, and points of Welch's spectrum, on either side of a line that are left out.
const LINE_COEFFICIENTS: f64 = 8.0;
const LINE_POINTS: f64 = 4.0;
/// Part of the rate of means up to which their coefficients are used, and the lowest point of Welch's spectrum: below, the window
/// spreads drift over several points.
const OF_MEANS: f64 = 0.25;
const LOWEST_POINT: f64 = 8.0;
/// Weights of a point of Welch's spectrum and of its neighbours in what the density is averaged over: the squares of the transform of a
/// Hann window.
const HANN: [(f64, f64); 3] = [(-1.0, 1.0 / 6.0), (0.0, 2.0 / 3.0), (1.0, 1.0 / 6.0)];
/// Largest part of the density of filtered white noise that the ends of the record may leak.
const MOST_LEAKAGE: f64 = 0.1;
/// Factor by which a bound is bracketed, and relative width at which its search ends.
const BRACKET: f64 = 2.0;
const PRECISION: f64 = 1e-3;

/// The `model` with the coefficients and the bounds that the samples of `series` give to its noise; its shapes are kept, and so are its
/// lines, whose frequencies are left out.
///
/// A bound is where the likelihood, with all other coefficients at their likeliest, is `exp(−1.96²/2)` of its maximum. Flicker noise and
/// random walks pass the filter of the model; where white noise beside it is not one of the terms, that of rounding is, of known size.
/// `None` if more than a thousandth of the samples is missing, or a long gap, if there are fewer than 1,024, or if the model has a ramp.
#[must_use]
pub fn fit_to_samples(series: &UniformSeries, model: &Model) -> Option<Model> {
    let shapes = Shapes::new(model, series, 1)?;
    shapes.fitted(model, shapes.cosine_bands(series, f64::INFINITY)?)
}

/// The same of a series of means of so many samples each, and of the spectrum of the samples.
#[must_use]
pub fn fit_to_means(means: &UniformSeries, samples_per_mean: u64, spectrum: &Welch, model: &Model) -> Option<Model> {
    let shapes = Shapes::new(model, means, samples_per_mean)?;
    let below = OF_MEANS / means.sample_period();
    let mut evidence = shapes.cosine_bands(means, below)?;
    evidence.extend(shapes.spectrum_bands(spectrum, below.max(LOWEST_POINT * spectrum.resolution())));
    shapes.fitted(model, evidence)
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
    fn new(filter: MovingAverageFilter, period: f64) -> Self {
        let reach = (f64::from(filter.stages) * f64::from(filter.taps) / filter.decimation) as u32;
        // The covariance is half the second difference of the variance of sums.
        let sum = |samples: f64| filter.sum_variance(samples.abs(), period);
        let covariance = |lag: f64| (sum(lag + 1.0) - 2.0 * sum(lag) + sum(lag - 1.0)) / 2.0;
        Self { filter, covariances: (0..=reach).map(|lag| period * covariance(lag.into())).collect() }
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

/// A band of a spectrum with the mean density of each shape in it.
type Evidence = Vec<(SpectralBand, Vec<f64>)>;

/// A shape that a spectrum is made of.
#[derive(Clone, Copy)]
enum Shape {
    /// That of a noise term for the coefficient 1.
    Term(NoiseTerm),
    /// That of rounding, whose size is known.
    Rounding,
}

/// The densities of the noise terms of a model, and of what rounding adds.
struct Shapes {
    kinds: Vec<NoiseTerm>,
    /// Frequencies of its lines, Hz.
    lines: Vec<f64>,
    filtered: Option<FilteredNoise>,
    /// Rounding errors, where no term has them.
    rounding: Option<Rounding>,
    /// Seconds between samples, and samples of a mean.
    period: f64,
    samples_per_mean: u64,
    /// Frequency of the coefficient of order 1, Hz.
    resolution: f64,
}

impl Shapes {
    /// `None` if the model has a term whose size is no density.
    fn new(model: &Model, series: &UniformSeries, samples_per_mean: u64) -> Option<Self> {
        let kinds = || model.terms().iter().map(|term| term.kind);
        if kinds().any(|kind| kind == NoiseTerm::RateRamp) {
            return None;
        }
        let period = model.sample_period();
        let filtered = model.filter().map(|filter| FilteredNoise::new(filter, period));
        let has_white = kinds().any(|kind| kind == NoiseTerm::AngleRandomWalk);
        let rounding = match series.rounding() {
            Rounding::White(density) if filtered.is_none() || has_white || *density == 0.0 => None,
            rounding => Some(rounding.clone()),
        };
        Some(Self {
            kinds: kinds().filter(|kind| line_frequency(kind).is_none()).collect(),
            lines: kinds().filter_map(|kind| line_frequency(&kind)).collect(),
            filtered,
            rounding,
            period,
            samples_per_mean,
            resolution: 0.5 / series.duration(),
        })
    }

    /// The bands of the coefficients of `series` below a frequency.
    fn cosine_bands(&self, series: &UniformSeries, below: f64) -> Option<Evidence> {
        let (filled, replaced) = series.interpolated();
        let mut filled = filled.into_owned();
        let period = series.sample_period();
        // The means show a line at its alias.
        let shown: Vec<f64> = self.lines.iter().map(|line| (line - (line * period).round() / period).abs()).collect();
        for &line in shown.iter().filter(|line| **line > self.resolution) {
            filled = Sine::fit_near(&filled, line, self.resolution).subtracted_from(&filled);
        }
        let values = filled.values();
        let is_whole = values.len() >= LEAST_SAMPLES && values.iter().all(|value| value.is_finite());
        if !is_whole || replaced > MOST_INTERPOLATED {
            return None;
        }
        let squares = squared_coefficients(values, series.mean());
        let is_line =
            |order: usize| shown.iter().any(|line| (order as f64 - line / self.resolution).abs() < LINE_COEFFICIENTS);
        let is_kept = |orders: &Range<usize>| {
            (orders.end as f64) * self.resolution < below
                && !orders.clone().any(is_line)
                && !self.is_leakage(orders, values.len())
        };
        let band = |orders: Range<usize>| {
            let density = period * squares[orders.clone()].iter().sum::<f64>() / orders.len() as f64;
            let frequency = self.resolution * (orders.start + orders.end - 1) as f64 / 2.0;
            // One real number has half the degrees of freedom of an ordinate of a Fourier transform.
            let band = SpectralBand { frequency, density, ordinates: 0.5 * orders.len() as f64 };
            (band, self.in_band(&orders, values.len()))
        };
        Some(bands(squares.len()).filter(is_kept).map(band).collect())
    }

    /// The bands of the `spectrum` of the samples above a frequency.
    fn spectrum_bands(&self, spectrum: &Welch, above: f64) -> Evidence {
        let reach = LINE_POINTS * spectrum.resolution();
        let is_line = |frequency: f64| self.lines.iter().any(|line| (frequency - line).abs() < reach);
        let lowest = (above / spectrum.resolution()).ceil() as usize;
        let band = |points: &Vec<usize>| {
            let average = spectrum.average(points);
            let bases = self.all().map(|shape| {
                let of_point = |point: &usize| {
                    let at = |(beside, weight): (f64, f64)| {
                        weight * self.density(shape, (*point as f64 + beside) * spectrum.resolution())
                    };
                    HANN.map(at).iter().sum::<f64>()
                };
                points.iter().map(of_point).sum::<f64>() / points.len() as f64
            });
            // Two-sided.
            (SpectralBand { density: average.density / 2.0, ..average }, bases.collect())
        };
        spectrum.band_points(lowest, is_line).iter().map(band).collect()
    }

    /// The terms, and rounding as the last shape.
    fn all(&self) -> impl Iterator<Item = Shape> {
        self.kinds.iter().copied().map(Shape::Term).chain(self.rounding.as_ref().map(|_| Shape::Rounding))
    }

    /// The mean of each in a band of the coefficients of `count` samples.
    fn in_band(&self, indices: &Range<usize>, count: usize) -> Vec<f64> {
        let most = if self.samples_per_mean == 1 { POINTS_IN_BAND } else { POINTS_IN_BAND_OF_MEANS };
        let points = indices.len().min(most);
        let order = |point: usize| {
            let part = (point as f64 + 0.5) / points as f64;
            0.5 + indices.start as f64 + part * indices.len() as f64
        };
        let mean = |shape| (0..points).map(|at| self.at(shape, order(at), count)).sum::<f64>() / points as f64;
        self.all().map(mean).collect()
    }

    /// That of a shape at a coefficient of this order.
    fn at(&self, shape: Shape, order: f64, count: usize) -> f64 {
        let density = || self.density_of_means(shape, order * self.resolution);
        match (shape, &self.filtered) {
            (Shape::Term(NoiseTerm::Filtered(_)), Some(filtered)) if self.samples_per_mean == 1 => {
                filtered.expected(order, count)
            }
            (Shape::Term(NoiseTerm::BiasInstability), _) => density() * flicker_leakage(order),
            _ => density(),
        }
    }

    /// The density of the means: what they let through, with its aliases.
    fn density_of_means(&self, shape: Shape, frequency: f64) -> f64 {
        let count = self.samples_per_mean as f64;
        let rate = 1.0 / (count * self.period);
        let alias = |order: f64| {
            let frequency = frequency + order * rate;
            let half = PI * frequency * self.period;
            let gain = if half == 0.0 { 1.0 } else { (count * half).sin() / (count * half.sin()) };
            gain * gain * self.density(shape, frequency)
        };
        match shape {
            _ if self.samples_per_mean == 1 => self.density(shape, frequency),
            // Means of means are means over their whole time.
            Shape::Term(kind @ NoiseTerm::BiasInstability) => {
                kind.process().density(frequency, 1.0 / rate) * self.gain(frequency)
            }
            Shape::Term(NoiseTerm::AngleRandomWalk) => 1.0,
            _ => (0..self.samples_per_mean).map(|order| alias(order as f64)).sum(),
        }
    }

    /// The density of the samples.
    fn density(&self, shape: Shape, frequency: f64) -> f64 {
        let kind = match (shape, &self.rounding) {
            (Shape::Term(kind), _) => kind,
            (Shape::Rounding, rounding) => {
                // One-sided there.
                return rounding.as_ref().map_or(0.0, |of| of.density(frequency) / 2.0);
            }
        };
        let density = kind.process().density(frequency, self.period);
        let passes = kind.passes_filter() || matches!(kind, NoiseTerm::Markov(_));
        if passes { density * self.gain(frequency) } else { density }
    }

    /// Whether the ends of the record leak into the first, the middle or the last coefficient of a band behind the filter: few
    /// numbers make what is seen there, so that it scatters more than an average of independent coefficients.
    fn is_leakage(&self, indices: &Range<usize>, count: usize) -> bool {
        let Some(filtered) = self.filtered.as_ref().filter(|_| self.samples_per_mean == 1) else { return false };
        [indices.start + 1, indices.start.midpoint(indices.end) + 1, indices.end].into_iter().any(|order| {
            let density = filtered.filter.density(order as f64 * self.resolution, self.period);
            (filtered.expected(order as f64, count) - density).abs() > MOST_LEAKAGE * density
        })
    }

    /// Power gain of the filter of the model.
    fn gain(&self, frequency: f64) -> f64 {
        self.filtered.as_ref().map_or(1.0, |filtered| filtered.filter.gain(frequency, self.period))
    }

    /// `model` with what makes this `evidence` likeliest.
    fn fitted(&self, model: &Model, evidence: Evidence) -> Option<Model> {
        let (bands, bases): (Vec<SpectralBand>, Vec<Vec<f64>>) = evidence.into_iter().unzip();
        let mut densities = vec![0.0; self.all().count()];
        let mut objective = fit_mixture(&bands, &bases, Sign::NonNegative, &mut densities);
        let rounding = self.rounding.as_ref().map(|_| self.kinds.len());
        if let Some(at) = rounding {
            densities[at] = 1.0;
            objective = fit_mixture_with(&bands, &bases, Sign::NonNegative, &[at], &mut densities);
        }
        let profile = Profile { bands: &bands, bases: &bases, densities: &densities, objective, rounding };
        let mut fitted = (0..self.kinds.len()).map(|term| profile.coefficient(term));
        let terms = model.terms().iter().map(|term| {
            let is_noise = line_frequency(&term.kind).is_none();
            let (value, low, high) = if is_noise { fitted.next()? } else { (term.value, term.low, term.high) };
            Some(FittedTerm { value, low, high, ..*term })
        });
        Some(Model::new(model.sample_period(), terms.collect::<Option<Vec<FittedTerm>>>()?))
    }
}

/// The frequency of a sinusoid, Hz.
fn line_frequency(kind: &NoiseTerm) -> Option<f64> {
    match kind {
        NoiseTerm::Sinusoid(line) => Some(line.frequency),
        _ => None,
    }
}

/// The likelihood around its maximum.
struct Profile<'a> {
    bands: &'a [SpectralBand],
    bases: &'a [Vec<f64>],
    /// At the maximum.
    densities: &'a [f64],
    objective: f64,
    /// Position of what is known, the rounding.
    rounding: Option<usize>,
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
        let held: Vec<usize> = std::iter::once(term).chain(self.rounding).collect();
        let objective = fit_mixture_with(self.bands, self.bases, Sign::NonNegative, &held, &mut densities);
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
        let filtered = FilteredNoise::new(MovingAverageFilter::bartlett(4), 0.01);
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
