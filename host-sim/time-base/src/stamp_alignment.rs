//! Time stamps aligned to sample periods: period, interval, losses, late samples.
//!
//! Lateness `c_i = t_i/T − i` has a lower envelope, the losses before sample `i`: a stall lifts `c` for a while, a loss
//! the envelope for good, and coarse stamps spread `c` above it. The period with the shortest description of scatter
//! and losses wins.

use crate::clock_rate::{SteadiedStamps, steadied};
use crate::irregular_stamps::{by_ticks, is_of_many, of_few_digits, of_loop};
use crate::lateness_track::{COARSE, LostStretch, RateEstimate, SEARCH_QUEUE, Track, persistent_variance, quantile};
use crate::stamp_quality::{AlignedStamps, StampQuality};
use crate::stamp_tick::tick;

/// Samples of the envelope: the deepest queue told from a loss.
pub(crate) const MAX_QUEUE: usize = 256;

/// Windows, samples, for estimates of the period.
const WINDOWS: [usize; 6] = [1, 8, 32, 128, 512, 2048];
/// Largest jitter of their durations, periods.
const NEAR: f64 = 0.6;
/// Searched samples at the start.
const SEARCHED: usize = 100_000;
/// Samples and steps of the scan for coarse stamps with losses.
const SCANNED: usize = 20_000;
const SCAN_STEP: f64 = 1e-3;
const SCAN_STEPS: u32 = 80;

/// Relative to a stated rate.
const MAX_CLOCK_ERROR: f64 = 0.1;

/// Ratio of rises to falls that are losses, and fewest rises.
const TELLING: usize = 8;
/// Quartile ratio of unlike intervals.
const UNLIKE: f64 = 1.5;
/// Ticks per interval that may be the tick.
const FEW_TICKS: f64 = 2.5;
/// Rises without long intervals of a loop.
const GENTLE: usize = 3;
const FALSE_ALARM: f64 = 1e-3;

/// Largest share of losses without a further search.
const CLEAR: f64 = 0.02;

/// Distance of the tick from whole periods that beats.
const BEAT: f64 = 0.1;
/// Two losses always lie at equal distances.
const MIN_BEATS: usize = 3;
/// Periods.
const BEAT_SCATTER: f64 = 1.25;

/// Fewest ticks between losses to tell single ones: below, two thirds were missed.
const MIN_TICKS_BETWEEN_LOSSES: f64 = 16.0;
/// Overlooked losses per found one.
const OVERLOOKED: f64 = 4.0;

impl AlignedStamps {
    /// Aligns `times` (s, not decreasing), within 10 % of a stated rate; `None` without a visible period.
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
            let is_free = alignment.quality.is_of_loop && stated_hz.is_none();
            return if is_free { of_loop(times, tick_s) } else { Some(alignment) };
        };
        let mut alignment = Self::of_steady(&steady, stated_hz)?;
        let hz = *alignment.periods.last()? as f64 / (times.last()? - times.first()?);
        let changing = RateEstimate::new(hz, longest_s.recip(), shortest_s.recip());
        alignment.quality.rate = alignment.quality.rate.and(changing);
        alignment.quality.is_rate_changing = true;
        Some(alignment)
    }

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
        // Near whole periods.
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
        // Bounded by the durations' scatter.
        let hidden = if least_loss > 1 { persistent / (track.period_s * track.period_s) } else { 0.0 };
        let Self { periods, mut quality } = Self::from_track(track, times, tick_s);
        quality.rate.iter_mut().for_each(|rate| rate.high_hz *= 1.0 + hidden);
        Some(Self { periods, quality: StampQuality { least_loss, is_of_loop, ..quality } })
    }

    fn from_track(track: Track, times: &[f64], tick_s: Option<f64>) -> Self {
        let samples = times.len() as f64;
        // Losses within a tick look like one longer one.
        let single: f64 = track.losses.iter().map(|loss| (loss.missing as f64).min(track.width.ceil())).sum();
        let resolved = track.width < COARSE || samples >= MIN_TICKS_BETWEEN_LOSSES * track.width * single;
        // At best the stamps show their sum.
        let events = track.losses.len() as f64;
        let confused = if track.width < COARSE { 0.0 } else { events * events * track.width / samples };
        let surplus = uncertain(&track.losses, resolved) as f64 + confused;
        let rate = track.slope_s(times).and_then(|slope_s| {
            let error = track.slope_error(times, slope_s);
            let hz = slope_s.recip();
            // Without the uncertain losses, or with overlooked ones.
            let rows_only = 1.0 - surplus / (samples + surplus);
            let overlooked = if resolved { confused } else { confused + OVERLOOKED * surplus };
            RateEstimate::new(hz, hz * (1.0 - error) * rows_only, hz * (1.0 + error) * (1.0 + overlooked / samples))
        });
        let late = (0..times.len()).filter(|at| track.is_late(*at)).count() as u64;
        let Track { periods, losses, width, .. } = track;
        let least_loss = 1;
        let quality =
            StampQuality { late, losses, rate, tick_s, width, resolved, least_loss, ..StampQuality::default() };
        Self { periods, quality }
    }
}

/// At most one per uncertain long loss.
pub(crate) fn uncertain(losses: &[LostStretch], resolved: bool) -> u64 {
    let samples = losses.iter().map(|loss| if resolved { u64::from(!loss.certain) } else { loss.missing });
    samples.fold(0, u64::saturating_add)
}

/// s, for the start of the record.
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
    // Whole ticks with losses between.
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
        // Fine stamps, few losses.
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
    // With many losses, shorter periods are tried.
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

/// Quarters far apart, or as short as a tick or two.
fn are_unlike_or_ticks(times: &[f64], tick_s: f64) -> bool {
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let [short, long] = [1, 3].map(|parts| quantile(&mut intervals, parts, 4));
    long > UNLIKE * short || short < FEW_TICKS * tick_s
}

/// Shortest loss told from late delivery in bursts, by its rises against the falls.
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

/// Estimates of the period, s, the best one for fine stamps first.
fn period_estimates(times: &[f64], tick_s: Option<f64>) -> Vec<f64> {
    let mut estimates = Vec::new();
    // Too few long windows to compare.
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

const MIN_SCATTERED: usize = 8;
/// Least squared variation of distances of scattered losses: 0 by rounding, 1 ± 0.5 at random.
const SCATTERED: f64 = 0.4;

fn are_scattered(losses: &[LostStretch]) -> bool {
    let distances = || losses.windows(2).map(|pair| (pair[1].before - pair[0].before) as f64);
    let count = distances().count() as f64;
    let mean = distances().sum::<f64>() / count;
    let variance = distances().map(|distance| (distance - mean) * (distance - mean)).sum::<f64>() / (count - 1.0);
    losses.len() >= MIN_SCATTERED && variance >= SCATTERED * mean * mean
}

/// Finer than the tick: the stamps show the period.
fn is_finer(times: &[f64], tick_s: f64) -> bool {
    let single =
        || times.windows(2).map(|pair| pair[1] - pair[0]).filter(|interval| (interval / tick_s).round() == 1.0);
    let (least, most) = single()
        .fold((f64::INFINITY, 0.0), |(least, most): (f64, f64), interval| (least.min(interval), most.max(interval)));
    let rounding = 4.0 * f64::EPSILON * times.iter().fold(0.0, |most: f64, time| most.max(time.abs()));
    most - least > rounding
}

/// A slightly longer period would explain all.
fn is_beat(losses: &[LostStretch], samples: usize) -> bool {
    let (Some(first), Some(last)) = (losses.first(), losses.last()) else { return false };
    if losses.len() < MIN_BEATS || losses.iter().any(|loss| loss.missing != 1) {
        return false;
    }
    // The slope that replaces the staircase.
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
