//! From the times at which samples were delivered to the periods in which they were taken.
//!
//! A sample cannot arrive before it was taken, only after. Lateness `c_i = t_i/T − i` (in periods `T`) therefore has a
//! lower envelope: the number of samples lost before `i`. A stall lifts `c` above the envelope until the queue has run
//! out; a lost sample lifts the envelope itself, by one, for good.

use std::collections::VecDeque;

/// Samples over which the envelope is sought: the deepest queue whose late delivery is told from a loss. The last samples
/// of a record have fewer after them, so there a late delivery may pass for a loss.
const QUEUE: usize = 64;

/// Share of the envelope's change that its phase follows at each sample: a period that is wrong by a fraction `ε` makes
/// the phase lag by `ε/TRACKING` periods, so that up to 3 % is harmless.
const TRACKING: f64 = 1.0 / 16.0;

/// Intervals that are one period with jitter, in medians. Flushes are shorter, gaps and stalls longer.
const ORDINARY: std::ops::Range<f64> = 0.4..1.6;

/// Deliveries, each with the period in which its sample was taken.
pub(super) struct Deliveries {
    /// Period of each sample, counted from the first; grows by at least one a sample.
    pub(super) slots: Vec<u64>,
    /// Whether the sample came within a period of the envelope, so that its time says when it was taken.
    on_time: Vec<bool>,
}

impl Deliveries {
    /// Lays `times` (s, not decreasing) along periods of `period` s.
    pub(super) fn with_period(times: &[f64], period: f64) -> Self {
        let Some(&origin) = times.first() else {
            return Self { slots: Vec::new(), on_time: Vec::new() };
        };
        let lateness: Vec<f64> =
            times.iter().enumerate().map(|(at, time)| (time - origin) / period - at as f64).collect();
        let envelope = least_ahead(&lateness, QUEUE);
        let mut phase = envelope[0];
        let mut missing = 0u64;
        let mut slots = Vec::with_capacity(times.len());
        let mut on_time = Vec::with_capacity(times.len());
        for (at, (late, least)) in lateness.iter().zip(envelope).enumerate() {
            let excess = least - missing as f64 - phase;
            if excess >= 0.5 {
                // A float beyond u64 saturates.
                missing = missing.saturating_add(excess.round() as u64);
            }
            let rest = least - missing as f64 - phase;
            if rest.is_finite() {
                phase += rest * TRACKING;
            }
            slots.push(missing.saturating_add(at as u64));
            on_time.push(late - missing as f64 - phase < 1.0);
        }
        Self { slots, on_time }
    }

    /// Sample rate in Hz, from the samples that were delivered on time.
    pub(super) fn rate(&self, times: &[f64]) -> Option<f64> {
        rate(&self.slots, times, |at| self.on_time[at])
    }
}

/// The period in s that the intervals between `times` show; `None` if most of them are 0.
///
/// It is the mean of the intervals near the median: the median alone errs when jitter is skewed.
pub(super) fn period(times: &[f64]) -> Option<f64> {
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if intervals.is_empty() {
        return None;
    }
    let middle = intervals.len() / 2;
    let median = *intervals.select_nth_unstable_by(middle, f64::total_cmp).1;
    let ordinary = || intervals.iter().filter(|interval| ORDINARY.contains(&(*interval / median)));
    let period = ordinary().sum::<f64>() / ordinary().count() as f64;
    (period > 0.0 && period.is_finite()).then_some(period)
}

/// The least of each value and the `window − 1` after it.
fn least_ahead(values: &[f64], window: usize) -> Vec<f64> {
    let mut least = vec![0.0; values.len()];
    // Positions ahead whose values increase with their distance; the front is the least.
    let mut candidates: VecDeque<usize> = VecDeque::with_capacity(window);
    for at in (0..values.len()).rev() {
        while candidates.front().is_some_and(|&ahead| values[ahead] >= values[at]) {
            candidates.pop_front();
        }
        candidates.push_front(at);
        while candidates.back().is_some_and(|&ahead| ahead >= at + window) {
            candidates.pop_back();
        }
        least[at] = candidates.back().map_or(values[at], |&ahead| values[ahead]);
    }
    least
}

/// Sample rate in Hz: one over the slope of the least-squares line of time over period, for the samples that `counts`
/// admits. `None` if they span no time.
pub(super) fn rate(slots: &[u64], times: &[f64], counts: impl Fn(usize) -> bool) -> Option<f64> {
    let (&first_slot, &first_time) = (slots.first()?, times.first()?);
    // Relative to the first, so that a late origin costs no digits.
    let points = || {
        slots
            .iter()
            .zip(times)
            .enumerate()
            .filter(|(at, _)| counts(*at))
            .map(|(_, (slot, time))| ((slot - first_slot) as f64, time - first_time))
    };
    let n = points().count() as f64;
    let (sum_x, sum_y) = points().fold((0.0, 0.0), |(x, y), (slot, time)| (x + slot, y + time));
    let (mean_x, mean_y) = (sum_x / n, sum_y / n);
    let (xx, xy) = points().fold((0.0, 0.0), |(xx, xy), (slot, time)| {
        let x = slot - mean_x;
        (xx + x * x, xy + x * (time - mean_y))
    });
    let rate = xx / xy;
    (rate.is_finite() && rate > 0.0).then_some(rate)
}
