//! Regression of a channel on covariates (temperature, supply, acceleration), from Allan variances and covariances over
//! all octaves.
//!
//! The second differences are `d(y) = Σ βᵢ·d(cᵢ) + d(e)`; an octave weighs its degrees of freedom over the variance of
//! the residual `e`. Quantization and white noise of a covariate, which would bias `β` towards 0, are subtracted first.
//! The significance of a sensitivity is by Student's distribution.

mod uncertainty;

pub use uncertainty::Sensitivity;

use crate::coupling::Covariance;
use crate::curve::{AllanPoint, Curve};
use crate::fit::least_squares::{entry, solve, triangle};
use crate::fit::{FreeShapes, estimate, fit};
use crate::list::List;
use crate::math::sqrt;
use crate::model::Model;
use crate::term::{AllTerms, NoiseTerm};
use heapless::Vec;
use uncertainty::{OctaveWeight, edf, is_poor, sum_variance};

/// Largest number of covariates of one regression.
pub const MAX_COVARIATES: usize = 6;
/// Degrees of freedom below which no sensitivity is estimated.
const LEAST_EDF: f64 = 2.0;
/// Significance, in normal standard deviations, from which a sensitivity is accepted (by chance: 2 of 10,000 pairs).
const SIGNIFICANT: f64 = 4.5;

/// Allan covariances of two channels, by averaging factor, in the product of their units.
pub type CovarianceCurve<const POINTS: usize> = List<Covariance, POINTS>;

/// Ratio of noise to variance of a covariate above which an octave is not used.
const NOISE_FRACTION: f64 = 0.5;

/// First Allan variance, in LSB², above which the noise of a covariate dithers its rounding to counts.
const DITHERED: f64 = 0.2;

/// The terms of a covariate's measurement noise.
const NOISE: [NoiseTerm; 2] = [NoiseTerm::Quantization, NoiseTerm::AngleRandomWalk];

/// A quantity on which a channel may depend: its Allan variance at up to `POINTS` averaging factors, and its
/// measurement noise.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Covariate<const POINTS: usize> {
    sample_period: f64,
    noise: [f64; NOISE.len()],
    /// Variance of the rounding to counts if the noise is too small to dither it, else 0; in the square of the unit.
    rounding: f64,
    points: Vec<(u64, f64), POINTS>,
}

impl<const POINTS: usize> Covariate<POINTS> {
    /// A covariate with this curve, of which one count is `lsb` in its unit; its measurement noise is estimated.
    ///
    /// Averaging factors below `from` and beyond the first `POINTS` are not used.
    #[must_use]
    #[inline(never)] // its stack frame would otherwise be part of every caller's
    pub fn new<const MEASURED: usize>(curve: &Curve<MEASURED>, lsb: f64, from: u64) -> Self {
        let [quantization, white] = NOISE;
        let model = fit(
            curve,
            &[quantization, white, NoiseTerm::BiasInstability, NoiseTerm::RateRandomWalk, NoiseTerm::RateRamp],
        );
        let mut noise = [0.0; NOISE.len()];
        noise.iter_mut().zip(model.terms()).for_each(|(noise, term)| *noise = term.value);
        let dithered = curve.points().first().is_some_and(|point| point.avar > DITHERED * lsb * lsb);
        Self { noise, rounding: if dithered { 0.0 } else { lsb * lsb / 12.0 }, ..Self::as_measured(curve, from) }
    }

    /// A covariate that is taken as measured: its noise counts as part of it.
    #[must_use]
    pub fn as_measured<const MEASURED: usize>(curve: &Curve<MEASURED>, from: u64) -> Self {
        let points = curve.points().iter().filter(|point| point.n >= from);
        Self {
            sample_period: curve.sample_period(),
            noise: [0.0; NOISE.len()],
            rounding: 0.0,
            points: points.map(|point| (point.n, point.avar)).take(POINTS).collect(),
        }
    }

    /// Returns the covariate for another stretch of time, with the measurement noise of this one.
    #[must_use]
    pub fn continued<const MEASURED: usize>(&self, curve: &Curve<MEASURED>, from: u64) -> Self {
        Self { noise: self.noise, rounding: self.rounding, ..Self::as_measured(curve, from) }
    }

    fn avar(&self, n: u64) -> Option<f64> {
        self.points.iter().find(|point| point.0 == n).map(|&(_, avar)| avar)
    }

    /// Allan variance without the measurement noise, and as measured; `None` where too much of it is noise.
    fn signal(&self, n: u64) -> Option<(f64, f64)> {
        let measured = self.avar(n)?;
        let avar = |(kind, value): (&NoiseTerm, f64)| value * value * kind.avar(n, self.sample_period);
        let noise: f64 = NOISE.iter().zip(self.noise).map(avar).sum();
        let is_usable = measured > 0.0 && noise < NOISE_FRACTION * measured && measured > 4.0 * self.rounding;
        is_usable.then_some((measured - noise, measured))
    }
}

type Sensitivities = List<Sensitivity, MAX_COVARIATES>;

/// A channel, the covariates on which it may depend, and their Allan covariances at up to `COUPLED` octaves.
pub struct CovariateRegression<'a, const POINTS: usize, const COUPLED: usize = POINTS> {
    /// Curve of the channel, in its unit.
    pub channel: &'a Curve<POINTS>,
    /// The covariates, at most [`MAX_COVARIATES`].
    pub covariates: &'a [Covariate<COUPLED>],
    /// The Allan covariance of the channel (first argument `None`) or of a covariate with the covariate of the second
    /// argument; `None` if not known.
    pub covariance: &'a dyn Fn(Option<usize>, usize, u64) -> Option<f64>,
}

impl<const POINTS: usize, const COUPLED: usize> CovariateRegression<'_, POINTS, COUPLED> {
    /// The significant sensitivities of the channel, by forward selection: in the order of their significance when chosen,
    /// which is at least 4.5 normal standard deviations.
    ///
    /// # Cost
    /// | `CovariateRegression::sensitivities` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 50 million | — |
    /// | stack, bytes | 11,600 | — |
    /// | flash, bytes | 37,700 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    #[must_use]
    pub fn sensitivities(&self) -> List<Sensitivity, MAX_COVARIATES> {
        self.sensitivities_while(&mut || true).unwrap_or_default()
    }

    /// [`sensitivities`](Self::sensitivities) that calls `keep_on` before every fit; `None` if it returned false.
    #[must_use]
    #[inline(never)] // here and below: so that stack frames do not add up in the caller
    pub fn sensitivities_while(&self, keep_on: &mut dyn FnMut() -> bool) -> Option<List<Sensitivity, MAX_COVARIATES>> {
        let mut accepted = Sensitivities::new();
        let (mut octaves, mut reweighted) = (Vec::new(), Vec::new());
        while accepted.len() < self.covariates.len() {
            self.set_weights(&accepted, &mut octaves);
            let mut best = Sensitivities::new();
            let significance = |tried: &Sensitivities| tried.last().map_or(0.0, Sensitivity::sigmas);
            for next in (0..self.covariates.len()).filter(|i| accepted.iter().all(|known| known.covariate != *i)) {
                if !keep_on() {
                    return None;
                }
                let chosen: Vec<usize, MAX_COVARIATES> =
                    accepted.iter().map(|known| known.covariate).chain(core::iter::once(next)).collect();
                // The residual without these covariates is smaller: estimate again with its weights.
                let tried = self.estimate_for(&chosen, &octaves).and_then(|first| {
                    self.set_weights(&first, &mut reweighted);
                    self.estimate_for(&chosen, &reweighted)
                });
                let tried = tried.unwrap_or_default();
                if significance(&tried).total_cmp(&significance(&best)).is_ge() {
                    best = tried;
                }
            }
            if significance(&best) < SIGNIFICANT {
                break;
            }
            accepted = best;
        }
        Some(accepted)
    }

    /// Sets the weights of the octaves from N, B and K fitted to the channel without its dependence on the covariates.
    #[inline(never)]
    fn set_weights(&self, sensitivities: &[Sensitivity], octaves: &mut Vec<OctaveWeight, COUPLED>) {
        let mut residual = Curve::empty();
        residual.copy_from(self.channel);
        self.subtract(&mut residual, sensitivities, |covariate, n| self.measured(covariate, n));
        let mut model = Model::new(0.0, []);
        estimate::<AllTerms>((&residual).into(), &NoiseTerm::BASELINE, FreeShapes::None, &mut || true, &mut model);
        let is_known = |point: &&AllanPoint| self.covariates.iter().any(|covariate| covariate.avar(point.n).is_some());
        octaves.clear();
        let is_poor = is_poor(&model, residual.points());
        let known =
            residual.points().iter().filter(is_known).filter_map(|point| OctaveWeight::new(point, &model, is_poor));
        octaves.extend(known.take(COUPLED));
    }

    /// Sensitivities to the covariates in `chosen`; `None` if they vary too little or are too similar.
    #[inline(never)]
    fn estimate_for(&self, chosen: &[usize], octaves: &[OctaveWeight]) -> Option<Sensitivities> {
        let mut normal = [0.0; triangle(MAX_COVARIATES)];
        let mut value = [0.0; MAX_COVARIATES];
        for octave in octaves {
            for (i, &covariate) in chosen.iter().enumerate() {
                if self.covariates[covariate].signal(octave.n).is_some() {
                    value[i] += octave.weight * self.with_channel(covariate, octave.n);
                }
                for (j, &other) in chosen[..=i].iter().enumerate() {
                    normal[entry(i, j)] += octave.weight * self.shared(covariate, other, octave.n);
                }
            }
        }
        let all = (1 << chosen.len()) - 1;
        solve(&mut normal.clone(), &mut value, all)?;
        let scatter = self.scatter(chosen, octaves);
        let sensitivity = |(i, &covariate): (usize, &usize)| {
            let mut row = [0.0; MAX_COVARIATES];
            row[i] = 1.0;
            solve(&mut normal.clone(), &mut row, all)?;
            let along = |(entry, scatter): (f64, [f64; MAX_COVARIATES])| {
                entry * row.iter().zip(scatter).map(|(a, b)| a * b).sum::<f64>()
            };
            let error = sqrt(row.into_iter().zip(scatter).map(along).sum());
            let edf = edf(octaves, |n| self.measured(covariate, n));
            let left = edf - chosen.len() as f64;
            (left >= LEAST_EDF).then(|| Sensitivity::new(covariate, value[i], error * sqrt(edf / left), left))
        };
        chosen.iter().enumerate().map(sensitivity).collect()
    }

    /// Covariance matrix of the right side of the normal equations.
    #[inline(never)]
    fn scatter(&self, chosen: &[usize], octaves: &[OctaveWeight]) -> [[f64; MAX_COVARIATES]; MAX_COVARIATES] {
        let mut matrix = [[0.0; MAX_COVARIATES]; MAX_COVARIATES];
        for (i, &a) in chosen.iter().enumerate() {
            for (j, &b) in chosen[..=i].iter().enumerate() {
                let common = |n: u64| if i == j { self.measured(a, n) } else { self.shared(a, b, n) };
                matrix[i][j] = sum_variance::<COUPLED>(octaves, common);
                matrix[j][i] = matrix[i][j];
            }
        }
        matrix
    }

    /// The channel's curve without its dependence on the covariates, free of measurement noise.
    #[must_use]
    pub fn compensated(&self, sensitivities: &[Sensitivity]) -> Curve<POINTS> {
        let mut curve = self.channel.clone();
        self.subtract(&mut curve, sensitivities, |covariate, n| self.shared(covariate, covariate, n));
        curve
    }

    /// Subtracts the dependence on covariates with these variances from the channel's `curve`.
    fn subtract(&self, curve: &mut Curve<POINTS>, sensitivities: &[Sensitivity], variance: impl Fn(usize, u64) -> f64) {
        curve.set_variances(|point| {
            let change = |a: &Sensitivity| {
                let with_channel = self.with_channel(a.covariate, point.n);
                // If the covariate's own variance is not usable, `β·cov(y, c)` stands for `β²·σ²(c)`.
                if self.covariates[a.covariate].signal(point.n).is_none() {
                    return -a.value * with_channel;
                }
                let others = sensitivities.iter().filter(|b| b.covariate < a.covariate);
                let products = others.map(|b| 2.0 * b.value * self.shared(a.covariate, b.covariate, point.n));
                a.value * (a.value * variance(a.covariate, point.n) - 2.0 * with_channel + products.sum::<f64>())
            };
            // The estimate can be negative where almost nothing remains.
            let least = 0.01 * point.avar;
            (point.avar + sensitivities.iter().map(change).sum::<f64>()).max(least)
        });
    }

    /// Makes `curve`, a copy of the channel's, that of `y − Σ βᵢ·cᵢ` with the covariates as measured, where all
    /// covariances are known.
    pub fn subtract_from(&self, curve: &mut Curve<POINTS>, sensitivities: &[Sensitivity]) {
        curve.set_variances(|point| self.subtracted_at(point, sensitivities).unwrap_or(point.avar));
    }

    /// The Allan variance of `y − Σ βᵢ·cᵢ` at one point; `None` if a covariance is not known.
    #[must_use]
    pub fn subtracted_at(&self, point: &AllanPoint, sensitivities: &[Sensitivity]) -> Option<f64> {
        let mut avar = point.avar;
        for (i, a) in sensitivities.iter().enumerate() {
            let own = self.covariates[a.covariate].avar(point.n)?;
            avar += a.value * (a.value * own - 2.0 * (self.covariance)(None, a.covariate, point.n)?);
            for b in &sensitivities[..i] {
                avar += 2.0 * a.value * b.value * (self.covariance)(Some(b.covariate), a.covariate, point.n)?;
            }
        }
        Some(avar.max(0.0))
    }

    /// Allan covariance of the channel with a covariate; 0 if it is not known.
    fn with_channel(&self, covariate: usize, n: u64) -> f64 {
        (self.covariance)(None, covariate, n).unwrap_or_default()
    }

    /// Allan variance of a covariate as measured; 0 at an octave that is not usable.
    fn measured(&self, covariate: usize, n: u64) -> f64 {
        self.covariates[covariate].signal(n).map_or(0.0, |(_, measured)| measured)
    }

    /// Allan covariance of two covariates, without measurement noise; 0 at an octave that is not usable for both.
    fn shared(&self, a: usize, b: usize, n: u64) -> f64 {
        let signal = |covariate: usize| self.covariates[covariate].signal(n);
        match (signal(a), signal(b)) {
            (Some((signal, _)), Some(_)) if a == b => signal,
            (Some(_), Some(_)) => (self.covariance)(Some(b), a, n).unwrap_or_default(),
            _ => 0.0,
        }
    }
}
