//! A noise model, the sum of terms with coefficients: its Allan variance, spectrum, degrees of freedom and distance
//! from a curve.

use crate::curve::{AllanPoint, CurveView};
use crate::interpolation::subtraction_factor;
use crate::math::{Real, abs, clamp, exp, ln, sqrt};
use crate::noise_type::VarianceFractions;
use crate::term::{AllTerms, MovingAverageFilter, NoiseTerm, Shape, TermSet};
use core::mem::discriminant;
use heapless::Vec;

/// Largest number of terms of a model.
pub const MAX_TERMS: usize = 8;

/// A fitted term with its 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct FittedTerm {
    /// The term, with the estimates of its shape parameters.
    pub kind: NoiseTerm,
    /// Coefficient, in the unit of [`NoiseTerm::unit`]; 0 if the data does not show the term.
    pub value: f64,
    /// Lower 95 % bound; 0 if the data is compatible with the absence of the term.
    pub low: f64,
    /// Upper 95 % bound; above 0 if the curve has any point with a positive variance.
    pub high: f64,
    /// 95 % bounds of the shape parameters.
    pub shape: Shape<(f64, f64)>,
}

impl FittedTerm {
    /// A term with a known coefficient: its bounds are the value itself.
    #[must_use]
    pub fn exact(kind: NoiseTerm, value: f64) -> Self {
        let shape = kind.shape().map(|value| (value, value));
        Self { kind, value, low: value, high: value, shape }
    }

    /// Returns the term with other 95 % bounds of its coefficient.
    #[must_use]
    pub const fn with_bounds(self, low: f64, high: f64) -> Self {
        Self { low, high, ..self }
    }

    /// Name, value and 95 % bounds of each shape parameter.
    pub fn shape_parameters(&self) -> impl Iterator<Item = (&'static str, f64, (f64, f64))> + use<> {
        self.kind.shape().named().zip(self.shape.named()).map(|((name, value), (_, bounds))| (name, value, bounds))
    }
}

/// A sum of noise terms.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Model {
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::not_negative"))]
    sample_period: f64,
    terms: Vec<FittedTerm, MAX_TERMS>,
}

impl Model {
    /// The sum of the first [`MAX_TERMS`] of `terms` for samples every `sample_period` seconds.
    #[must_use]
    pub fn new(sample_period: f64, terms: impl IntoIterator<Item = FittedTerm>) -> Self {
        Self { sample_period, terms: terms.into_iter().take(MAX_TERMS).collect() }
    }

    pub(crate) fn set(&mut self, sample_period: f64, terms: impl Iterator<Item = FittedTerm>) {
        self.sample_period = sample_period;
        self.terms.clear();
        self.terms.extend(terms.take(MAX_TERMS));
    }

    /// Seconds between samples.
    #[must_use]
    pub fn sample_period(&self) -> f64 {
        self.sample_period
    }

    /// The fitted term of this kind, the first one of any shape; `None` if there is none.
    #[must_use]
    pub fn get(&self, kind: NoiseTerm) -> Option<&FittedTerm> {
        self.terms.iter().find(|term| discriminant(&term.kind) == discriminant(&kind))
    }

    /// The terms, in the order in which they were given.
    #[must_use]
    pub fn terms(&self) -> &[FittedTerm] {
        &self.terms
    }

    pub(crate) fn kinds(&self) -> Vec<NoiseTerm, MAX_TERMS> {
        self.terms.iter().map(|term| term.kind).collect()
    }

    pub(crate) fn terms_mut(&mut self) -> &mut [FittedTerm] {
        &mut self.terms
    }

    /// The low-pass filter of the model's white noise; `None` without a term of filtered white noise.
    #[must_use]
    pub fn filter(&self) -> Option<MovingAverageFilter> {
        filter_of(self.terms.iter().map(|term| &term.kind))
    }

    /// Allan variance of a term at averaging factor `n`, in the square of the unit: `value²` times
    /// [`NoiseTerm::avar`] behind the [`filter`](Self::filter).
    #[must_use]
    pub fn part(&self, term: &FittedTerm, n: u64) -> f64 {
        term.value * term.value * term.kind.avar_behind(self.filter().as_ref(), n, self.sample_period)
    }

    /// Modelled Allan variance at averaging factor `n`, in the square of the unit: the sum of the
    /// [`part`](Self::part)s of all terms.
    #[must_use]
    pub fn avar(&self, n: u64) -> f64 {
        self.contributions(n).map(|(_, avar)| avar).sum()
    }

    /// Modelled two-sided power spectral density at `frequency` in Hz, in unit²/Hz; deterministic terms contribute nothing.
    #[must_use]
    pub fn density(&self, frequency: f64) -> f64 {
        self.present().map(|term| self.part_of_density(term, frequency)).sum()
    }

    /// Contribution of a term to the [`density`](Self::density) at `frequency` in Hz, in unit²/Hz.
    #[must_use]
    pub fn part_of_density(&self, term: &FittedTerm, frequency: f64) -> f64 {
        let density = term.value * term.value * term.kind.process().density(frequency, self.sample_period);
        match self.filter() {
            Some(filter) if term.kind.passes_filter() => density * filter.gain(frequency, self.sample_period),
            _ => density,
        }
    }

    /// Fractions of the modelled variance at averaging factor `n` that are due to each power law or to a term that
    /// resembles it there.
    #[must_use]
    pub fn variance_fractions(&self, n: u64) -> VarianceFractions {
        let total = self.avar(n);
        if total <= 0.0 {
            return VarianceFractions::WHITE;
        }
        variance_fractions::<AllTerms>(
            self.contributions(n).map(|(kind, avar)| (kind, avar / total)),
            n,
            self.sample_period,
        )
    }

    /// Equivalent degrees of freedom of a measured point if the model is correct, at most 10¹⁸ (Greenhall and Riley; see
    /// [`confidence`](crate::confidence)).
    #[must_use]
    pub fn edf(&self, point: &AllanPoint) -> f64 {
        let avar = self.avar(point.n);
        let parts: Vec<(NoiseTerm, f64), MAX_TERMS> =
            self.contributions(point.n).map(|(kind, part)| (kind, part / avar)).collect();
        degrees_of_freedom::<AllTerms>(&parts, point, self.sample_period, &FlickerCorrelations::EMPTY).0
    }

    /// Returns the model in another unit: every coefficient is multiplied by `lsb`, units per count.
    #[must_use]
    pub fn scaled(mut self, lsb: f64) -> Self {
        for term in &mut self.terms {
            term.value *= lsb;
            term.low *= lsb;
            term.high *= lsb;
        }
        self
    }

    /// The terms with a positive coefficient.
    fn present(&self) -> impl Iterator<Item = &FittedTerm> {
        self.terms.iter().filter(|term| term.value > 0.0)
    }

    /// Each present term with its Allan variance at averaging factor `n`.
    fn contributions(&self, n: u64) -> impl Iterator<Item = (NoiseTerm, f64)> + '_ {
        let filter = self.filter();
        self.present().map(move |term| {
            (term.kind, term.value * term.value * term.kind.avar_behind(filter.as_ref(), n, self.sample_period))
        })
    }
}

pub(crate) fn filter_of<'a>(kinds: impl IntoIterator<Item = &'a NoiseTerm>) -> Option<MovingAverageFilter> {
    kinds.into_iter().find_map(|kind| match kind {
        NoiseTerm::Filtered(filter) => Some(*filter),
        _ => None,
    })
}

/// Sum of the variance fractions that the terms, each with its fraction, resemble at averaging factor `n`.
pub(crate) fn variance_fractions<T: TermSet>(
    parts: impl Iterator<Item = (NoiseTerm, f64)>,
    n: u64,
    sample_period: f64,
) -> VarianceFractions {
    let mut sums = [T::Real::ZERO; 4];
    for (kind, part) in parts {
        let VarianceFractions { white, flicker, random_walk, quantization } = T::share(&kind, part, n, sample_period);
        for (sum, share) in sums.iter_mut().zip([white, flicker, random_walk, quantization]) {
            *sum += T::Real::constant(share);
        }
    }
    let [white, flicker, random_walk, quantization] = sums.map(T::Real::double);
    VarianceFractions { white, flicker, random_walk, quantization }
}

/// Distance of a model `m` from a measured curve `v` over the octaves with `n ≤ M/8` of `M` samples.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Discrepancy {
    /// `mean edf·(ln(m/v) + v/m − 1)`: about 1 for a correct model on the data to which it was fitted.
    pub deviance_per_point: f64,
    /// `100·sqrt(mean (½ ln(v/m))²)`: the rms error of the Allan deviation in percent.
    pub rms_percent: f64,
    /// The largest deviation over *all* octaves in standard deviations, positive where the measured variance exceeds
    /// the model. The cube root of `v/m` is compared with its mean and variance (Wilson and Hilferty; Abramowitz and
    /// Stegun, 26.4.14).
    pub worst_sigma: f64,
    /// Averaging time of that point, s.
    pub worst_tau: f64,
    /// Modelled over measured Allan variance of that point.
    pub worst_ratio: f64,
    /// Number of octaves that were compared.
    pub points: usize,
}

impl Discrepancy {
    /// Compares `model` with `curve`; `None` if the curve has no octave in range.
    ///
    /// The degrees of freedom are those of the model; a variance of 0 makes the result infinite.
    #[must_use]
    pub fn between<'a>(model: &Model, curve: impl Into<CurveView<'a>>) -> Option<Self> {
        let curve = curve.into();
        let (mut deviance, mut square, mut points) = (0.0, 0.0, 0);
        let (mut worst_sigma, mut worst_tau, mut worst_ratio) = (0.0_f64, 0.0, 1.0);
        for point in curve.points() {
            let (ratio, edf) = (point.avar / model.avar(point.n), model.edf(point));
            let sigma = cube_root_deviation(ratio, edf);
            if abs(sigma) > abs(worst_sigma) {
                (worst_sigma, worst_tau, worst_ratio) = (sigma, point.tau, 1.0 / ratio);
            }
            if point.n > curve.samples() / 8 {
                continue;
            }
            let log = ln(ratio);
            deviance += edf * (ratio - 1.0 - log);
            square += log * log / 4.0;
            points += 1;
        }
        (points > 0).then(|| Self {
            deviance_per_point: deviance / points as f64,
            rms_percent: 100.0 * sqrt(square / points as f64),
            worst_sigma,
            worst_tau,
            worst_ratio,
            points,
        })
    }
}

/// Deviation of a χ² `ratio` over its `edf` degrees of freedom in normal standard deviations (Wilson and Hilferty;
/// Abramowitz and Stegun, 26.4.14).
#[must_use]
pub fn cube_root_deviation(ratio: f64, edf: f64) -> f64 {
    let variance = 2.0 / (9.0 * edf);
    (exp(ln(ratio) / 3.0) - (1.0 - variance)) / sqrt(variance)
}

/// Largest number of differences per averaging time whose correlations are computed.
const MAX_OVERLAP: u32 = 8;
/// Largest number of lags: 0 to four averaging times.
const MAX_LAGS: usize = 4 * MAX_OVERLAP as usize + 1;

/// Equivalent degrees of freedom of a point under a mixture of terms, each with its fraction of the variance, with and
/// without narrow-band correlations beyond two averaging times.
///
/// Sums over the covariances of the second differences, as in Greenhall and Riley (see [`confidence`]); a sinusoid adds
/// scatter by its phase. 10¹⁸ if the mixture has no random term.
///
/// [`confidence`]: crate::confidence
#[inline(never)] // its stack frame would otherwise be part of every caller's
pub(crate) fn degrees_of_freedom<T: TermSet>(
    parts: &[(NoiseTerm, T::Real)],
    point: &AllanPoint,
    sample_period: f64,
    flicker: &FlickerCorrelations,
) -> (T::Real, T::Real) {
    let overlap = point.overlap.min(MAX_OVERLAP);
    let [one, two] = [1.0, 2.0].map(T::Real::from_single);
    let whole = |number: u32| T::Real::from_word(number.into());
    let count = T::Real::from_word(point.count) * whole(overlap) / whole(point.overlap);
    let reach = |times: u32| (u64::from(times * overlap).min(point.count.saturating_sub(1))) as usize + 1;
    let (mut noise, mut deterministic) = ([0.0_f32; MAX_LAGS], [0.0_f32; MAX_LAGS]);
    let (mut far, mut by_phase) = (T::Real::ZERO, T::Real::ZERO);
    for (kind, share) in parts {
        let sums = match kind {
            NoiseTerm::BiasInstability => &mut noise[..reach(4)],
            kind if kind.is_deterministic() => &mut deterministic[..reach(4)],
            // Correlations beyond two averaging times are 0 or part of `far`.
            _ => &mut noise[..reach(2)],
        };
        match kind {
            NoiseTerm::BiasInstability => flicker.add::<T>(share.single(), overlap, sums),
            kind => add_correlations::<T>(kind, share.single(), point.n, overlap, sample_period, sums),
        }
        let stride = T::Real::from_word(point.n) / whole(overlap);
        far += two * *share * *share * T::squared_covariance_tail(kind, point.n, stride, sample_period);
        let stride = point.n as f64 / f64::from(point.overlap);
        by_phase += *share * *share * T::phase_variance(kind, point.count, stride, sample_period);
    }
    let pairs =
        noise.iter().zip(&deterministic).map(|(noise, fixed)| T::Real::from_single(noise * (noise + 2.0 * fixed)));
    let weight = |lag: usize| if lag == 0 { one } else { two * (one - T::Real::from_word(lag as u64) / count) };
    let weighted = |(lag, pair): (usize, T::Real)| if pair == T::Real::ZERO { pair } else { weight(lag) * pair };
    // The relative variance of a mean square is twice the sum of the pairs over their number.
    let near = pairs.enumerate().map(weighted).sum::<T::Real>() + by_phase * count / two;
    let factor = subtraction_factor(T::Real::constant(point.avar), T::Real::constant(point.interpolation));
    let least = if count < one { count } else { one };
    let edf = |pairs: T::Real| clamp(factor * count / pairs, least, T::Real::constant(1e18));
    (edf(near + far), edf(near))
}

/// Correlations of second differences of flicker noise, the same for all points at a lag in averaging times.
pub(crate) struct FlickerCorrelations {
    /// Number of strides per averaging time; 0 if the table is empty.
    overlap: u32,
    table: [f32; MAX_LAGS],
}

impl FlickerCorrelations {
    pub(crate) const EMPTY: Self = Self { overlap: 0, table: [0.0; MAX_LAGS] };

    /// Computes the correlations for points of this overlap and of those that divide it.
    pub(crate) fn fill<T: TermSet>(&mut self, overlap: u32) {
        let overlap = overlap.min(MAX_OVERLAP);
        (self.overlap, self.table) = (overlap, [0.0; MAX_LAGS]);
        add_flicker_correlations::<T>(1.0, overlap, &mut self.table);
    }

    fn add<T: TermSet>(&self, share: f32, overlap: u32, sums: &mut [f32]) {
        let per_lag = if self.overlap.is_multiple_of(overlap) { (self.overlap / overlap) as usize } else { 0 };
        if per_lag == 0 || (sums.len() - 1) * per_lag >= MAX_LAGS {
            return add_flicker_correlations::<T>(share, overlap, sums);
        }
        for (sum, known) in sums.iter_mut().zip(self.table.iter().step_by(per_lag)) {
            *sum += share * known;
        }
    }
}

/// [`add_correlations`] for flicker noise, whose correlations do not depend on the averaging factor.
fn add_flicker_correlations<T: TermSet>(share: f32, overlap: u32, sums: &mut [f32]) {
    add_correlations::<T>(&NoiseTerm::BiasInstability, share, u64::from(overlap), overlap, 1.0, sums);
}

/// Adds `share` times the correlations of second differences at lags of 0, 1, 2 … strides of `n/overlap` samples to
/// `sums`, up to [`MAX_LAGS`] and [`MAX_OVERLAP`].
#[inline(never)] // its stack frame would otherwise be part of every caller's
fn add_correlations<T: TermSet>(
    kind: &NoiseTerm,
    share: f32,
    n: u64,
    overlap: u32,
    sample_period: f64,
    sums: &mut [f32],
) {
    let width = overlap as usize;
    let mut table = [T::Real::ZERO; MAX_LAGS + 2 * MAX_OVERLAP as usize];
    let Some(v) = table.get_mut(..sums.len() + 2 * width) else { return };
    T::sum_variances(kind, n, overlap, sample_period, v);
    let [four, six] = [4.0, 6.0].map(T::Real::from_single);
    // The covariances are these fourth differences times `−1/(4n²)`.
    let fourth = |lag: usize| {
        six * v[lag] - four * (v[lag.abs_diff(width)] + v[lag + width])
            + v[lag.abs_diff(2 * width)]
            + v[lag + 2 * width]
    };
    let whole = fourth(0);
    if whole < T::Real::ZERO {
        for (lag, sum) in sums.iter_mut().enumerate() {
            *sum += share * clamp((fourth(lag) / whole).single(), -1.0, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sin;
    use crate::simulation::{PERIOD, autocovariance, stationary};
    use crate::term::Sinusoid;
    use crate::{Cascade, Curve};
    use std::vec::Vec;

    /// The scatter over 64 phases, of 15,000 samples each, is `2/edf` of the squared variance.
    #[test]
    fn the_phase_of_a_sinusoid_scatters_its_variance() {
        const PHASES: usize = 64;
        let period = 0.01;
        let mut shown = 0;
        for frequency in [0.31, 0.7, 1.9] {
            let curves: Vec<Curve<12>> = (0..PHASES)
                .map(|phase| {
                    let mut cascade = Cascade::<12, 4>::new();
                    for at in 0..15_000 {
                        let turns = frequency * period * f64::from(at) + phase as f64 / PHASES as f64;
                        cascade.push((1e6 * sin(2.0 * core::f64::consts::PI * turns)) as i32);
                    }
                    cascade.curve(period)
                })
                .collect();
            let kind = NoiseTerm::Sinusoid(Sinusoid { frequency });
            let model = Model::new(period, [FittedTerm::exact(kind, 1e6)]);
            for (at, point) in curves[0].points().iter().enumerate() {
                let expected = model.avar(point.n);
                let square = |curve: &Curve<12>| (curve.points()[at].avar / expected - 1.0).powi(2);
                let scatter = curves.iter().map(square).sum::<f64>() / PHASES as f64;
                let modelled = 2.0 / model.edf(point);
                // The mean over the phases is exact. A scatter below 10⁻⁸ is the rounding of the samples.
                assert!((modelled / scatter - 1.0).abs() < 0.02 || scatter < 1e-8, "{}: {modelled} {scatter}", point.n);
                shown += usize::from(scatter > 1e-4);
            }
        }
        assert!(shown >= 2, "{shown}");
    }

    #[test]
    fn second_differences_correlate_as_the_autocovariance_says() {
        for kind in stationary() {
            let n = 6_usize;
            // The second difference of averages is a filter of 2n weights. The lags are on both sides of 2n.
            let weights: Vec<f64> = (0..2 * n).map(|i| if i < n { 1.0 } else { -1.0 } / n as f64).collect();
            let mut correlations = [0.0; 31];
            add_correlations::<AllTerms>(&kind, 1.0, n as u64, n as u32, PERIOD, &mut correlations);
            for lag in [0_usize, 1, 5, 6, 11, 12, 13, 30] {
                let mut covariance = 0.0;
                for (i, a) in weights.iter().enumerate() {
                    for (j, b) in weights.iter().enumerate() {
                        covariance += a * b * autocovariance(&kind, (lag + i).abs_diff(j)) / 2.0;
                    }
                }
                let found = f64::from(correlations[lag]) * kind.avar(n as u64, PERIOD);
                let tolerance = 1e-6 * kind.avar(n as u64, PERIOD);
                assert!((found - covariance).abs() < tolerance, "{kind:?}, lag {lag}: {found} and {covariance}");
            }
        }
    }
}
