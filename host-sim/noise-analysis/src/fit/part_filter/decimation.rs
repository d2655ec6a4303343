//! How many values of its own clock a filter makes for each sample that is read: where a deviance is least, and where it is small.

use crate::minimum::{end_of, golden_section};
use allan_core::term::MovingAverageFilter;

/// Decimations are tried in steps of this factor, a quarter of an octave: with the shape of the filter known, the curve of the
/// deviance has one minimum within an octave.
const STEP: f64 = 1.189_207_115_002_721;
/// Least decimation that is told from 1 (every value read).
const LEAST_DECIMATION: f64 = 1.02;
/// Steps of a search by a golden section or by halves: two steps of the decimation shrink to `1e-6` of it, or far less.
const SEARCH_STEPS: usize = 26;

/// The largest decimation at which a filter is tried: its length, beyond which no two samples are correlated.
fn longest(filter: MovingAverageFilter) -> f64 {
    f64::from(filter.stages) * f64::from(filter.taps)
}

/// The decimations at which a filter that is read slowly is tried, from just above 1 to its length.
pub(super) fn decimations(filter: MovingAverageFilter) -> impl Iterator<Item = f64> {
    let longest = longest(filter);
    std::iter::successors(Some(LEAST_DECIMATION), |decimation| Some(decimation * STEP))
        .take_while(move |decimation| *decimation < longest)
}

/// The filter read at the decimation with the least `deviance`: from just above 1 to the filter's length. `None` for a filter that
/// is shorter than that.
pub(super) fn slowest(
    filter: MovingAverageFilter,
    mut deviance: impl FnMut(MovingAverageFilter) -> f64,
) -> Option<MovingAverageFilter> {
    let mut at = |decimation: f64| deviance(MovingAverageFilter { decimation, ..filter });
    let tried = decimations(filter).map(|decimation| (decimation, at(decimation)));
    let (start, _) = tried.reduce(|best, next| if next.1 < best.1 { next } else { best })?;
    let range = ((start / STEP).max(LEAST_DECIMATION), (start * STEP).min(longest(filter)));
    Some(least_within(filter, range, SEARCH_STEPS, deviance))
}

/// The filter read at the decimation within a range at which `deviance` is least, after so many steps.
pub(super) fn least_within(
    filter: MovingAverageFilter,
    (from, to): (f64, f64),
    steps: usize,
    mut deviance: impl FnMut(MovingAverageFilter) -> f64,
) -> MovingAverageFilter {
    let at = |log: f64| MovingAverageFilter { decimation: log.exp(), ..filter };
    at(golden_section((from.ln(), to.ln()), steps, |log| deviance(at(log))))
}

/// The decimations of `filter`, from just above 1 to its length, between which the `deviance` is at most `limit`, around its own; its own
/// alone where every value is read.
pub(super) fn allowed(
    filter: MovingAverageFilter,
    limit: f64,
    deviance: impl FnMut(MovingAverageFilter) -> f64,
) -> (f64, f64) {
    match filter.decimation {
        1.0 => (1.0, 1.0),
        own => {
            allowed_within(filter, (LEAST_DECIMATION.min(own), longest(filter).max(own)), SEARCH_STEPS, limit, deviance)
        }
    }
}

/// The same within a range, by so many halves of it on either side.
pub(super) fn allowed_within(
    filter: MovingAverageFilter,
    (from, to): (f64, f64),
    steps: usize,
    limit: f64,
    mut deviance: impl FnMut(MovingAverageFilter) -> f64,
) -> (f64, f64) {
    let mut is_allowed = |log: f64| deviance(MovingAverageFilter { decimation: log.exp(), ..filter }) <= limit;
    let mut bound = |outside: f64| {
        let end = end_of((filter.decimation.ln(), outside.ln()), steps, &mut is_allowed);
        // The end of the range as it is.
        if end == outside.ln() { outside } else { end.exp() }
    };
    (bound(from), bound(to))
}
