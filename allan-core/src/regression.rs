//! How much of a channel follows other channels: regression at every octave at once, from curves and couplings alone.
//!
//! In the differences of an octave a channel is `d(y) = Σ βᵢ·d(cᵢ) + d(e)`. Each octave is worth its degrees of
//! freedom over the variance of the rest `e`, which is the fitted model's. A covariate that is measured with noise of
//! its own would make `β` too small; what its curve shows as white is taken off first. Slow channels have few degrees
//! of freedom, and a chance likeness of two random walks goes far: a sensitivity is judged by Student's distribution.

mod sensitivity;

pub use sensitivity::Sensitivity;

use crate::confidence::{Shares, octave_correlation};
use crate::coupling::Covariance;
use crate::fit::{
    fit,
    least_squares::{Matrix, Vector, inverse, solve},
};
use crate::math::sqrt;
use crate::{Curve, Kind, Model, Point};
use heapless::Vec;

/// Covariates that can be taken at once.
pub const MAX_COVARIATES: usize = 8;
/// A share of a covariate's variance that is its own noise above which an octave says nothing about the sensitivity.
const NOISE_SHARE: f64 = 0.5;
/// Degrees of freedom below which nothing is said.
const LEAST_FREEDOM: f64 = 2.0;
/// Standard deviations of a normal distribution from which on a sensitivity is believed. Smooth covariates pass it by
/// chance in some 2 of 10,000 pairs, more often than the normal distribution says.
const DOUBT: f64 = 4.5;

/// A measured quantity that a channel may follow.
#[derive(Debug, Clone, PartialEq)]
pub struct Covariate<const POINTS: usize> {
    curve: Curve<POINTS>,
    noise: Model,
    /// Variance of one step of its converter where no noise dithers it; 0 where it does.
    step: f64,
}

impl<const POINTS: usize> Covariate<POINTS> {
    /// A covariate with its curve in a physical unit, in which its converter has steps of `lsb`.
    #[must_use]
    pub fn new(curve: Curve<POINTS>, lsb: f64) -> Self {
        let noise = fit(
            &curve,
            &[Kind::Quantization, Kind::AngleRandomWalk, Kind::BiasInstability, Kind::RateRandomWalk, Kind::RateRamp],
        );
        let white =
            noise.terms().iter().copied().filter(|t| matches!(t.kind, Kind::Quantization | Kind::AngleRandomWalk));
        let noise = Model::new(curve.sample_period(), white);
        let dithered = curve.points().first().is_some_and(|point| point.avar > 0.2 * lsb * lsb);
        Self { curve, noise, step: if dithered { 0.0 } else { lsb * lsb / 12.0 } }
    }

    /// A covariate that is to be subtracted as it is measured, noise and all.
    #[must_use]
    pub fn as_measured(curve: Curve<POINTS>) -> Self {
        let noise = Model::new(curve.sample_period(), core::iter::empty());
        Self { curve, noise, step: 0.0 }
    }

    /// Another stretch of the same covariate, whose noise is known from this one.
    #[must_use]
    pub fn continued(&self, curve: Curve<POINTS>) -> Self {
        Self { curve, noise: self.noise.clone(), step: self.step }
    }

    /// The same from averaging factor `n` on, as far as there is room.
    #[must_use]
    pub fn from_factor<const ROOM: usize>(self, n: u64) -> Covariate<ROOM> {
        Covariate { curve: self.curve.from_factor(n), noise: self.noise, step: self.step }
    }

    /// Allan variance of what was really there to be followed, and of all that was measured.
    fn signal(&self, n: u64) -> Option<(f64, f64)> {
        let measured = self.curve.points().iter().find(|point| point.n == n)?.avar;
        let noise = self.noise.avar(n);
        let told = measured > 0.0 && noise < NOISE_SHARE * measured && measured > 4.0 * self.step;
        told.then_some((measured - noise, measured))
    }
}

/// The coupling of two channels in the product of their physical units.
pub type Shared<const POINTS: usize> = Vec<Covariance, POINTS>;

/// A channel, the covariates that it may follow, and what they share, at `COUPLED` octaves or fewer.
#[derive(Debug)]
pub struct Beside<'a, const POINTS: usize, const COUPLED: usize = POINTS> {
    /// The channel.
    pub channel: &'a Curve<POINTS>,
    /// At most [`MAX_COVARIATES`].
    pub covariates: &'a [Covariate<COUPLED>],
    /// The channel with each covariate.
    pub with_channel: &'a [Shared<COUPLED>],
    /// The covariates with each other: `i` with `j < i` at `i·(i−1)/2 + j`.
    pub mutual: &'a [Shared<COUPLED>],
}

impl<const POINTS: usize, const COUPLED: usize> Beside<'_, POINTS, COUPLED> {
    /// The covariates that the channel follows beyond doubt, the clearest chosen first.
    #[must_use]
    pub fn followed(&self) -> Vec<Sensitivity, MAX_COVARIATES> {
        self.followed_while(&mut || true).unwrap_or_default()
    }

    /// The same, asking before every fit whether to keep on; `None` if the answer was no.
    #[must_use]
    pub fn followed_while(&self, keep_on: &mut dyn FnMut() -> bool) -> Option<Vec<Sensitivity, MAX_COVARIATES>> {
        let mut followed: Vec<Sensitivity, MAX_COVARIATES> = Vec::new();
        while followed.len() < self.covariates.len() {
            let rest = self.rest(&followed);
            let mut best: Vec<Sensitivity, MAX_COVARIATES> = Vec::new();
            let clarity = |tried: &Vec<Sensitivity, MAX_COVARIATES>| tried.last().map_or(0.0, Sensitivity::sigmas);
            for next in (0..self.covariates.len()).filter(|i| followed.iter().all(|known| known.covariate != *i)) {
                if !keep_on() {
                    return None;
                }
                let chosen: Vec<usize, MAX_COVARIATES> =
                    followed.iter().map(|known| known.covariate).chain(core::iter::once(next)).collect();
                // What is left is smaller when it is subtracted: weigh the octaves by that.
                let tried = self
                    .sensitivities(&chosen, &rest)
                    .and_then(|first| self.sensitivities(&chosen, &self.rest(&first)))
                    .unwrap_or_default();
                if clarity(&tried).total_cmp(&clarity(&best)).is_ge() {
                    best = tried;
                }
            }
            if clarity(&best) < DOUBT {
                break;
            }
            followed = best;
        }
        Some(followed)
    }

    /// What the channel would be without the covariates, as far as N, B and K describe it.
    fn rest(&self, followed: &[Sensitivity]) -> Rest<POINTS> {
        let curve = self
            .less(followed, |covariate, n| self.covariates[covariate].signal(n).map_or(0.0, |(_, measured)| measured));
        Rest { model: fit(&curve, &Kind::DECLARED), curve }
    }

    /// Sensitivities to the covariates in `chosen`.
    ///
    /// `None` where the covariates move too little, or too much alike.
    fn sensitivities(&self, chosen: &[usize], rest: &Rest<POINTS>) -> Option<Vec<Sensitivity, MAX_COVARIATES>> {
        let count = chosen.len().min(MAX_COVARIATES);
        let mut normal: Matrix<MAX_COVARIATES> = [[0.0; MAX_COVARIATES]; MAX_COVARIATES];
        let mut right: Vector<MAX_COVARIATES> = [0.0; MAX_COVARIATES];
        let mut told: Vec<Told, COUPLED> = Vec::new();
        for point in rest.curve.points() {
            let Some(octave) = self.told(point, chosen, &rest.model) else { continue };
            for (i, row) in normal.iter_mut().enumerate().take(count) {
                right[i] += octave.weight * octave.with_channel[i];
                for (entry, signal) in row.iter_mut().zip(octave.signal[i]) {
                    *entry += octave.weight * signal;
                }
            }
            // As many as the covariates have points.
            let _ = told.push(octave);
        }
        let value = solve(&normal, &right, (1 << count) - 1)?;
        let inverse = inverse(&normal, count)?;
        let scatter = scatter(&told, count);
        let error = |i: usize| {
            let row = &inverse[i];
            let along = |j: usize| (0..count).map(|k| row[k] * scatter[j][k]).sum::<f64>();
            sqrt((0..count).map(|j| row[j] * along(j)).sum())
        };
        let sensitivity = |i: usize| {
            let freedom = freedom(&told, i);
            let left = freedom - count as f64;
            (left >= LEAST_FREEDOM)
                .then(|| Sensitivity::new(chosen[i], value[i], error(i) * sqrt(freedom / left), left))
        };
        (0..count).map(sensitivity).collect()
    }

    /// The channel's curve less what follows the covariates.
    #[must_use]
    pub fn compensated(&self, sensitivities: &[Sensitivity]) -> Curve<POINTS> {
        self.less(sensitivities, |covariate, n| self.shared(covariate, covariate, n))
    }

    /// The channel's curve less covariates of such a variance.
    fn less(&self, sensitivities: &[Sensitivity], variance: impl Fn(usize, u64) -> f64) -> Curve<POINTS> {
        self.channel.clone().with_avar(|point| {
            let of = |a: &Sensitivity| {
                let others = sensitivities.iter().filter(|b| b.covariate < a.covariate);
                let products = others.map(|b| 2.0 * b.value * self.shared(a.covariate, b.covariate, point.n));
                let followed = covariance(&self.with_channel[a.covariate], point.n);
                a.value * (a.value * variance(a.covariate, point.n) - 2.0 * followed + products.sum::<f64>())
            };
            // An estimate of what is left can come out below 0 where almost nothing is.
            let least = 0.01 * point.avar;
            (point.avar + sensitivities.iter().map(of).sum::<f64>()).max(least)
        })
    }

    /// The channel's curve when the covariates, as they are measured, are subtracted from its samples.
    ///
    /// Exact where all the covariances are known, the noise that the covariates bring included; elsewhere it is that
    /// of the channel.
    #[must_use]
    pub fn subtracted(&self, sensitivities: &[Sensitivity]) -> Curve<POINTS> {
        self.channel.clone().with_avar(|point| self.subtracted_at(point, sensitivities).unwrap_or(point.avar))
    }

    fn subtracted_at(&self, point: &Point, sensitivities: &[Sensitivity]) -> Option<f64> {
        let known =
            |shared: &[Covariance]| shared.iter().find(|other| other.n == point.n).map(|other| other.covariance);
        let mut avar = point.avar;
        for (i, a) in sensitivities.iter().enumerate() {
            let own = self.covariates[a.covariate].curve.points().iter().find(|own| own.n == point.n)?.avar;
            avar += a.value * (a.value * own - 2.0 * known(&self.with_channel[a.covariate])?);
            for b in &sensitivities[..i] {
                avar += 2.0 * a.value * b.value * known(&self.mutual[pair(a.covariate, b.covariate)])?;
            }
        }
        Some(avar.max(0.0))
    }

    fn told(&self, point: &Point, chosen: &[usize], rest: &Model) -> Option<Told> {
        let is_told = |&covariate: &usize| self.covariates[covariate].signal(point.n).is_some();
        if !chosen.iter().any(is_told) {
            return None;
        }
        // What the model lacks is noise to the regression too.
        let variance = rest.avar(point.n).max(point.avar);
        if variance <= 0.0 {
            return None;
        }
        let edf = rest.edf(point);
        let mut octave = Told {
            edf,
            weight: edf / variance,
            shares: rest.shares(point.n),
            with_channel: [0.0; MAX_COVARIATES],
            signal: [[0.0; MAX_COVARIATES]; MAX_COVARIATES],
            measured: [0.0; MAX_COVARIATES],
        };
        for (i, &covariate) in chosen.iter().enumerate().take(MAX_COVARIATES) {
            let (_, measured) = self.covariates[covariate].signal(point.n).unwrap_or_default();
            octave.measured[i] = measured;
            if measured > 0.0 {
                octave.with_channel[i] = covariance(&self.with_channel[covariate], point.n);
            }
            for (j, &other) in chosen.iter().enumerate().take(MAX_COVARIATES) {
                octave.signal[i][j] = self.shared(covariate, other, point.n);
            }
        }
        Some(octave)
    }

    /// What two covariates have in common, noise taken off; 0 at an octave that says nothing of either.
    fn shared(&self, a: usize, b: usize, n: u64) -> f64 {
        let signal = |covariate: usize| self.covariates[covariate].signal(n);
        match (signal(a), signal(b)) {
            (Some((signal, _)), Some(_)) if a == b => signal,
            (Some(_), Some(_)) => covariance(&self.mutual[pair(a, b)], n),
            _ => 0.0,
        }
    }
}

/// A channel without what it follows: measured, and modelled.
struct Rest<const POINTS: usize> {
    curve: Curve<POINTS>,
    model: Model,
}

/// What one octave tells.
struct Told {
    edf: f64,
    /// Degrees of freedom over the variance of the rest.
    weight: f64,
    shares: Shares,
    with_channel: Vector<MAX_COVARIATES>,
    signal: Matrix<MAX_COVARIATES>,
    measured: Vector<MAX_COVARIATES>,
}

/// Covariance of the right side of the normal equations: octaves are not independent.
fn scatter(told: &[Told], count: usize) -> Matrix<MAX_COVARIATES> {
    let mut scatter = [[0.0; MAX_COVARIATES]; MAX_COVARIATES];
    for (k, a) in told.iter().enumerate() {
        for (l, b) in told.iter().enumerate() {
            let correlation = octave_correlation(k.abs_diff(l), a.shares, b.shares) * sqrt(a.weight * b.weight);
            for (i, row) in scatter.iter_mut().enumerate().take(count) {
                for (j, entry) in row.iter_mut().enumerate().take(count) {
                    let of = |octave: &Told| {
                        if i == j { octave.measured[i] } else { octave.signal[i][j] }
                    };
                    let sign = if of(a) * of(b) < 0.0 { -1.0 } else { 1.0 };
                    *entry += correlation * sign * sqrt(crate::math::abs(of(a) * of(b)));
                }
            }
        }
    }
    scatter
}

/// Where a pair of covariates stands among the mutual ones.
fn pair(a: usize, b: usize) -> usize {
    let (high, low) = (a.max(b), a.min(b));
    high * (high - 1) / 2 + low
}

/// Degrees of freedom of one sensitivity: of the octaves, each as it counts, less what they repeat of each other.
fn freedom(told: &[Told], covariate: usize) -> f64 {
    let counts = |octave: &Told| octave.weight * octave.measured[covariate];
    let (mut sum, mut square) = (0.0, 0.0);
    for (k, a) in told.iter().enumerate() {
        sum += counts(a);
        for (l, b) in told.iter().enumerate() {
            let correlation = octave_correlation(k.abs_diff(l), a.shares, b.shares);
            square += correlation * counts(a) * counts(b) / sqrt(a.edf * b.edf);
        }
    }
    if square > 0.0 { sum * sum / square } else { 0.0 }
}

fn covariance(shared: &[Covariance], n: u64) -> f64 {
    shared.iter().find(|covariance| covariance.n == n).map_or(0.0, |covariance| covariance.covariance)
}
