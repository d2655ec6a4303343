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

pub(crate) use crate::aligned_stamps::{AlignedStamps, RateEstimate};
use crate::clock_rate::{SteadiedStamps, steadied};
use crate::irregular_stamps::{by_ticks, is_of_many, of_few_digits, of_loop};
use crate::lateness_track::{COARSE, LostStretch, SEARCH_QUEUE, Track, persistent_variance, quantile};
use crate::stamp_tick::tick;

/// Samples over which the lower envelope of the lateness is sought: the deepest queue whose late delivery is distinguished
/// from a loss. The last samples of a record have fewer after them, so there a late delivery may count as a loss.
pub(crate) const MAX_QUEUE: usize = 256;

/// Lengths, in samples, of the windows whose durations give estimates of the period.
const WINDOWS: [usize; 6] = [1, 8, 32, 128, 512, 2048];
/// Largest difference of their durations, in periods, that counts as jitter. Intervals of samples that have queued up are
/// shorter, those across gaps and stalls longer.
const NEAR: f64 = 0.6;
/// Samples at the start of the record in which the period is sought, before it is improved with all of them.
const SEARCHED: usize = 100_000;
/// The samples among these, and the relative steps, in which it is sought where stamps are coarse and samples are lost.
const SCANNED: usize = 20_000;
const SCAN_STEP: f64 = 1e-3;
const SCAN_STEPS: u32 = 80;

/// Largest relative difference of a period from the stated one.
const MAX_CLOCK_ERROR: f64 = 0.1;

/// Rises of the envelope, in its falls, that are losses and not late deliveries; and fewest of them where there is no fall.
const TELLING: usize = 8;
/// Ratio of the third to the first quartile of intervals that are of any length.
const UNLIKE: f64 = 1.5;
/// Ticks in an interval that may be the tick itself.
const FEW_TICKS: f64 = 2.5;
/// Fewest rises of the envelope without a long interval that show a loop, and no clock.
const GENTLE: usize = 3;
/// Probability that the longest rise by chance is taken for a loss.
const FALSE_ALARM: f64 = 1e-3;

/// Share of losses up to which an alignment of fine stamps is taken without looking for a better one.
const CLEAR: f64 = 0.02;

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

impl AlignedStamps {
    /// Aligns `times` (s, not decreasing). A stated rate in Hz is believed to within 10 %.
    ///
    /// `None` where no period in this range can be seen in them.
    pub(crate) fn new(times: &[f64], stated_hz: Option<f64>) -> Option<Self> {
        let tick_s = tick(times);
        if let Some(tick_s) = tick_s.filter(|tick_s| is_of_many(times, *tick_s)) {
            return by_ticks(times, tick_s, stated_hz);
        }
        if let Some(rounded) = of_few_digits(times) {
            return Self::of_steady(&rounded, stated_hz);
        }
        let Some(SteadiedStamps { times: steady, shortest_s, longest_s }) = steadied(times) else {
            let alignment = Self::of_steady(times, stated_hz)?;
            // A stated rate has its own periods.
            let is_free = alignment.is_of_loop && stated_hz.is_none();
            return if is_free { of_loop(times, tick_s) } else { Some(alignment) };
        };
        let mut alignment = Self::of_steady(&steady, stated_hz)?;
        let hz = *alignment.periods.last()? as f64 / (times.last()? - times.first()?);
        let changing = RateEstimate { hz, low_hz: longest_s.recip(), high_hz: shortest_s.recip() };
        alignment.rate = alignment.rate.filter(|_| hz.is_finite() && hz > 0.0).map(|_| changing);
        alignment.is_rate_changing = true;
        Some(alignment)
    }

    /// The same for the stamps of a clock whose rate is constant.
    fn of_steady(times: &[f64], stated_hz: Option<f64>) -> Option<Self> {
        let tick_s = tick(times);
        let stated_s = stated_hz.map(f64::recip);
        let persistent = persistent_variance(times);
        let period_s = search(times, stated_s, tick_s)?;
        let (_, mut track) = Track::refined(times, period_s, tick_s, (MAX_QUEUE, 1));
        let is_of_loop = track.gentle_rises >= GENTLE.max(track.losses.len());
        let ticks_per_period = tick_s.map(|tick| tick / track.period_s);
        let mut least_loss = 1;
        if !track.losses.is_empty() && track.width >= COARSE + 2.0 * ticks_per_period.unwrap_or(0.0) {
            least_loss = least_telling(times, &track);
            if least_loss > 1 {
                let complete = Track::complete(times, &track).period_s;
                (_, track) = Track::refined(times, complete, tick_s, (MAX_QUEUE, least_loss));
            }
        }
        // Whether the tick is near a whole number of periods, at least one.
        let beats = match ticks_per_period {
            Some(periods) => periods > 0.5 && (periods - periods.round()).abs() < BEAT,
            None => track.width >= COARSE || track.losses.len() as f64 > CLEAR * times.len() as f64,
        };
        if beats && is_beat(&track.losses, times.len()) {
            track = Track::complete(times, &track);
        } else if beats && !are_scattered(&track.losses) && !tick_s.is_some_and(|tick_s| is_finer(times, tick_s)) {
            for loss in &mut track.losses {
                loss.certain &= loss.missing > 1;
            }
        }
        // No more single samples can have been lost than make the durations as different as they are.
        let hidden = if least_loss > 1 { persistent / (track.period_s * track.period_s) } else { 0.0 };
        let mut alignment = Self::from_track(track, times, tick_s);
        alignment.rate.iter_mut().for_each(|rate| rate.high_hz *= 1.0 + hidden);
        alignment.least_loss = least_loss;
        alignment.is_of_loop = is_of_loop;
        Some(alignment)
    }

    /// Result of an alignment.
    fn from_track(track: Track, times: &[f64], tick_s: Option<f64>) -> Self {
        let samples = times.len() as f64;
        // Losses that lie within a tick of each other look like one of several samples: an outage is longer than the tick.
        let single: f64 = track.losses.iter().map(|loss| (loss.missing as f64).min(track.width.ceil())).sum();
        let resolved = track.width < COARSE || samples >= MIN_TICKS_BETWEEN_LOSSES * track.width * single;
        // The stamps show at best the sum of losses that lie within a tick of each other; so many do if they are random.
        let events = track.losses.len() as f64;
        let confused = if track.width < COARSE { 0.0 } else { events * events * track.width / samples };
        let surplus = uncertain(&track.losses, resolved) as f64 + confused;
        let rate = track.slope_s(times).and_then(|slope_s| {
            let error = track.slope_error(times, slope_s);
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
        let late = (0..times.len()).map(|at| track.is_late(at)).collect();
        let Track { periods, losses, width, .. } = track;
        let (least_loss, is_rate_changing, is_of_loop) = (1, false, false);
        Self { periods, late, losses, rate, tick_s, width, resolved, least_loss, is_rate_changing, is_of_loop }
    }
}

/// Samples in losses that something else may explain: of a long loss that is uncertain one sample.
pub(crate) fn uncertain(losses: &[LostStretch], resolved: bool) -> u64 {
    let samples = losses.iter().map(|loss| if resolved { u64::from(!loss.certain) } else { loss.missing });
    samples.fold(0, u64::saturating_add)
}

/// The period, s, whose alignment describes the start of the record most shortly.
fn search(times: &[f64], stated_s: Option<f64>, tick_s: Option<f64>) -> Option<f64> {
    let first = &times[..times.len().min(SEARCHED)];
    let is_plausible = |period_s: f64| {
        let is_near = stated_s.is_none_or(|stated| (period_s / stated - 1.0).abs() <= MAX_CLOCK_ERROR);
        is_near && period_s.is_finite() && period_s > 0.0
    };
    let persistent = persistent_variance(first);
    let mut tried: Vec<f64> = Vec::new();
    let mut best: Option<(f64, Track)> = None;
    let estimates = period_estimates(first, tick_s);
    // The tick is the period of stamps that are whole numbers of it with samples lost between them, at intervals of any length.
    let tick_as_period = tick_s.filter(|tick_s| are_unlike_or_ticks(first, *tick_s));
    for period_s in stated_s.into_iter().chain(estimates.iter().copied()).chain(tick_as_period) {
        if !is_plausible(period_s) || tried.iter().any(|other| (period_s / other - 1.0).abs() < 1e-4) {
            continue;
        }
        tried.push(period_s);
        let refined = Track::refined(first, period_s, tick_s, (SEARCH_QUEUE, 1));
        if is_plausible(refined.1.period_s)
            && refined.1.are_losses_independent(persistent)
            && best.as_ref().is_none_or(|(least, _)| refined.0 < *least)
        {
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
    let is_fine = found.width < COARSE && (tick_s.is_none() || found.losses.len() as f64 <= CLEAR * first.len() as f64);
    if is_fine || found.losses.is_empty() {
        return Some(found.period_s);
    }
    // With many losses most windows are longer than their samples: shorter periods are tried, one after the other.
    let scanned = &first[..first.len().min(SCANNED)];
    let longest_s = estimates.last().copied().filter(|period_s| is_plausible(*period_s)).unwrap_or(found.period_s);
    let starts = (0..SCAN_STEPS).map(|step| longest_s * (1.0 - SCAN_STEP * f64::from(step)));
    let once_refined = |period_s: f64| {
        let track = Track::new(scanned, period_s, tick_s, (SEARCH_QUEUE, 1));
        let slope_s = track.slope_s(scanned).filter(|slope_s| is_plausible(*slope_s))?;
        Some((Track::new(scanned, slope_s, tick_s, (SEARCH_QUEUE, 1)).cost(scanned, tick_s), slope_s))
    };
    let least = starts.filter_map(once_refined).min_by(|a, b| a.0.total_cmp(&b.0));
    let found_cost = found.cost(first, tick_s);
    let better = least.map(|(_, period_s)| Track::refined(first, period_s, tick_s, (SEARCH_QUEUE, 1))).filter(
        |(cost, track)| *cost < found_cost && is_plausible(track.period_s) && track.are_losses_independent(persistent),
    );
    Some(better.map_or(found.period_s, |(_, track)| track.period_s))
}

/// True if a quarter of the intervals is far longer than another quarter, or a quarter is as short as a tick or two.
fn are_unlike_or_ticks(times: &[f64], tick_s: f64) -> bool {
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let [short, long] = [1, 3].map(|parts| quantile(&mut intervals, parts, 4));
    long > UNLIKE * short || short < FEW_TICKS * tick_s
}

/// The shortest loss that stamps which come in bursts tell from late delivery, which lifts the envelope of an alignment without losses as
/// often as it lowers it: eight rises or more are so long, and eight times as many as the falls; or it is longer than the longest of `n`
/// rises by chance, whose lengths are distributed exponentially, is with a probability of a thousandth, if the longest of the falls is `ln
/// n` mean lengths long.
fn least_telling(times: &[f64], track: &Track) -> u64 {
    let complete = Track::complete(times, track);
    let rises = Track::new(times, complete.period_s, None, (MAX_QUEUE, 1)).losses;
    let falls = complete.falls(times, MAX_QUEUE);
    let of_length = |of: &[LostStretch], least: u64| of.iter().filter(|loss| loss.missing >= least).count();
    let longest = falls.iter().map(|fall| fall.missing).max().unwrap_or(0);
    let is_telling = |&least: &u64| {
        let rises = of_length(&rises, least);
        rises >= TELLING && rises >= TELLING * of_length(&falls, least)
    };
    let mean = longest as f64 / (falls.len().max(2) as f64).ln();
    let by_length = longest + (mean * FALSE_ALARM.recip().ln()).ceil().max(1.0) as u64;
    (1..by_length.max(2)).find(is_telling).unwrap_or(by_length.max(2))
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

/// Fewest losses whose distances tell how regular they are.
const MIN_SCATTERED: usize = 8;
/// Variance of the distances of losses, over the square of their mean, from which they are scattered. Rounding makes equal
/// distances, of variance 0; those of random losses are exponentially distributed, of variance 1, which the least number of
/// losses shows with a standard deviation of about 0.5.
const SCATTERED: f64 = 0.4;

/// True if losses lie at so different distances that rounding cannot have made most of them.
fn are_scattered(losses: &[LostStretch]) -> bool {
    let distances = || losses.windows(2).map(|pair| (pair[1].before - pair[0].before) as f64);
    let count = distances().count() as f64;
    let mean = distances().sum::<f64>() / count;
    let variance = distances().map(|distance| (distance - mean) * (distance - mean)).sum::<f64>() / (count - 1.0);
    losses.len() >= MIN_SCATTERED && variance >= SCATTERED * mean * mean
}

/// True if intervals of one tick differ by more than the rounding of a time in f64: the stamps are not multiples of the tick,
/// and it is the sample period that they show.
fn is_finer(times: &[f64], tick_s: f64) -> bool {
    let single =
        || times.windows(2).map(|pair| pair[1] - pair[0]).filter(|interval| (interval / tick_s).round() == 1.0);
    let (least, most) = single()
        .fold((f64::INFINITY, 0.0), |(least, most): (f64, f64), interval| (least.min(interval), most.max(interval)));
    let rounding = 4.0 * f64::EPSILON * times.iter().fold(0.0, |most: f64, time| most.max(time.abs()));
    most - least > rounding
}

/// True if single losses lie so regularly in a record of `samples` that a slightly longer period explains all of them.
fn is_beat(losses: &[LostStretch], samples: usize) -> bool {
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
