//! The lateness of the samples against periods of a given length: its lower envelope, the losses that lift it, and how short
//! a description of the time stamps they are.

use crate::lower_envelope::{MinimumBehind, minimum_ahead};

/// Samples over which the lower envelope is sought while the period is: a period that is wrong by a part in 200 hides a loss in a window of 200 samples.
pub(crate) const SEARCH_QUEUE: usize = 64;
/// Samples whose least envelope a rise of the envelope is measured from: a period that is wrong by a part in 32 causes no
/// false loss.
pub(crate) const MEMORY: usize = 16;
/// The same where stamps are coarse, in widths of the lateness: so many ticks tell where the envelope is.
const TICKS_IN_MEMORY: f64 = 12.0;
/// Width of the lateness, in periods, from which stamps count as coarse.
pub(crate) const COARSE: f64 = 0.6;
/// Rise of the envelope, in periods, that is a loss. Coarse stamps move the envelope by up to half a period, where two
/// ticks are nearly an odd number of periods.
pub(crate) const LOSS: f64 = 0.5;
const COARSE_LOSS: f64 = 0.7;
/// Interval, in periods, that a lost sample makes at least.
pub(crate) const LONG: f64 = 1.5;

/// Growth of the lateness in such an interval, in periods; rounding takes a tick, also in periods.
pub(crate) fn least_growth(tick: Option<f64>) -> f64 {
    LONG - 1.0 - tick.unwrap_or(0.0)
}

/// Distance of a rise from a whole number of periods below which nothing but a loss explains it.
pub(crate) const CERTAIN: f64 = 0.3;
/// Times that an estimate of the period is improved by the alignment that it gives.
const MAX_REFINEMENTS: usize = 12;
/// Relative change of the period with which it is good enough to align by: a tenth of a period in a queue of 256 would be 4e-4.
const CONVERGED: f64 = 2e-5;
/// Fewest losses whose lengths and distances are compared with those of independent ones.
const MIN_COMPARED: usize = 8;
/// Largest variance that losses add to the duration of many samples, in that which this duration has and which 32 windows or more tell to
/// a quarter.
const INDEPENDENT: f64 = 2.0;
/// Parts of the record, and most samples, of a window whose duration tells what the samples in it have in common.
const WINDOWS: usize = 32;
const LONGEST_WINDOW: usize = 512;
/// Samples over which the scatter of the lateness is measured: a clock that drifts by 100 ppm moves by a fifth of a period.
const COST_BLOCK: usize = 2048;
/// Median scatter of the lateness, in periods, below which more order is no evidence.
const ORDER: f64 = 0.1;
/// The median deviation from the median of a uniform distribution, in widths.
const UNIFORM_MEDIAN_DEVIATION: f64 = 0.25;
/// Blocks of the record whose mean residuals give the interval of the rate.
const BLOCKS: usize = 16;
/// Smallest relative half-width of the interval of a rate: the rounding of a time in f64 over a record of some samples.
const MIN_RATE_ERROR: f64 = 1e-9;

/// Samples that were lost between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LostStretch {
    /// Position in the recording of the sample after the loss. With coarse stamps the loss may be some ticks before.
    pub before: usize,
    /// Sample periods without a sample.
    pub missing: u64,
    /// True if nothing but a loss explains the stamps.
    pub certain: bool,
}

/// An alignment to periods of a given length.
pub(crate) struct Track {
    pub(crate) period_s: f64,
    pub(crate) periods: Vec<u64>,
    /// Lateness above the envelope's phase, periods.
    above: Vec<f64>,
    pub(crate) losses: Vec<LostStretch>,
    pub(crate) width: f64,
    /// Rises of the envelope without a long interval near them, which are no losses.
    pub(crate) gentle_rises: usize,
}

impl Track {
    /// Aligns with a period, and again with the period that the alignment shows, until the period stays. Returns, of these alignments,
    /// the one with the shortest description; with its cost. The envelope is sought over `queue` samples, and losses of fewer than `least`
    /// samples are none.
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

    /// Aligns `times` to periods of `period_s`, as [`refined`](Self::refined) does.
    pub(crate) fn new(times: &[f64], period_s: f64, tick_s: Option<f64>, (queue, least): (usize, u64)) -> Self {
        Self::of_lateness(lateness(times, period_s), period_s, tick_s, (queue, least))
    }

    /// Events that would be losses if the samples of this alignment came in the opposite order. A loss lifts the lateness for
    /// good and nothing lowers it for good, so that these are late deliveries; as many rises of the envelope are late deliveries too.
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
        // A lost sample makes an interval long, in whatever order and however late the others are read.
        let least_growth = least_growth(tick_s.map(|tick_s| tick_s / period_s));
        let is_long: Vec<bool> = lateness.windows(2).map(|pair| pair[1] - pair[0] >= least_growth).collect();
        let mut above: Vec<f64> = lateness.iter().zip(&near).map(|(late, least)| late - least).collect();
        // Three quarters of a uniform lateness are below 3/4 of its width; late deliveries are fewer than the fourth.
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
        // In the last ticks no later sample tells how far the envelope is: no loss is found there.
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
            // Towards the end the envelope is that of fewer ticks, and may rise by a period without a loss.
            let threshold = if is_coarse && at + memory > samples { threshold + 1.0 } else { threshold };
            if excess >= threshold && !is_abrupt(at) {
                track.gentle_rises += usize::from(at >= gentle_until);
                gentle_until = at + memory;
            } else if excess >= threshold {
                // A float beyond the range of u64 saturates.
                let lost = (excess.round() as u64).max(1);
                missing = missing.saturating_add(lost);
                let certain = (excess - excess.round()).abs() < CERTAIN;
                // Stamps within a tick or two do not tell one loss from two.
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

    /// True if the losses are as independent of each other as the durations of many samples let them be, which gain `persistent` s² of
    /// variance a sample. Samples that wait and then come together, and stamps that beat, look like losses at distances that make up for
    /// each other.
    pub(crate) fn are_losses_independent(&self, persistent: f64) -> bool {
        let samples = self.periods.len() as f64;
        let (sum, squares) = self.losses.iter().fold((0.0, 0.0), |(sum, squares): (f64, f64), loss| {
            let missing = loss.missing as f64;
            (sum + missing, squares + missing * missing)
        });
        let variance = (squares - sum * sum / samples) / samples * self.period_s * self.period_s;
        self.losses.len() < MIN_COMPARED || variance <= INDEPENDENT * persistent
    }

    /// The samples of `other` without a loss between them.
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

    /// Period by the samples that are not late, s.
    pub(crate) fn slope_s(&self, times: &[f64]) -> Option<f64> {
        slope(&self.periods, times, |at| !self.is_late(at))
    }

    /// Description length of the stamps by this alignment, natural units of information, less that of a stamp without a clock, to within
    /// 1 s.
    ///
    /// It is that of the samples which are stamped first after they were taken, one a tick. Their scatter is measured around
    /// the middle of each block of the record and not around the envelope, which follows a wrong period.
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

    /// Relative error of the slope: the range of the mean residuals of 16 blocks, over the length of the record. Four standard
    /// errors where the residuals are independent; a clock that drifts widens it by its drift.
    pub(crate) fn slope_error(&self, times: &[f64], slope_s: f64) -> f64 {
        let on_time: Vec<usize> = (0..times.len()).filter(|at| !self.is_late(*at)).collect();
        let length = (on_time.len() / BLOCKS).max(1);
        let mean = |block: &[usize]| {
            block.iter().map(|&at| (times[at] - times[0]) / slope_s - self.periods[at] as f64).sum::<f64>()
                / block.len() as f64
        };
        let (low, high) = on_time
            .chunks_exact(length)
            .map(mean)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), mean| (mean.min(low), mean.max(high)));
        let span = self.periods.last().map_or(1.0, |&last| (last as f64).max(1.0));
        // Ticks that are no fraction of the period fall evenly over it; those that nearly are move the line by up to one.
        let rounding = if self.width < COARSE { self.width } else { self.width / (on_time.len() as f64).sqrt() };
        (high - low).max(rounding) / span + MIN_RATE_ERROR
    }
}

/// Description length of losses among so many samples: before which samples they are, and their lengths, of a geometric distribution
/// with their mean.
fn cost_of(losses: &[LostStretch], samples: f64) -> f64 {
    let entropy = |part: f64| {
        let terms = [part, 1.0 - part].map(|part| if part > 0.0 { -part * part.ln() } else { 0.0 });
        terms[0] + terms[1]
    };
    let count = losses.len() as f64;
    let missing: f64 = losses.iter().map(|loss| loss.missing as f64).sum();
    if missing > 0.0 { samples * entropy((count / samples).min(1.0)) + missing * entropy(count / missing) } else { 0.0 }
}

/// The variance in s² that a sample adds to the duration of many: that of the durations of long windows, over their length.
pub(crate) fn persistent_variance(times: &[f64]) -> f64 {
    let window = (times.len() / WINDOWS).clamp(1, LONGEST_WINDOW);
    let durations = || times.windows(window + 1).map(|row| row[window] - row[0]);
    let count = durations().count().max(1) as f64;
    let mean = durations().sum::<f64>() / count;
    durations().map(|duration| (duration - mean) * (duration - mean)).sum::<f64>() / count / window as f64
}

/// How many periods after its turn each sample was stamped, from the first sample.
fn lateness(times: &[f64], period_s: f64) -> Vec<f64> {
    let origin = times.first().copied().unwrap_or(0.0);
    times.iter().enumerate().map(|(at, time)| (time - origin) / period_s - at as f64).collect()
}

/// The value below which `parts` of `of` of the values lie; 0 without values.
pub fn quantile(values: &mut [f64], parts: usize, of: usize) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = ((values.len() - 1) as u64 * parts as u64 / of as u64) as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// Slope in s of the least-squares line of time over period, for the samples that `admitted` selects. `None` if they span
/// no time.
pub(crate) fn slope(periods: &[u64], times: &[f64], admitted: impl Fn(usize) -> bool) -> Option<f64> {
    let (&first_period, &first_time) = (periods.first()?, times.first()?);
    // Relative to the first sample: a late origin would cost digits.
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
