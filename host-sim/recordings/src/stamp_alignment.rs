//! Time stamps aligned to sample periods: the period, its interval, and which samples were lost or came late.
//!
//! A sample is read after it was taken, never before. Its lateness `c_i = t_i/T − i`, in sample periods `T`, therefore has a
//! lower envelope: the number of samples that were lost before sample `i`. A stall of the host lifts `c` above the envelope
//! until the queue is empty; a lost sample lifts the envelope itself by one for the rest of the record. Stamps that are
//! coarser than the period spread `c` over several periods, but their envelope stays: the samples that are stamped just
//! after they were taken.
//!
//! The period is not known beforehand. Several estimates of it are tried, each improved until it explains itself, and the
//! one that needs the shortest description wins: the scatter of the lateness, no part of it below the tick of the stamps
//! being worth anything, and the losses.

use crate::lower_envelope::{MinimumBehind, minimum_ahead};
use crate::stamp_tick::tick;

/// Samples over which the lower envelope of the lateness is sought: the deepest queue whose late delivery is distinguished
/// from a loss. The last samples of a record have fewer after them, so there a late delivery may count as a loss.
const MAX_QUEUE: usize = 256;
/// The same while the period is sought: a period that is wrong by a part in 200 hides a loss in a window of 200 samples.
const SEARCH_QUEUE: usize = 64;

/// Samples whose least envelope a rise of the envelope is measured from: a period that is wrong by a part in 32 causes no
/// false loss.
const MEMORY: usize = 16;
/// The same where stamps are coarse, in widths of the lateness: so many ticks tell where the envelope is.
const TICKS_IN_MEMORY: f64 = 12.0;

/// Width of the lateness, in periods, from which stamps count as coarse.
const COARSE: f64 = 0.6;

/// Rise of the envelope, in periods, that is a loss. Coarse stamps move the envelope by up to half a period, where two
/// ticks are nearly an odd number of periods.
const LOSS: f64 = 0.5;
const COARSE_LOSS: f64 = 0.7;

/// Lengths, in samples, of the windows whose durations give estimates of the period.
const WINDOWS: [usize; 6] = [1, 8, 32, 128, 512, 2048];
/// Largest difference of their durations, in periods, that counts as jitter. Intervals of samples that have queued up are
/// shorter, those across gaps and stalls longer.
const NEAR: f64 = 0.6;
/// Samples at the start of the record in which the period is sought, before it is improved with all of them.
const SEARCHED: usize = 100_000;
/// Of these the samples, and the relative steps, in which it is sought where stamps are coarse and samples are lost.
const SCANNED: usize = 20_000;
const SCAN_STEP: f64 = 1e-3;
const SCAN_STEPS: u32 = 80;

/// Largest relative difference of a period from the stated one.
const MAX_CLOCK_ERROR: f64 = 0.1;

/// Times that an estimate of the period is improved by the alignment that it gives.
const MAX_REFINEMENTS: usize = 12;
/// Relative change of the period with which it is good enough to align by: a tenth of a period in a queue of 256 would be 4e-4.
const CONVERGED: f64 = 2e-5;

/// Share of losses up to which an alignment of fine stamps is taken without looking for a better one.
const CLEAR: f64 = 0.02;

/// Cost of a loss beside that of the scatter, natural units of information. More than a position and a length take, because
/// losses are rare.
const LOSS_COST: f64 = 9.0;
/// Samples over which the scatter of the lateness is measured: a clock that drifts by 100 ppm moves by a fifth of a period.
const COST_BLOCK: usize = 2048;
/// Median scatter of the lateness, in periods, below which more order is no evidence.
const ORDER: f64 = 0.1;
/// The median deviation from the median of a uniform distribution, in widths.
const UNIFORM_MEDIAN_DEVIATION: f64 = 0.25;

/// Distance of the tick from a whole number of periods below which the two beat: the stamps step over a period once in a beat.
const BEAT: f64 = 0.1;
/// Fewest steps that are taken for a beat. Two losses always lie at equal distances.
const MIN_BEATS: usize = 3;
/// Scatter of the steps of a beat around a line, periods.
const BEAT_SCATTER: f64 = 1.25;

/// Fewest ticks between two losses, on average, with which single losses are told from the rounding of the stamps: with fewer
/// up to two thirds of them were not found in generated records.
const MIN_TICKS_BETWEEN_LOSSES: f64 = 16.0;
/// Losses that may have been overlooked there for each one that was found.
const OVERLOOKED: f64 = 4.0;

/// Blocks of the record whose mean residuals give the interval of the rate.
const BLOCKS: usize = 16;
/// Smallest relative half-width of the interval of a rate: the rounding of a time in f64 over a record of some samples.
const MIN_RATE_ERROR: f64 = 1e-9;

/// A sample rate with the interval that the time stamps leave it, by the clock that stamped them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateEstimate {
    /// Least-squares slope of the sample periods over the time stamps, Hz.
    pub hz: f64,
    /// Lower end, Hz.
    pub low_hz: f64,
    /// Upper end, Hz.
    pub high_hz: f64,
}

/// Samples that were lost between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Loss {
    /// Position of the sample after the loss. With coarse stamps the loss may be some ticks before.
    pub before: usize,
    /// Sample periods without a sample.
    pub missing: u64,
    /// Whether nothing but a loss explains the stamps.
    pub certain: bool,
}

/// Time stamps on sample periods.
pub(crate) struct StampAlignment {
    /// Period of each sample, counted from the first; grows by at least one a sample.
    pub(crate) periods: Vec<u64>,
    /// Samples that were read a period or more after the others.
    pub(crate) late: Vec<bool>,
    /// The losses, in their order.
    pub(crate) losses: Vec<Loss>,
    /// The rate; `None` if the samples span no time.
    pub(crate) rate: Option<RateEstimate>,
    /// Smallest step of the stamps that all of them are multiples of, s; `None` where it is far below the period.
    pub(crate) tick_s: Option<f64>,
    /// Width of the lateness of ordinary samples, periods.
    pub(crate) width: f64,
    /// Whether single losses are told from the rounding of the stamps.
    pub(crate) resolved: bool,
}

impl StampAlignment {
    /// Aligns `times` (s, not decreasing). A stated rate in Hz is believed to within 10 %.
    ///
    /// `None` where no period in this range can be seen in them.
    pub(crate) fn new(times: &[f64], stated_hz: Option<f64>) -> Option<Self> {
        let tick_s = tick(times);
        let stated_s = stated_hz.map(f64::recip);
        let period_s = search(times, stated_s, tick_s)?;
        let (_, mut track) = Track::refined(times, period_s, tick_s, MAX_QUEUE);
        let ticks_per_period = tick_s.map(|tick| tick / track.period_s);
        // Whether the tick is near a whole number of periods, at least one.
        let beats = match ticks_per_period {
            Some(periods) => periods > 0.5 && (periods - periods.round()).abs() < BEAT,
            None => track.width >= COARSE || track.losses.len() as f64 > CLEAR * times.len() as f64,
        };
        if beats && is_beat(&track.losses, times.len()) {
            track = Track::complete(times, &track);
        } else if beats {
            for loss in &mut track.losses {
                loss.certain &= loss.missing > 1;
            }
        }
        Some(track.finish(times, tick_s))
    }
}

/// The period, s, whose alignment describes the start of the record most shortly.
fn search(times: &[f64], stated_s: Option<f64>, tick_s: Option<f64>) -> Option<f64> {
    let first = &times[..times.len().min(SEARCHED)];
    let is_plausible = |period_s: f64| {
        let is_near = stated_s.is_none_or(|stated| (period_s / stated - 1.0).abs() <= MAX_CLOCK_ERROR);
        is_near && period_s.is_finite() && period_s > 0.0
    };
    let mut tried: Vec<f64> = Vec::new();
    let mut best: Option<(f64, Track)> = None;
    let estimates = period_estimates(first, tick_s);
    for period_s in stated_s.into_iter().chain(estimates.iter().copied()) {
        if !is_plausible(period_s) || tried.iter().any(|other| (period_s / other - 1.0).abs() < 1e-4) {
            continue;
        }
        tried.push(period_s);
        let refined = Track::refined(first, period_s, tick_s, SEARCH_QUEUE);
        if is_plausible(refined.1.period_s) && best.as_ref().is_none_or(|(least, _)| refined.0 < *least) {
            best = Some(refined);
        }
        // Fine stamps with few losses leave no doubt.
        let is_clear =
            |(_, track): &(f64, Track)| track.width < COARSE && track.losses.len() as f64 <= CLEAR * first.len() as f64;
        if best.as_ref().is_some_and(is_clear) {
            break;
        }
    }
    let Some((_, found)) = best else { return stated_s.or_else(|| tried.first().copied()) };
    if found.width < COARSE || found.losses.is_empty() {
        return Some(found.period_s);
    }
    // With many losses most windows are longer than their samples: shorter periods are tried, one after the other.
    let scanned = &first[..first.len().min(SCANNED)];
    let longest_s = estimates.last().copied().filter(|period_s| is_plausible(*period_s)).unwrap_or(found.period_s);
    let starts = (0..SCAN_STEPS).map(|step| longest_s * (1.0 - SCAN_STEP * f64::from(step)));
    let once_refined = |period_s: f64| {
        let track = Track::new(scanned, period_s, tick_s, SEARCH_QUEUE);
        let slope_s = track.slope_s(scanned).filter(|slope_s| is_plausible(*slope_s))?;
        Some((Track::new(scanned, slope_s, tick_s, SEARCH_QUEUE).cost(scanned, tick_s), slope_s))
    };
    let least = starts.filter_map(once_refined).min_by(|a, b| a.0.total_cmp(&b.0));
    let found_cost = found.cost(first, tick_s);
    let better = least
        .map(|(_, period_s)| Track::refined(first, period_s, tick_s, SEARCH_QUEUE))
        .filter(|(cost, track)| *cost < found_cost && is_plausible(track.period_s));
    Some(better.map_or(found.period_s, |(_, track)| track.period_s))
}

/// Estimates of the sample period, s, the best where stamps are fine and most intervals are one period first.
///
/// An estimate is the mean duration of the windows of some samples that last about as long as the window in the middle, or
/// at the lower quartile where most windows have losses. The middle alone is biased where jitter is skewed, and a multiple
/// of the tick.
fn period_estimates(times: &[f64], tick_s: Option<f64>) -> Vec<f64> {
    let mut estimates = Vec::new();
    // A window longer than a quarter of the record has too few others to be compared with.
    for window in WINDOWS.into_iter().filter(|window| *window == 1 || 4 * window <= times.len()) {
        let mut durations: Vec<f64> = times.windows(window + 1).map(|row| row[window] - row[0]).collect();
        for (parts, of) in [(1, 2), (1, 4)] {
            let middle = quantile(&mut durations, parts, of);
            let near = (NEAR * middle / window as f64).max(tick_s.unwrap_or(0.0));
            let alike = || durations.iter().filter(|duration| (*duration - middle).abs() <= near);
            estimates.push(alike().sum::<f64>() / (alike().count() * window) as f64);
        }
    }
    estimates
}

/// Whether single losses lie so regularly in a record of `samples` that a slightly longer period explains all of them.
fn is_beat(losses: &[Loss], samples: usize) -> bool {
    let (Some(first), Some(last)) = (losses.first(), losses.last()) else { return false };
    if losses.len() < MIN_BEATS || losses.iter().any(|loss| loss.missing != 1) {
        return false;
    }
    // Losses a sample: the slope that replaces the staircase.
    let slope = (losses.len() - 1) as f64 / (last.before - first.before) as f64;
    let corners = losses.iter().enumerate().flat_map(|(number, loss)| {
        let line = slope * loss.before as f64;
        [number as f64 - line, (number + 1) as f64 - line]
    });
    let ends = [0.0, losses.len() as f64 - slope * samples as f64];
    let (low, high) = corners
        .chain(ends)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), corner| (corner.min(low), corner.max(high)));
    high - low <= BEAT_SCATTER
}

/// An alignment to periods of a given length.
struct Track {
    period_s: f64,
    periods: Vec<u64>,
    /// Lateness above the envelope's phase, periods.
    above: Vec<f64>,
    losses: Vec<Loss>,
    width: f64,
}

impl Track {
    /// Aligns with a period, and again with the period that the alignment shows, until the period stays. Of these alignments
    /// the one with the shortest description; with its cost.
    fn refined(times: &[f64], period_s: f64, tick_s: Option<f64>, queue: usize) -> (f64, Self) {
        let track = Self::new(times, period_s, tick_s, queue);
        let (mut period_s, mut slope_s) = (period_s, track.slope_s(times));
        let mut best = (track.cost(times, tick_s), track);
        for _ in 0..MAX_REFINEMENTS {
            let Some(next_s) = slope_s.filter(|slope_s| (slope_s / period_s - 1.0).abs() >= CONVERGED) else { break };
            let track = Self::new(times, next_s, tick_s, queue);
            (period_s, slope_s) = (next_s, track.slope_s(times));
            let cost = track.cost(times, tick_s);
            if cost < best.0 {
                best = (cost, track);
            }
        }
        best
    }

    /// Aligns `times` to periods of `period_s`.
    fn new(times: &[f64], period_s: f64, tick_s: Option<f64>, queue: usize) -> Self {
        let lateness = lateness(times, period_s);
        let near = minimum_ahead(&lateness, SEARCH_QUEUE);
        let mut above: Vec<f64> = lateness.iter().zip(&near).map(|(late, least)| late - least).collect();
        // Of a uniform lateness three quarters are below 3/4 of its width; late deliveries are fewer than the fourth.
        let quartile = quantile(&mut above, 3, 4) * 4.0 / 3.0;
        let width = tick_s.map_or(quartile, |tick| quartile.max((tick / period_s).min(quartile * 2.0)));
        let is_coarse = width >= COARSE;
        let (memory, threshold) = if is_coarse {
            (((TICKS_IN_MEMORY * width) as usize).clamp(MEMORY, times.len().max(MEMORY)), COARSE_LOSS)
        } else {
            (MEMORY, LOSS)
        };
        let envelope =
            if queue.max(memory) == SEARCH_QUEUE { near } else { minimum_ahead(&lateness, queue.max(memory)) };
        // In the last ticks no later sample tells how far the envelope is: no loss is found there.
        let undecided = if is_coarse { (2.0 * width).ceil() as usize + 1 } else { 0 };
        let last = times.len().saturating_sub(undecided + 1);
        let mut track = Self { period_s, periods: Vec::with_capacity(times.len()), above, losses: Vec::new(), width };
        let mut level = MinimumBehind::new(memory);
        let mut missing = 0u64;
        for (at, late) in lateness.iter().enumerate() {
            let least = envelope[at.min(last)];
            let excess = level.minimum().map_or(0.0, |level| least - missing as f64 - level);
            // Towards the end the envelope is that of fewer ticks, and may rise by a period without a loss.
            let threshold = if is_coarse && at + memory > times.len() { threshold + 1.0 } else { threshold };
            if excess >= threshold {
                // A float beyond the range of u64 saturates.
                let lost = (excess.round() as u64).max(1);
                missing = missing.saturating_add(lost);
                let certain = (excess - excess.round()).abs() < 0.3;
                // Stamps within a tick or two do not tell one loss from two.
                match track.losses.last_mut().filter(|last| at - last.before <= undecided) {
                    Some(last) => {
                        *last = Loss { missing: last.missing.saturating_add(lost), certain: true, ..*last };
                    }
                    None => track.losses.push(Loss { before: at, missing: lost, certain }),
                }
            }
            level.push(least - missing as f64);
            track.periods.push(missing.saturating_add(at as u64));
            track.above[at] = late - missing as f64 - level.minimum().unwrap_or(0.0);
        }
        track
    }

    /// The samples of `other` without a loss between them.
    fn complete(times: &[f64], other: &Self) -> Self {
        let periods: Vec<u64> = (0..times.len() as u64).collect();
        let slope_s = slope(&periods, times, |_| true).unwrap_or(other.period_s);
        let above = lateness(times, slope_s);
        Self {
            period_s: slope_s,
            periods,
            above: vec![0.0; above.len()],
            losses: Vec::new(),
            width: other.width.max(1.0),
        }
    }

    fn is_late(&self, at: usize) -> bool {
        self.above[at] >= 1.0 + if self.width < COARSE { 0.0 } else { self.width }
    }

    /// Period by the samples that are not late, s.
    fn slope_s(&self, times: &[f64]) -> Option<f64> {
        slope(&self.periods, times, |at| !self.is_late(at))
    }

    /// Description length of the stamps by this alignment, natural units of information.
    ///
    /// It is that of the samples which are stamped first after they were taken, one a tick. Their scatter is measured around
    /// the middle of each block of the record and not around the envelope, which follows a wrong period.
    fn cost(&self, times: &[f64], tick_s: Option<f64>) -> f64 {
        let mut residuals = lateness(times, self.period_s);
        for ((at, residual), period) in residuals.iter_mut().enumerate().zip(&self.periods) {
            *residual -= (period - at as u64) as f64;
        }
        let tick = self.width.max(1.0);
        let mut residuals = minimum_ahead(&residuals, tick.ceil() as usize);
        let mut scratch = Vec::new();
        for block in residuals.chunks_mut(COST_BLOCK) {
            scratch.clear();
            scratch.extend_from_slice(block);
            let middle = quantile(&mut scratch, 1, 2);
            block.iter_mut().for_each(|residual| *residual = (*residual - middle).abs());
        }
        let scatter = quantile(&mut residuals, 1, 2);
        let rounding = tick_s.map_or(0.0, |tick| UNIFORM_MEDIAN_DEVIATION * (tick / self.period_s).min(1.0));
        times.len() as f64 / tick * scatter.max(rounding).max(ORDER).ln() + LOSS_COST * self.losses.len() as f64
    }

    fn finish(self, times: &[f64], tick_s: Option<f64>) -> StampAlignment {
        let samples = times.len() as f64;
        let resolved =
            self.width < COARSE || samples >= MIN_TICKS_BETWEEN_LOSSES * self.width * self.losses.len() as f64;
        // Of losses that lie within a tick of each other the stamps show the sum at best; so many do if they are random.
        let events = self.losses.len() as f64;
        let confused = if self.width < COARSE { 0.0 } else { events * events * self.width / samples };
        let surplus = uncertain(&self.losses, resolved) as f64 + confused;
        let rate = self.slope_s(times).and_then(|slope_s| {
            let error = self.slope_error(times, slope_s);
            let hz = slope_s.recip();
            // If the uncertain losses are none, the samples were taken at a lower rate; if some were overlooked, at a higher.
            let rows_only = 1.0 - surplus / (samples + surplus);
            let overlooked = if resolved { confused } else { confused + OVERLOOKED * surplus };
            let rate = RateEstimate {
                hz,
                low_hz: hz * (1.0 - error) * rows_only,
                high_hz: hz * (1.0 + error) * (1.0 + overlooked / samples),
            };
            (hz.is_finite() && hz > 0.0).then_some(rate)
        });
        let late = (0..times.len()).map(|at| self.is_late(at)).collect();
        let Self { periods, losses, width, .. } = self;
        StampAlignment { periods, late, losses, rate, tick_s, width, resolved }
    }

    /// Relative error of the slope: the range of the mean residuals of 16 blocks, over the length of the record. Four standard
    /// errors where the residuals are independent; a clock that drifts widens it by its drift.
    fn slope_error(&self, times: &[f64], slope_s: f64) -> f64 {
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

/// Samples in losses that something else may explain: of a long loss that is uncertain one sample.
pub(crate) fn uncertain(losses: &[Loss], resolved: bool) -> u64 {
    let samples = losses.iter().map(|loss| if resolved { u64::from(!loss.certain) } else { loss.missing });
    samples.fold(0, u64::saturating_add)
}

/// How many periods after its turn each sample was stamped, from the first sample.
fn lateness(times: &[f64], period_s: f64) -> Vec<f64> {
    let origin = times.first().copied().unwrap_or(0.0);
    times.iter().enumerate().map(|(at, time)| (time - origin) / period_s - at as f64).collect()
}

/// The value below which `parts` of `of` of the values lie; 0 without values.
fn quantile(values: &mut [f64], parts: usize, of: usize) -> f64 {
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
