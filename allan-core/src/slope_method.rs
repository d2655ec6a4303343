//! The slope method: coefficients read from the straight parts of the curve (IEEE 952, annex C). It is biased where
//! terms overlap, and serves as a comparison with the [`fit`](crate::fit::fit).

use crate::curve::{AllanPoint, CurveView};
use crate::math;
use core::f64::consts::{LN_2, PI};
use core::ops::RangeInclusive;

/// Largest deviation of `d log σ / d log τ` between two octaves from −½ or +½ on a line of this slope.
pub const LINE_TOLERANCE: f64 = 0.15;

/// Largest deviation of the slope from 0 at the flat minimum: half way to the slopes of the neighbouring lines.
pub const FLAT_TOLERANCE: f64 = 0.25;

/// Points with a larger [`percentage_accuracy`], in percent, are not used.
pub const WORST_ACCURACY: f64 = 25.0;

/// A coefficient and the interval of averaging times, in s, on which its slope was found.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct SlopeEstimate {
    /// Value, in the unit of [`NoiseTerm::unit`](crate::term::NoiseTerm::unit).
    pub value: f64,
    /// First and last averaging time of the interval, s.
    pub interval: RangeInclusive<f64>,
}

/// The accuracy `100/√(2(N/n − 1))` in percent of a point at averaging factor `n` of `N = samples` (IEEE 952, annex C).
/// It is infinite at `n = N`, and not a number above.
#[must_use]
pub fn percentage_accuracy(samples: u64, n: u64) -> f64 {
    100.0 / math::sqrt(2.0 * (samples as f64 / n as f64 - 1.0))
}

/// N, in unit·√s: the value at τ = 1 s of the line of slope −½ through the longest interval of this slope left of the
/// minimum. `None` if no two neighbouring points have this slope within [`LINE_TOLERANCE`].
#[must_use]
pub fn angle_random_walk<'a>(curve: impl Into<CurveView<'a>>) -> Option<SlopeEstimate> {
    let (points, lowest) = accurate_points(curve.into())?;
    on_line(&points[..=lowest], -0.5, 1.0)
}

/// B, in the unit of the curve: the minimum of σ times `√(π/(2 ln 2))`. `None` if the minimum is not in an interval that
/// is flat within [`FLAT_TOLERANCE`].
#[must_use]
pub fn bias_instability<'a>(curve: impl Into<CurveView<'a>>) -> Option<SlopeEstimate> {
    let (points, lowest) = accurate_points(curve.into())?;
    let tau = points[lowest].tau;
    let flat = runs(points, 0.0, FLAT_TOLERANCE).find(|run| interval(run).contains(&tau))?;
    Some(SlopeEstimate { value: math::sqrt(points[lowest].avar * PI / (2.0 * LN_2)), interval: interval(flat) })
}

/// K, in unit/√s: the value at τ = 3 s of the line of slope +½ through the longest interval of this slope right of the
/// minimum. `None` if no two neighbouring points have this slope within [`LINE_TOLERANCE`].
#[must_use]
pub fn rate_random_walk<'a>(curve: impl Into<CurveView<'a>>) -> Option<SlopeEstimate> {
    let (points, lowest) = accurate_points(curve.into())?;
    on_line(&points[lowest..], 0.5, 3.0)
}

/// The points that are accurate enough, and the index of the lowest.
fn accurate_points(curve: CurveView<'_>) -> Option<(&[AllanPoint], usize)> {
    let accurate = |point: &&AllanPoint| percentage_accuracy(curve.samples(), point.n) <= WORST_ACCURACY;
    let points = &curve.points()[..curve.points().iter().take_while(accurate).count()];
    let lowest = (0..points.len()).min_by(|&a, &b| points[a].avar.total_cmp(&points[b].avar))?;
    Some((points, lowest))
}

/// The value at `tau` seconds of the line of `slope` through the geometric mean of the points of its longest interval.
fn on_line(points: &[AllanPoint], slope: f64, tau: f64) -> Option<SlopeEstimate> {
    let run =
        runs(points, slope, LINE_TOLERANCE).reduce(|best, run| if run.len() > best.len() { run } else { best })?;
    let at_tau = |point: &AllanPoint| math::ln(point.avar) / 2.0 + slope * math::ln(tau / point.tau);
    let mean = run.iter().map(at_tau).sum::<f64>() / run.len() as f64;
    Some(SlopeEstimate { value: math::exp(mean), interval: interval(run) })
}

/// Runs of two or more neighbouring points with this slope between them, within `tolerance`.
fn runs(points: &[AllanPoint], slope: f64, tolerance: f64) -> impl Iterator<Item = &[AllanPoint]> {
    let joined = move |left: &AllanPoint, right: &AllanPoint| {
        let octaves = math::log2(right.tau / left.tau);
        math::abs(math::log2(right.avar / left.avar) / 2.0 / octaves - slope) <= tolerance
    };
    points.chunk_by(joined).filter(|run| run.len() > 1)
}

fn interval(run: &[AllanPoint]) -> RangeInclusive<f64> {
    run[0].tau..=run[run.len() - 1].tau
}
