//! The classical way to the coefficients: slopes of the curve, read off one after the other.
//!
//! Simple, and biased wherever two terms overlap; it is here to stand beside the [`fit`](crate::fit::fit).

use crate::{Curve, Point, math};
use core::f64::consts::{LN_2, PI};
use core::ops::RangeInclusive;

/// How far `d log σ / d log τ` between two octaves may be from that of a −½ or +½ line.
pub const LINE_TOLERANCE: f64 = 0.15;

/// How far it may be from 0 at the flat minimum, which is the bottom of a bow: as near as to either line.
pub const FLAT_TOLERANCE: f64 = 0.25;

/// Points whose [`percentage_accuracy`] is worse are not looked at.
pub const WORST_ACCURACY: f64 = 25.0;

/// A coefficient, and the averaging times between which its slope was found, in s.
#[derive(Debug, Clone, PartialEq)]
pub struct Coefficient {
    /// In the unit of the coefficient's [`Kind`](crate::Kind).
    pub value: f64,
    /// First and last averaging time of the interval.
    pub interval: RangeInclusive<f64>,
}

/// `100/sqrt(2(N/n − 1))`: the percentage accuracy of a point at averaging factor `n` of a record of `samples`.
#[must_use]
pub fn percentage_accuracy(samples: u64, n: u64) -> f64 {
    100.0 / math::sqrt(2.0 * (samples as f64 / n as f64 - 1.0))
}

/// N: the value at 1 s of the −½ line through the longest interval of this slope left of the minimum.
#[must_use]
pub fn angle_random_walk<const OCTAVES: usize>(curve: &Curve<OCTAVES>) -> Option<Coefficient> {
    let (points, lowest) = judged(curve)?;
    on_line(&points[..=lowest], -0.5, 1.0)
}

/// B: the minimum times `sqrt(π/(2 ln 2))`, if it lies in a flat interval.
#[must_use]
pub fn bias_instability<const OCTAVES: usize>(curve: &Curve<OCTAVES>) -> Option<Coefficient> {
    let (points, lowest) = judged(curve)?;
    let tau = points[lowest].tau;
    let flat = runs(points, 0.0, FLAT_TOLERANCE).find(|run| interval(run).contains(&tau))?;
    Some(Coefficient { value: math::sqrt(points[lowest].avar * PI / (2.0 * LN_2)), interval: interval(flat) })
}

/// K: the value at 3 s of the +½ line through the longest interval of this slope right of the minimum.
#[must_use]
pub fn rate_random_walk<const OCTAVES: usize>(curve: &Curve<OCTAVES>) -> Option<Coefficient> {
    let (points, lowest) = judged(curve)?;
    on_line(&points[lowest..], 0.5, 3.0)
}

/// The points that are accurate enough, and which of them is the lowest.
fn judged<const OCTAVES: usize>(curve: &Curve<OCTAVES>) -> Option<(&[Point], usize)> {
    let accurate = |point: &&Point| percentage_accuracy(curve.samples(), point.n) <= WORST_ACCURACY;
    let points = &curve.points()[..curve.points().iter().take_while(accurate).count()];
    let lowest = (0..points.len()).min_by(|&a, &b| points[a].avar.total_cmp(&points[b].avar))?;
    Some((points, lowest))
}

/// The line of `slope` through the geometric mean of the points of its longest interval, at `tau` seconds.
fn on_line(points: &[Point], slope: f64, tau: f64) -> Option<Coefficient> {
    let run =
        runs(points, slope, LINE_TOLERANCE).reduce(|best, run| if run.len() > best.len() { run } else { best })?;
    let at_tau = |point: &Point| math::ln(point.avar) / 2.0 + slope * math::ln(tau / point.tau);
    let mean = run.iter().map(at_tau).sum::<f64>() / run.len() as f64;
    Some(Coefficient { value: math::exp(mean), interval: interval(run) })
}

/// Runs of two and more neighbouring points that are joined by `slope`, within `tolerance`.
fn runs(points: &[Point], slope: f64, tolerance: f64) -> impl Iterator<Item = &[Point]> {
    let joined = move |left: &Point, right: &Point| {
        let octaves = math::log2(right.tau / left.tau);
        math::abs(math::log2(right.avar / left.avar) / 2.0 / octaves - slope) <= tolerance
    };
    points.chunk_by(joined).filter(|run| run.len() > 1)
}

fn interval(run: &[Point]) -> RangeInclusive<f64> {
    run[0].tau..=run[run.len() - 1].tau
}
