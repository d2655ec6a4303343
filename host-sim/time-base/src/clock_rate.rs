//! The rate of a clock that changes in the course of a record, and the stamps as a steady clock would have written them.
//!
//! The lower envelope of the lateness is followed over hundreds of samples: a period that is wrong by a hundredth moves it by periods,
//! which would be losses or late deliveries. If stamps are fine and regular, their intervals show the period at every time.

use crate::lateness_track::quantile;

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
    let mut regularity = Regularity::default();
    let mut periods: Vec<f64> = Vec::new();
    for window in intervals.chunks_exact(WINDOW) {
        scratch.clear();
        scratch.extend_from_slice(window);
        periods.extend(regularity.add(&mut scratch));
    }
    if !regularity.is_enough() || periods.is_empty() {
        return None;
    }
    let mut clock = LocalPeriod::new(quantile(&mut periods, 1, 2));
    let least_change = regularity.least_change();
    if !periods.iter().any(|&period| differs(period, clock.usual_s, least_change)) {
        return None;
    }
    let mut steady = Vec::with_capacity(times.len());
    let mut time = times[0];
    steady.push(time);
    for (number, part) in intervals.chunks(STRIDE).enumerate() {
        let at = number * STRIDE + part.len() / 2;
        let first = at.saturating_sub(WINDOW / 2).min(intervals.len() - WINDOW);
        scratch.clear();
        scratch.extend_from_slice(&intervals[first..first + WINDOW]);
        let of_part = clock.follow(&mut scratch, least_change);
        for interval in part {
            time += interval * clock.usual_s / of_part;
            steady.push(time);
        }
    }
    Some(SteadiedStamps { times: steady, shortest_s: clock.shortest_s, longest_s: clock.longest_s })
}

/// How regular intervals are.
#[derive(Debug, Clone, Copy, Default)]
struct Regularity {
    windows: f64,
    /// Intervals that are one period long.
    regular: f64,
    /// Squares of their distances from it, in periods.
    squares: f64,
}

impl Regularity {
    /// Adds the intervals of a window; their period, if most of them are one long.
    fn add(&mut self, window: &mut [f64]) -> Option<f64> {
        let (period, count, squares) = local(window);
        self.windows += 1.0;
        self.regular += count;
        self.squares += squares / (period * period);
        (count >= REGULAR * WINDOW as f64).then_some(period)
    }

    fn is_enough(&self) -> bool {
        self.regular >= REGULAR * self.windows * WINDOW as f64
    }

    /// The smallest relative change of the local period that is followed.
    fn least_change(&self) -> f64 {
        SMALLEST.max(SIGNIFICANT * (self.squares / self.regular / WINDOW as f64).sqrt())
    }
}

fn differs(period: f64, other: f64, least_change: f64) -> bool {
    (period / other - 1.0).abs() > least_change
}

/// The period of a clock from one window to the next.
#[derive(Debug, Clone, Copy)]
struct LocalPeriod {
    usual_s: f64,
    period_s: Option<f64>,
    shortest_s: f64,
    longest_s: f64,
}

impl LocalPeriod {
    fn new(usual_s: f64) -> Self {
        Self { usual_s, period_s: None, shortest_s: f64::INFINITY, longest_s: 0.0 }
    }

    /// The period in the middle of the intervals of `window`.
    fn follow(&mut self, window: &mut [f64], least_change: f64) -> f64 {
        let (now, count, _) = local(window);
        let is_new = self.period_s.is_none_or(|before| differs(now, before, least_change));
        // A queue that is drained has intervals far shorter than those around it.
        let is_plausible = (self.usual_s / PLAUSIBLE..=self.usual_s * PLAUSIBLE).contains(&now);
        if is_new && count >= MAJORITY * WINDOW as f64 && is_plausible {
            self.period_s = Some(now);
        }
        let period = self.period_s.unwrap_or(self.usual_s);
        self.shortest_s = self.shortest_s.min(period);
        self.longest_s = self.longest_s.max(period);
        period
    }
}

/// The stamps of a clock as a steady clock would have written them, one block of rows after the other. Nothing changes before the rate does.
pub(crate) struct SteadyStream {
    clock: LocalPeriod,
    regularity: Regularity,
    /// True if the rate has changed.
    is_changing: bool,
    /// Stamps that are not returned yet, and before them those of the window around the first of them.
    times: Vec<f64>,
    /// How many of them are before it.
    before: usize,
    /// Intervals at the end that no window has counted.
    uncounted: usize,
    /// Correction of a stamp.
    correction_s: f64,
}

impl SteadyStream {
    /// Rate of a clock whose usual period is `usual_s`.
    pub(crate) fn new(usual_s: f64) -> Self {
        Self {
            clock: LocalPeriod { period_s: Some(usual_s), ..LocalPeriod::new(usual_s) },
            regularity: Regularity::default(),
            is_changing: false,
            times: Vec::new(),
            before: 0,
            uncounted: 0,
            correction_s: 0.0,
        }
    }

    /// Takes the next stamps, s, and returns the oldest of those that are not returned yet: as they are, and as a steady clock would have
    /// written them. With `is_last` all of them.
    pub(crate) fn steady(&mut self, next: impl Iterator<Item = f64>, is_last: bool) -> Vec<(f64, f64)> {
        let known = self.times.len();
        self.times.extend(next);
        self.uncounted += self.times.len() - known.max(1).min(self.times.len());
        let intervals: Vec<f64> = self.times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mut scratch = [0.0; WINDOW];
        let mut returned = Vec::new();
        let mut at = self.before;
        // The interval before a stamp is corrected, so that the first stamp stays.
        while at < self.times.len() && (is_last || at + 2 * WINDOW < self.times.len()) {
            let part = (self.times.len() - at).min(STRIDE);
            // A window is counted, and shows a change, when the stamps come near it.
            while self.uncounted >= WINDOW && intervals.len() - self.uncounted <= at + WINDOW {
                let first = intervals.len() - self.uncounted;
                scratch.copy_from_slice(&intervals[first..first + WINDOW]);
                self.uncounted -= WINDOW;
                let period = self.regularity.add(&mut scratch).filter(|_| self.regularity.is_enough());
                self.is_changing |=
                    period.is_some_and(|period| differs(period, self.clock.usual_s, self.regularity.least_change()));
            }
            if self.is_changing && intervals.len() >= WINDOW {
                let first = (at + part / 2).saturating_sub(WINDOW / 2).min(intervals.len() - WINDOW);
                scratch.copy_from_slice(&intervals[first..first + WINDOW]);
                self.clock.follow(&mut scratch, self.regularity.least_change());
            }
            let period = self.clock.period_s.unwrap_or(self.clock.usual_s);
            for row in at..at + part {
                if row > 0 {
                    self.correction_s += intervals[row - 1] * (self.clock.usual_s / period - 1.0);
                }
                returned.push((self.times[row], self.times[row] + self.correction_s));
            }
            at += part;
        }
        let left = at.saturating_sub(WINDOW);
        self.times.drain(..left);
        self.before = at - left;
        returned
    }

    /// The shortest and the longest local period, s, where the rate has changed.
    pub(crate) fn periods_s(&self) -> Option<[f64; 2]> {
        self.is_changing.then_some([self.clock.shortest_s, self.clock.longest_s])
    }
}
