//! A slow part that two channels share without a measured cause, from their coupling alone.

use crate::confidence::octave_correlation;
use crate::coupling::Covariance;
use crate::math::{abs, atanh, clamp, sqrt};
use crate::regression::Shared;
use crate::term::{Kind, Markov};
use crate::{Curve, Model};
use heapless::Vec;

/// Standard deviations from which on two channels are believed to share something.
const DOUBT: f64 = 5.0;
/// Averaging factors below this are not what is slow: neighbouring channels share noise of their common electronics.
const SLOW: u64 = 32;

/// Degrees of freedom above which Fisher's transform of a correlation is normal enough.
const FEWEST_TRANSFORMED: f64 = 4.0;
/// Correlations beyond this are taken for it.
const CLOSEST: f64 = 0.999;

/// What two channels share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommonMode {
    /// Shortest averaging factor, samples, from which on it shows.
    pub from_n: u64,
    /// How clearly, in standard deviations; negative where one channel rises as the other falls.
    pub sigmas: f64,
    /// Standard deviation of the shared part as a Markov process, the geometric mean of the two channels' units.
    pub deviation: f64,
    /// Standard deviation of `deviation`.
    pub error: f64,
    /// Its correlation time, s.
    pub time_constant: f64,
}

/// One octave of the two.
struct Octave {
    n: u64,
    /// How clearly the two channels correlate: of variance 1 if they share nothing.
    score: f64,
    covariance: f64,
    /// Standard deviation of the covariance if they share nothing.
    error: f64,
    shares: crate::confidence::Shares,
}

/// Looks for what `a` and `b`, each with its fitted model, share.
#[must_use]
pub fn common_mode<const POINTS: usize>(
    (a, model_a): (&Curve<POINTS>, &Model),
    (b, model_b): (&Curve<POINTS>, &Model),
    shared: &Shared<POINTS>,
) -> Option<CommonMode> {
    let octave = |covariance: &Covariance| {
        let of = |curve: &Curve<POINTS>| curve.points().iter().find(|point| point.n == covariance.n).copied();
        let (point, other) = (of(a)?, of(b)?);
        let variance = model_a.avar(point.n).max(point.avar) * model_b.avar(point.n).max(other.avar);
        let edf = model_a.edf(&point).min(model_b.edf(&other));
        let error = sqrt(variance / edf);
        (error > 0.0).then_some(Octave {
            n: point.n,
            score: clarity(covariance.covariance / sqrt(variance), edf),
            covariance: covariance.covariance,
            error,
            shares: model_a.shares(point.n),
        })
    };
    let octaves: Vec<Octave, POINTS> = shared.iter().filter(|point| point.n >= SLOW).filter_map(octave).collect();
    let (from, sigmas) = clearest(&octaves)?;
    if abs(sigmas) < DOUBT {
        return None;
    }
    let (time_constant, variance, error) = as_markov(&octaves[from..], a.sample_period())?;
    let deviation = sqrt(abs(variance));
    Some(CommonMode { from_n: octaves[from].n, sigmas, deviation, error: error / (2.0 * deviation), time_constant })
}

/// A correlation over its scatter if there is none: by R. A. Fisher's transform, without which a correlation near 1 of
/// few degrees of freedom counts for far too little.
fn clarity(correlation: f64, edf: f64) -> f64 {
    if edf > FEWEST_TRANSFORMED {
        atanh(clamp(correlation, -CLOSEST, CLOSEST)) * sqrt(edf - 2.0)
    } else {
        correlation * sqrt(edf)
    }
}

/// The run of octaves up to the longest that is least like chance.
fn clearest(octaves: &[Octave]) -> Option<(usize, f64)> {
    let of = |from: usize| {
        let run = &octaves[from..];
        let sum: f64 = run.iter().map(|octave| octave.score).sum();
        let mut variance = 0.0;
        for (i, a) in run.iter().enumerate() {
            for (j, b) in run.iter().enumerate() {
                variance += octave_correlation(i.abs_diff(j), a.shares, b.shares);
            }
        }
        (from, sum / sqrt(variance))
    };
    (0..octaves.len()).map(of).max_by(|(_, a), (_, b)| abs(*a).total_cmp(&abs(*b)))
}

/// Correlation time, variance and its standard deviation of the Markov process that fits the covariances best.
fn as_markov(octaves: &[Octave], sample_period: f64) -> Option<(f64, f64, f64)> {
    let longest = octaves.last()?.n as f64 * sample_period;
    let times = core::iter::successors(Some(longest), |time| Some(time / 1.3)).take_while(|&time| time > sample_period);
    let fit = |time_constant: f64| {
        let kind = Kind::Markov(Markov { time_constant });
        let (mut along, mut weight) = (0.0, 0.0);
        for octave in octaves {
            let shape = kind.avar(octave.n, sample_period) / octave.error;
            along += shape * octave.covariance / octave.error;
            weight += shape * shape;
        }
        (time_constant, along / weight, 1.0 / sqrt(weight), along * along / weight)
    };
    let best = times.map(fit).max_by(|a, b| a.3.total_cmp(&b.3))?;
    Some((best.0, best.1, best.2))
}
