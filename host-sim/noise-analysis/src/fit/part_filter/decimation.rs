//! How many values of its own clock a filter makes for each sample that is read: where a deviance is least, and where it is small.

use crate::minimum;
use allan_core::term::MovingAverageFilter;

/// Decimations are tried in steps of this factor, a quarter of an octave: with the shape of the filter known, the curve of the
/// deviance has one minimum within an octave.
const STEP: f64 = 1.189_207_115_002_721;
/// Least decimation that is told from 1 (every value read).
const LEAST_DECIMATION: f64 = 1.02;
/// Accuracy of the likeliest decimation, as a part of it: the curves of 2¹⁷ samples know it to some hundredths.
const ACCURACY: f64 = 1e-5;

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
    Some(least_within(filter, range, ACCURACY, deviance))
}

/// The filter read at the decimation within a range at which `deviance` is least, to such a part of it.
pub(super) fn least_within(
    filter: MovingAverageFilter,
    (from, to): (f64, f64),
    accuracy: f64,
    mut deviance: impl FnMut(MovingAverageFilter) -> f64,
) -> MovingAverageFilter {
    let at = |log: f64| MovingAverageFilter { decimation: log.exp(), ..filter };
    at(minimum::least_within((from.ln(), to.ln()), accuracy, |log| deviance(at(log))))
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
        own => allowed_within(filter, (LEAST_DECIMATION.min(own), longest(filter).max(own)), limit, deviance),
    }
}

/// The same within a range.
pub(super) fn allowed_within(
    filter: MovingAverageFilter,
    (from, to): (f64, f64),
    limit: f64,
    mut deviance: impl FnMut(MovingAverageFilter) -> f64,
) -> (f64, f64) {
    let own = filter.decimation.ln();
    let rise = limit - deviance(filter);
    let mut bound = |end: f64| {
        let of = |log: f64| deviance(MovingAverageFilter { decimation: log.exp(), ..filter });
        let risen = minimum::risen((own, end.ln()), rise, of);
        // The end of the range as it is.
        if risen == end.ln() { end } else { risen.exp() }
    };
    (bound(from), bound(to))
}
