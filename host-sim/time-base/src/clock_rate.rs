//! A clock whose rate changes, by its local period in fine, regular stamps, and its stamps at a steady rate.

use crate::lateness_track::quantile;

const WINDOW: usize = 128;
/// Samples between local periods.
const STRIDE: usize = 4;
/// Relative distance from the median of regular intervals.
const NEAR: f64 = 0.04;
const REGULAR: f64 = 0.75;
const MAJORITY: f64 = 0.45;
/// Least relative change followed: half a period in the queue.
const SMALLEST: f64 = 0.5 / 256.0;
/// Standard errors of a followed change.
const SIGNIFICANT: f64 = 5.0;
/// Ratio of local periods; beyond is a drained queue.
const PLAUSIBLE: f64 = 1.5;

pub(crate) struct SteadiedStamps {
    /// At the mean rate, s.
    pub(crate) times: Vec<f64>,
    /// Extreme local periods, s.
    pub(crate) shortest_s: f64,
    pub(crate) longest_s: f64,
}

/// Mean, number and sum of squares of intervals near the median.
fn local(window: &mut [f64]) -> (f64, f64, f64) {
    let median = quantile(window, 1, 2);
    let near = || window.iter().filter(|interval| (*interval - median).abs() <= NEAR * median);
    let count = near().count() as f64;
    let mean = near().sum::<f64>() / count.max(1.0);
    (mean, count, near().map(|interval| (interval - mean) * (interval - mean)).sum())
}

/// At a steady rate; `None` if steady, or too irregular.
pub(crate) fn steadied(times: &[f64]) -> Option<SteadiedStamps> {
    let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if intervals.len() < 2 * WINDOW {
        return None;
    }
    let mut scratch: Vec<f64> = Vec::with_capacity(WINDOW);
    // Most clocks are steady.
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

#[derive(Debug, Clone, Copy, Default)]
struct Regularity {
    windows: f64,
    regular: f64,
    /// Squared distances, periods.
    squares: f64,
}

impl Regularity {
    /// Their period, if most are regular.
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

    fn follow(&mut self, window: &mut [f64], least_change: f64) -> f64 {
        let (now, count, _) = local(window);
        let is_new = self.period_s.is_none_or(|before| differs(now, before, least_change));
        // A drained queue has far shorter intervals.
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

/// Steady stamps, block by block; unchanged until the rate changes.
pub(crate) struct SteadyStream {
    clock: LocalPeriod,
    regularity: Regularity,
    is_changing: bool,
    /// Unreturned stamps behind their window.
    times: Vec<f64>,
    before: usize,
    uncounted: usize,
    correction_s: f64,
}

impl SteadyStream {
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

    /// Takes stamps, s; returns the oldest, as they are and steadied; all with `is_last`.
    pub(crate) fn steady(&mut self, next: impl Iterator<Item = f64>, is_last: bool) -> Vec<(f64, f64)> {
        let known = self.times.len();
        self.times.extend(next);
        self.uncounted += self.times.len() - known.max(1).min(self.times.len());
        let intervals: Vec<f64> = self.times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mut scratch = [0.0; WINDOW];
        let mut returned = Vec::new();
        let mut at = self.before;
        // The first stamp stays.
        while at < self.times.len() && (is_last || at + 2 * WINDOW < self.times.len()) {
            let part = (self.times.len() - at).min(STRIDE);
            // Windows are counted as the stamps approach.
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

    /// Extreme local periods, s, after a change.
    pub(crate) fn periods_s(&self) -> Option<[f64; 2]> {
        self.is_changing.then_some([self.clock.shortest_s, self.clock.longest_s])
    }
}
