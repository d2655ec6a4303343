//! Lateness against a fixed period: lower envelope, losses, description length.

use std::collections::VecDeque;

/// Samples of the envelope during the search: a period off by 1/200 hides a loss in 200.
pub(crate) const SEARCH_QUEUE: usize = 64;
/// Samples from whose least envelope a rise counts.
pub(crate) const MEMORY: usize = 16;
/// For coarse stamps, in widths of the lateness.
const TICKS_IN_MEMORY: f64 = 12.0;
/// Width of coarse stamps, periods.
pub(crate) const COARSE: f64 = 0.6;
/// Rise of a loss, periods; coarse stamps move the envelope by up to half a period.
pub(crate) const LOSS: f64 = 0.5;
const COARSE_LOSS: f64 = 0.7;
/// Least interval of a loss, periods.
pub(crate) const LONG: f64 = 1.5;

/// Growth of the lateness, periods, less the tick.
pub(crate) fn least_growth(tick: Option<f64>) -> f64 {
    LONG - 1.0 - tick.unwrap_or(0.0)
}

/// Distance from whole periods below which only a loss explains a rise.
pub(crate) const CERTAIN: f64 = 0.3;
const MAX_REFINEMENTS: usize = 12;
/// Relative; 4e-4 would be a tenth of a period in a queue of 256.
const CONVERGED: f64 = 2e-5;
/// Fewest losses compared with independent ones.
const MIN_COMPARED: usize = 8;
const INDEPENDENT: f64 = 2.0;
/// Parts of the record, and most samples, of a window.
const WINDOWS: usize = 32;
const LONGEST_WINDOW: usize = 512;
/// Drift of 100 ppm moves by a fifth of a period.
const COST_BLOCK: usize = 2048;
/// Periods; more order is no evidence.
const ORDER: f64 = 0.1;
/// In widths.
const UNIFORM_MEDIAN_DEVIATION: f64 = 0.25;
/// Blocks for the rate's interval.
const BLOCKS: usize = 16;
/// Relative; rounding in f64.
pub(crate) const MIN_RATE_ERROR: f64 = 1e-9;

/// Sample rate with its interval by the stamps' clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateEstimate {
    /// Least-squares slope, Hz.
    pub hz: f64,
    pub low_hz: f64,
    pub high_hz: f64,
}

impl RateEstimate {
    /// `None` without a time span.
    pub(crate) fn new(hz: f64, low_hz: f64, high_hz: f64) -> Option<Self> {
        (hz.is_finite() && hz > 0.0).then_some(Self { hz, low_hz, high_hz })
    }
}

/// Samples that were lost between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LostStretch {
    /// Sample behind the loss; coarse stamps may be some ticks late.
    pub before: usize,
    /// Sample periods without a sample.
    pub missing: u64,
    pub certain: bool,
}

pub(crate) struct Track {
    pub(crate) period_s: f64,
    pub(crate) periods: Vec<u64>,
    /// Above the envelope, periods.
    above: Vec<f64>,
    pub(crate) losses: Vec<LostStretch>,
    pub(crate) width: f64,
    /// Rises without a long interval: no losses.
    pub(crate) gentle_rises: usize,
}

impl Track {
    /// Aligns until the period stays; returns the shortest description with its cost.
    pub(crate) fn refined(
        times: &[f64],
        period_s: f64,
        tick_s: Option<f64>,
        (queue, least): (usize, u64),
    ) -> (f64, Self) {
        let track = Self::new(times, period_s, tick_s, (queue, least));
        let (mut period_s, mut slope_s) = (period_s, track.slope_s(times));
        let mut best = (track.cost(times, tick_s), track);
        for _ in 0..MAX_REFINEMENTS {
            let Some(next_s) = slope_s.filter(|slope_s| (slope_s / period_s - 1.0).abs() >= CONVERGED) else { break };
            let track = Self::new(times, next_s, tick_s, (queue, least));
            (period_s, slope_s) = (next_s, track.slope_s(times));
            let cost = track.cost(times, tick_s);
            if cost < best.0 {
                best = (cost, track);
            }
        }
        best
    }

    pub(crate) fn new(times: &[f64], period_s: f64, tick_s: Option<f64>, (queue, least): (usize, u64)) -> Self {
        Self::of_lateness(lateness(times, period_s), period_s, tick_s, (queue, least))
    }

    /// Losses in reversed order, which are late deliveries; as many rises are late deliveries too.
    pub(crate) fn falls(&self, times: &[f64], queue: usize) -> Vec<LostStretch> {
        let mut opposite = lateness(times, self.period_s);
        for ((at, late), period) in opposite.iter_mut().enumerate().zip(&self.periods) {
            *late -= (period - at as u64) as f64;
        }
        opposite.reverse();
        Self::of_lateness(opposite, self.period_s, None, (queue, 1)).losses
    }

    fn of_lateness(lateness: Vec<f64>, period_s: f64, tick_s: Option<f64>, (queue, least): (usize, u64)) -> Self {
        let samples = lateness.len();
        let near = minimum_ahead(&lateness, SEARCH_QUEUE);
        // A loss makes a long interval in any order.
        let least_growth = least_growth(tick_s.map(|tick_s| tick_s / period_s));
        let is_long: Vec<bool> = lateness.windows(2).map(|pair| pair[1] - pair[0] >= least_growth).collect();
        let mut above: Vec<f64> = lateness.iter().zip(&near).map(|(late, least)| late - least).collect();
        // Uniform lateness: three quarters are below 3/4 of its width.
        let quartile = quantile(&mut above, 3, 4) * 4.0 / 3.0;
        drop(above);
        let width = tick_s.map_or(quartile, |tick| quartile.max((tick / period_s).min(quartile * 2.0)));
        let is_coarse = width >= COARSE;
        let (memory, threshold) = if is_coarse {
            (((TICKS_IN_MEMORY * width) as usize).clamp(MEMORY, samples.max(MEMORY)), COARSE_LOSS)
        } else {
            (MEMORY, LOSS)
        };
        let threshold = threshold + least.saturating_sub(1) as f64;
        let is_abrupt = |at: usize| {
            let near = at.saturating_sub(memory)..(at + 1).min(is_long.len());
            is_long[near].contains(&true)
        };
        let envelope = if queue.max(memory) == SEARCH_QUEUE {
            near
        } else {
            drop(near);
            minimum_ahead(&lateness, queue.max(memory))
        };
        // The last ticks cannot show a loss.
        let undecided = if is_coarse { (2.0 * width).ceil() as usize + 1 } else { 0 };
        let last = samples.saturating_sub(undecided + 1);
        let periods = Vec::with_capacity(samples);
        let mut track = Self { period_s, periods, above: lateness, losses: Vec::new(), width, gentle_rises: 0 };
        let mut gentle_until = 0;
        let mut level = MinimumBehind::new(memory);
        let mut missing = 0u64;
        for at in 0..samples {
            let lowest = envelope[at.min(last)];
            let excess = level.minimum().map_or(0.0, |level| lowest - missing as f64 - level);
            // Few ticks remain.
            let threshold = if is_coarse && at + memory > samples { threshold + 1.0 } else { threshold };
            if excess >= threshold && !is_abrupt(at) {
                track.gentle_rises += usize::from(at >= gentle_until);
                gentle_until = at + memory;
            } else if excess >= threshold {
                // Saturates.
                let lost = (excess.round() as u64).max(1);
                missing = missing.saturating_add(lost);
                let certain = (excess - excess.round()).abs() < CERTAIN;
                // Stamps within two ticks do not separate losses.
                match track.losses.last_mut().filter(|last| at - last.before <= undecided) {
                    Some(last) => {
                        *last = LostStretch { missing: last.missing.saturating_add(lost), certain: true, ..*last };
                    }
                    None => track.losses.push(LostStretch { before: at, missing: lost, certain }),
                }
            }
            level.push(lowest - missing as f64);
            track.periods.push(missing.saturating_add(at as u64));
            track.above[at] -= missing as f64;
            track.above[at] -= level.minimum().unwrap_or(0.0);
        }
        track
    }

    /// True if losses are as independent as the durations, with `persistent` s² per sample, allow.
    pub(crate) fn are_losses_independent(&self, persistent: f64) -> bool {
        let samples = self.periods.len() as f64;
        let (sum, squares) = self.losses.iter().fold((0.0, 0.0), |(sum, squares): (f64, f64), loss| {
            let missing = loss.missing as f64;
            (sum + missing, squares + missing * missing)
        });
        let variance = (squares - sum * sum / samples) / samples * self.period_s * self.period_s;
        self.losses.len() < MIN_COMPARED || variance <= INDEPENDENT * persistent
    }

    pub(crate) fn complete(times: &[f64], other: &Self) -> Self {
        let periods: Vec<u64> = (0..times.len() as u64).collect();
        let slope_s = slope(&periods, times, |_| true).unwrap_or(other.period_s);
        let above = lateness(times, slope_s);
        Self {
            period_s: slope_s,
            periods,
            above: vec![0.0; above.len()],
            losses: Vec::new(),
            width: other.width.max(1.0),
            gentle_rises: 0,
        }
    }

    pub(crate) fn is_late(&self, at: usize) -> bool {
        self.above[at] >= 1.0 + if self.width < COARSE { 0.0 } else { self.width }
    }

    /// By samples that are not late, s.
    pub(crate) fn slope_s(&self, times: &[f64]) -> Option<f64> {
        slope(&self.periods, times, |at| !self.is_late(at))
    }

    /// Description length, nats, over that without a clock, to 1 s; by the first sample of each tick.
    pub(crate) fn cost(&self, times: &[f64], tick_s: Option<f64>) -> f64 {
        let mut residuals = lateness(times, self.period_s);
        for ((at, residual), period) in residuals.iter_mut().enumerate().zip(&self.periods) {
            *residual -= (period - at as u64) as f64;
        }
        let tick = tick_s.map_or(1.0, |tick| tick / self.period_s).max(1.0);
        let mut residuals = minimum_ahead(&residuals, (tick.ceil() as usize).min(times.len()));
        let mut scratch = Vec::new();
        for block in residuals.chunks_mut(COST_BLOCK) {
            scratch.clear();
            scratch.extend_from_slice(block);
            let middle = quantile(&mut scratch, 1, 2);
            block.iter_mut().for_each(|residual| *residual = (*residual - middle).abs());
        }
        let scatter = quantile(&mut residuals, 1, 2);
        let rounding = tick_s.map_or(0.0, |tick| UNIFORM_MEDIAN_DEVIATION * (tick / self.period_s).min(1.0));
        let samples = times.len() as f64;
        samples / tick * (scatter.max(rounding).max(ORDER) * self.period_s).ln() + cost_of(&self.losses, samples)
    }

    /// Range of 16 blocks' mean residuals over the length: four standard errors, or the drift.
    pub(crate) fn slope_error(&self, times: &[f64], slope_s: f64) -> f64 {
        let on_time: Vec<usize> = (0..times.len()).filter(|at| !self.is_late(*at)).collect();
        let range = range_of_blocks(&on_time, |at| (times[at] - times[0]) / slope_s - self.periods[at] as f64);
        let span = self.periods.last().map_or(1.0, |&last| (last as f64).max(1.0));
        // Ticks near a fraction of the period move the line.
        let rounding = if self.width < COARSE { self.width } else { self.width / (on_time.len() as f64).sqrt() };
        range.max(rounding) / span + MIN_RATE_ERROR
    }
}

/// Range of the mean residuals of 16 blocks of `positions`.
pub(crate) fn range_of_blocks(positions: &[usize], residual: impl Fn(usize) -> f64) -> f64 {
    let means = positions
        .chunks_exact((positions.len() / BLOCKS).max(1))
        .map(|block| block.iter().map(|&at| residual(at)).sum::<f64>() / block.len() as f64);
    let (low, high) =
        means.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), mean| (mean.min(low), mean.max(high)));
    high - low
}

/// Positions, and geometric lengths.
fn cost_of(losses: &[LostStretch], samples: f64) -> f64 {
    let entropy = |part: f64| {
        let terms = [part, 1.0 - part].map(|part| if part > 0.0 { -part * part.ln() } else { 0.0 });
        terms[0] + terms[1]
    };
    let count = losses.len() as f64;
    let missing: f64 = losses.iter().map(|loss| loss.missing as f64).sum();
    if missing > 0.0 { samples * entropy((count / samples).min(1.0)) + missing * entropy(count / missing) } else { 0.0 }
}

/// Variance of long windows over their length, s².
pub(crate) fn persistent_variance(times: &[f64]) -> f64 {
    let window = (times.len() / WINDOWS).clamp(1, LONGEST_WINDOW);
    let durations = || times.windows(window + 1).map(|row| row[window] - row[0]);
    let count = durations().count().max(1) as f64;
    let mean = durations().sum::<f64>() / count;
    durations().map(|duration| (duration - mean) * (duration - mean)).sum::<f64>() / count / window as f64
}

/// Periods from the first sample.
fn lateness(times: &[f64], period_s: f64) -> Vec<f64> {
    let origin = times.first().copied().unwrap_or(0.0);
    times.iter().enumerate().map(|(at, time)| (time - origin) / period_s - at as f64).collect()
}

/// Value below which `parts`/`of` lie; 0 without values.
pub fn quantile(values: &mut [f64], parts: usize, of: usize) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = ((values.len() - 1) as u64 * parts as u64 / of as u64) as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// Least-squares slope, s, of `admitted` samples; `None` without a span.
pub(crate) fn slope(periods: &[u64], times: &[f64], admitted: impl Fn(usize) -> bool) -> Option<f64> {
    let (&first_period, &first_time) = (periods.first()?, times.first()?);
    // Relative to the first, for digits.
    let points = || {
        periods
            .iter()
            .zip(times)
            .enumerate()
            .filter(|(at, _)| admitted(*at))
            .map(|(_, (period, time))| ((period - first_period) as f64, time - first_time))
    };
    let n = points().count() as f64;
    let (sum_x, sum_y) = points().fold((0.0, 0.0), |(x, y), (period, time)| (x + period, y + time));
    let (mean_x, mean_y) = (sum_x / n, sum_y / n);
    let (xx, xy) = points().fold((0.0, 0.0), |(xx, xy), (period, time)| {
        let x = period - mean_x;
        (xx + x * x, xy + x * (time - mean_y))
    });
    let slope_s = xy / xx;
    (slope_s.is_finite() && slope_s > 0.0).then_some(slope_s)
}

/// For each value and the `window − 1` after it.
pub(crate) fn minimum_ahead(values: &[f64], window: usize) -> Vec<f64> {
    let mut least = vec![0.0; values.len()];
    // Increasing positions; the back is the minimum.
    let mut candidates: VecDeque<usize> = VecDeque::with_capacity(window.min(values.len()));
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

pub(crate) struct MinimumBehind {
    window: usize,
    pushed: usize,
    /// Increasing, with numbers; the front is the minimum.
    candidates: VecDeque<(usize, f64)>,
}

impl MinimumBehind {
    /// `window` is at least 1.
    pub(crate) fn new(window: usize) -> Self {
        Self { window, pushed: 0, candidates: VecDeque::new() }
    }

    pub(crate) fn push(&mut self, value: f64) {
        while self.candidates.back().is_some_and(|&(_, newest)| newest >= value) {
            self.candidates.pop_back();
        }
        self.candidates.push_back((self.pushed, value));
        self.pushed += 1;
        while self.candidates.front().is_some_and(|&(number, _)| number + self.window < self.pushed) {
            self.candidates.pop_front();
        }
    }

    /// The minimum; `None` before the first value.
    pub(crate) fn minimum(&self) -> Option<f64> {
        self.candidates.front().map(|&(_, least)| least)
    }
}
