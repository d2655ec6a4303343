//! How much of a channel follows other channels: regression at every octave at once, from curves and couplings alone.
//!
//! In the differences of an octave a channel is `d(y) = Σ βᵢ·d(cᵢ) + d(e)`. Each octave is worth its degrees of
//! freedom over the variance of the rest `e`, which is the fitted model's. A covariate that is measured with noise of
//! its own would make `β` too small; what its curve shows as white is taken off first. Slow channels have few degrees
//! of freedom, and a chance likeness of two random walks goes far: a sensitivity is judged by Student's distribution.

mod covariate;
mod octave;
mod sensitivity;

pub use covariate::Covariate;
pub use sensitivity::Sensitivity;

use crate::coupling::Covariance;
use crate::fit::least_squares::{entry, solve, triangle};
use crate::fit::{Free, estimate};
use crate::math::sqrt;
use crate::{Curve, Kind, Model, Point};
use heapless::Vec;
use octave::{Octave, freedom, is_poor, scatter};

/// Covariates that can be taken at once.
pub const MAX_COVARIATES: usize = 6;
/// Degrees of freedom below which nothing is said.
const LEAST_FREEDOM: f64 = 2.0;
/// Standard deviations of a normal distribution from which on a sensitivity is believed. Smooth covariates pass it by
/// chance in some 2 of 10,000 pairs, more often than the normal distribution says.
const DOUBT: f64 = 4.5;

/// The coupling of two channels in the product of their physical units.
pub type Shared<const POINTS: usize> = Vec<Covariance, POINTS>;

/// Sensitivities to several covariates at once.
type Sensitivities = Vec<Sensitivity, MAX_COVARIATES>;

/// A channel, the covariates that it may follow, and what they share, at `COUPLED` octaves or fewer.
pub struct Beside<'a, const POINTS: usize, const COUPLED: usize = POINTS> {
    /// The channel.
    pub channel: &'a Curve<POINTS>,
    /// At most [`MAX_COVARIATES`].
    pub covariates: &'a [Covariate<COUPLED>],
    /// The covariance of the channel (`None`) or of another covariate with a covariate at an averaging factor, in the
    /// product of their units; `None` where it is not known.
    pub covariance: &'a dyn Fn(Option<usize>, usize, u64) -> Option<f64>,
}

impl<const POINTS: usize, const COUPLED: usize> Beside<'_, POINTS, COUPLED> {
    /// The covariates that the channel follows beyond doubt, the clearest chosen first.
    #[must_use]
    pub fn followed(&self) -> Vec<Sensitivity, MAX_COVARIATES> {
        self.followed_while(&mut || true).unwrap_or_default()
    }

    /// The same, asking before every fit whether to keep on; `None` if the answer was no.
    #[must_use]
    #[inline(never)] // here and below: so that stack frames do not add up
    pub fn followed_while(&self, keep_on: &mut dyn FnMut() -> bool) -> Option<Vec<Sensitivity, MAX_COVARIATES>> {
        let mut followed = Sensitivities::new();
        let (mut octaves, mut reweighed) = (Vec::new(), Vec::new());
        while followed.len() < self.covariates.len() {
            self.weigh(&followed, &mut octaves);
            let mut best = Sensitivities::new();
            let clarity = |tried: &Sensitivities| tried.last().map_or(0.0, Sensitivity::sigmas);
            for next in (0..self.covariates.len()).filter(|i| followed.iter().all(|known| known.covariate != *i)) {
                if !keep_on() {
                    return None;
                }
                let chosen: Vec<usize, MAX_COVARIATES> =
                    followed.iter().map(|known| known.covariate).chain(core::iter::once(next)).collect();
                // What is left is smaller when it is subtracted: weigh the octaves by that.
                let tried = self.sensitivities(&chosen, &octaves).and_then(|first| {
                    self.weigh(&first, &mut reweighed);
                    self.sensitivities(&chosen, &reweighed)
                });
                let tried = tried.unwrap_or_default();
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

    /// Finds what each octave that is known of a covariate is worth, as far as N, B and K describe the channel without
    /// what it follows.
    #[inline(never)]
    fn weigh(&self, followed: &[Sensitivity], octaves: &mut Vec<Octave, COUPLED>) {
        let mut rest = Curve::empty();
        rest.copy(self.channel);
        self.subtract(&mut rest, followed, |covariate, n| self.measured(covariate, n));
        let mut model = Model::new(0.0, []);
        estimate(&rest, &Kind::DECLARED, Free::Nothing, &mut || true, &mut model);
        let is_known = |point: &&Point| self.covariates.iter().any(|covariate| covariate.avar(point.n).is_some());
        octaves.clear();
        let is_poor = is_poor(&model, rest.points());
        let known = rest.points().iter().filter(is_known).filter_map(|point| Octave::of(point, &model, is_poor));
        octaves.extend(known.take(COUPLED));
    }

    /// Sensitivities to the covariates in `chosen`.
    ///
    /// `None` where the covariates move too little, or too much alike.
    #[inline(never)]
    fn sensitivities(&self, chosen: &[usize], octaves: &[Octave]) -> Option<Sensitivities> {
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
            let freedom = freedom(octaves, |n| self.measured(covariate, n));
            let left = freedom - chosen.len() as f64;
            (left >= LEAST_FREEDOM).then(|| Sensitivity::new(covariate, value[i], error * sqrt(freedom / left), left))
        };
        chosen.iter().enumerate().map(sensitivity).collect()
    }

    /// Covariance of the right side of the normal equations.
    #[inline(never)]
    fn scatter(&self, chosen: &[usize], octaves: &[Octave]) -> [[f64; MAX_COVARIATES]; MAX_COVARIATES] {
        let mut matrix = [[0.0; MAX_COVARIATES]; MAX_COVARIATES];
        for (i, &a) in chosen.iter().enumerate() {
            for (j, &b) in chosen[..=i].iter().enumerate() {
                let of = |n: u64| if i == j { self.measured(a, n) } else { self.shared(a, b, n) };
                matrix[i][j] = scatter::<COUPLED>(octaves, of);
                matrix[j][i] = matrix[i][j];
            }
        }
        matrix
    }

    /// The channel's curve less what follows the covariates.
    #[must_use]
    pub fn compensated(&self, sensitivities: &[Sensitivity]) -> Curve<POINTS> {
        let mut curve = self.channel.clone();
        self.subtract(&mut curve, sensitivities, |covariate, n| self.shared(covariate, covariate, n));
        curve
    }

    /// Takes covariates of such a variance from the channel's `curve`.
    fn subtract(&self, curve: &mut Curve<POINTS>, sensitivities: &[Sensitivity], variance: impl Fn(usize, u64) -> f64) {
        curve.change_avar(|point| {
            let of = |a: &Sensitivity| {
                let others = sensitivities.iter().filter(|b| b.covariate < a.covariate);
                let products = others.map(|b| 2.0 * b.value * self.shared(a.covariate, b.covariate, point.n));
                let followed = self.with_channel(a.covariate, point.n);
                a.value * (a.value * variance(a.covariate, point.n) - 2.0 * followed + products.sum::<f64>())
            };
            // An estimate of what is left can come out below 0 where almost nothing is.
            let least = 0.01 * point.avar;
            (point.avar + sensitivities.iter().map(of).sum::<f64>()).max(least)
        });
    }

    /// The channel's curve when the covariates, as they are measured, are subtracted from its samples.
    ///
    /// Exact where all the covariances are known, the noise that the covariates bring included; elsewhere it is that
    /// of the channel.
    #[must_use]
    pub fn subtracted(&self, sensitivities: &[Sensitivity]) -> Curve<POINTS> {
        let mut curve = self.channel.clone();
        self.subtract_from(&mut curve, sensitivities);
        curve
    }

    /// Makes a copy of the channel's curve that in place.
    pub fn subtract_from(&self, curve: &mut Curve<POINTS>, sensitivities: &[Sensitivity]) {
        curve.change_avar(|point| self.subtracted_at(point, sensitivities).unwrap_or(point.avar));
    }

    /// The same at one point; `None` where a covariance is not known.
    #[must_use]
    pub fn subtracted_at(&self, point: &Point, sensitivities: &[Sensitivity]) -> Option<f64> {
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

    fn with_channel(&self, covariate: usize, n: u64) -> f64 {
        (self.covariance)(None, covariate, n).unwrap_or_default()
    }

    /// All the variance of a covariate at an octave that says something of it.
    fn measured(&self, covariate: usize, n: u64) -> f64 {
        self.covariates[covariate].signal(n).map_or(0.0, |(_, measured)| measured)
    }

    /// What two covariates have in common, noise taken off; 0 at an octave that says nothing of either.
    fn shared(&self, a: usize, b: usize, n: u64) -> f64 {
        let signal = |covariate: usize| self.covariates[covariate].signal(n);
        match (signal(a), signal(b)) {
            (Some((signal, _)), Some(_)) if a == b => signal,
            (Some(_), Some(_)) => (self.covariance)(Some(b), a, n).unwrap_or_default(),
            _ => 0.0,
        }
    }
}
