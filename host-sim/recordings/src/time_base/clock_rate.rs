//! The rate of a clock that changes in the course of a record, and the stamps as a steady clock would have written them.
//!
//! The lower envelope of the lateness is followed over hundreds of samples: a period that is wrong by a hundredth moves it by periods,
//! which would be losses or late deliveries. Where stamps are fine and regular, their intervals show the period at every time.

use crate::time_base::lateness_track::quantile;

/// Intervals whose mean is the local period.
const WINDOW: usize = 128;
/// Samples between two local periods.
const STRIDE: usize = 4;
/// Largest relative difference from the median of a window of an interval that is one period of it.
const NEAR: f64 = 0.04;
/// Smallest part of the intervals that are one period long, for stamps that count as regular.
const REGULAR: f64 = 0.75;
/// The same in a window that may reach over a step of the rate.
const MAJORITY: f64 = 0.45;
/// Smallest relative change of the local period that is followed; half of a period in the queue over which the envelope is sought.
const SMALLEST: f64 = 0.5 / 256.0;
/// Standard errors of a local period in a change that is followed.
const SIGNIFICANT: f64 = 5.0;
/// Longest local period, in the shortest, that is that of a clock and not of a queue that is drained.
const PLAUSIBLE: f64 = 1.5;

/// Stamps of a clock whose rate changes.
pub(crate) struct SteadiedStamps {
    /// The stamps of a clock with the mean rate, s.
    pub(crate) times: Vec<f64>,
    /// The shortest and the longest local period, s.
    pub(crate) shortest_s: f64,
    pub(crate) longest_s: f64,
}

/// The mean of the intervals near the median of `window`, how many they are, and the sum of the squares of their distances from it.
fn local(window: &mut [f64]) -> (f64, f64, f64) {
    let median = quantile(window, 1, 2);
    let near = || window.iter().filter(|interval| (*interval - median).abs() <= NEAR * median);
    let count = near().count() as f64;
    let mean = near().sum::<f64>() / count.max(1.0);
    (mean, count, near().map(|interval| (interval - mean) * (interval - mean)).sum())
}

/// The stamps `times` as a steady clock would have written them; `None` where the clock is steady, or the stamps are too irregular to
/// show its rate.
pub(crate) fn steadied(times: &[f64]) -> Option<SteadiedStamps> {
    let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if intervals.len() < 2 * WINDOW {
        return None;
    }
    let mut scratch: Vec<f64> = Vec::with_capacity(WINDOW);
    // One window after the other: most clocks are steady.
    let is_regular = |count: f64, least: f64| count >= least * WINDOW as f64;
    let (mut regular, mut squares) = (0.0, 0.0);
    let mut periods: Vec<f64> = Vec::new();
    for window in intervals.chunks_exact(WINDOW) {
        scratch.clear();
        scratch.extend_from_slice(window);
        let (period, count, of_squares) = local(&mut scratch);
        if is_regular(count, REGULAR) {
            periods.push(period);
        }
        regular += count;
        squares += of_squares / (period * period);
    }
    if regular < REGULAR * intervals.len() as f64 || periods.is_empty() {
        return None;
    }
    let usual = quantile(&mut periods, 1, 2);
    let error = (squares / regular / WINDOW as f64).sqrt();
    let least_change = SMALLEST.max(SIGNIFICANT * error);
    let changes = |period: f64, before: f64| (period / before - 1.0).abs() > least_change;
    if !periods.iter().any(|&period| changes(period, usual)) {
        return None;
    }
    // A queue that is drained has intervals far shorter than those around it.
    let is_plausible = |period: f64| (usual / PLAUSIBLE..=usual * PLAUSIBLE).contains(&period);
    let mut steady = Vec::with_capacity(times.len());
    let (mut time, mut period) = (times[0], None);
    let (mut shortest_s, mut longest_s) = (f64::INFINITY, 0.0f64);
    steady.push(time);
    for (number, part) in intervals.chunks(STRIDE).enumerate() {
        let at = number * STRIDE + part.len() / 2;
        let first = at.saturating_sub(WINDOW / 2).min(intervals.len() - WINDOW);
        scratch.clear();
        scratch.extend_from_slice(&intervals[first..first + WINDOW]);
        let (now, count, _) = local(&mut scratch);
        let is_new = period.is_none_or(|before| changes(now, before));
        if is_new && is_regular(count, MAJORITY) && is_plausible(now) {
            period = Some(now);
        }
        let of_part = period.unwrap_or(usual);
        (shortest_s, longest_s) = (shortest_s.min(of_part), longest_s.max(of_part));
        for interval in part {
            time += interval * usual / of_part;
            steady.push(time);
        }
    }
    Some(SteadiedStamps { times: steady, shortest_s, longest_s })
}
