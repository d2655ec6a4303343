//! Stamps without a steady fine clock: polling loops, few digits, ticks of many samples; they look like losses.

use crate::lateness_track::{LONG, LostStretch, RateEstimate, quantile};
use crate::stamp_quality::{AlignedStamps, StampQuality};

/// Rows that make up for a late one.
const CATCHES_UP: usize = 16;
const WINDOW: usize = 128;

/// Samples per tick that are counted.
const MANY: f64 = 32.0;
const LEAST_TICKS: usize = 2;
/// Difference of equal ticks by rounding.
const ROUNDING: f64 = 2.0;

const FEW_DIGITS: std::ops::RangeInclusive<i32> = 3..=7;
const SINGLE_BITS: i32 = 24;
/// Relative.
const EXACT: f64 = 1e-12;
/// In mean intervals.
const LEAST_TICK: f64 = 0.05;

/// For a polling loop, s: only long intervals lack samples.
pub(crate) fn of_loop(times: &[f64], tick_s: Option<f64>) -> Option<AlignedStamps> {
    let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let usual_s = quantile(&mut intervals.clone(), 1, 2);
    let surplus = |from: usize| {
        let next = &intervals[from..intervals.len().min(from + CATCHES_UP)];
        next.iter().sum::<f64>() / usual_s - next.len() as f64
    };
    let mut periods = Vec::with_capacity(times.len());
    let (mut losses, mut missing, mut missing_s) = (Vec::new(), 0_u64, 0.0);
    let (mut shortest_s, mut longest_s) = (f64::INFINITY, 0.0_f64);
    let (mut window_s, mut in_window) = (0.0, 0);
    for at in 0..times.len() {
        if let Some(&interval) = at.checked_sub(1).and_then(|before| intervals.get(before)) {
            let excess = (interval / usual_s).round() - 1.0;
            if interval >= LONG * usual_s && excess >= 1.0 && surplus(at - 1) >= LONG - 1.0 {
                // Saturates.
                missing = missing.saturating_add(excess as u64);
                missing_s += excess * usual_s;
                losses.push(LostStretch { before: at, missing: excess as u64, certain: false });
            } else {
                window_s += interval;
                in_window += 1;
            }
            if in_window == WINDOW {
                let period_s = window_s / WINDOW as f64;
                (shortest_s, longest_s) = (shortest_s.min(period_s), longest_s.max(period_s));
                (window_s, in_window) = (0.0, 0);
            }
        }
        periods.push(missing.saturating_add(at as u64));
    }
    let span_s = times.last()? - times.first()? - missing_s;
    let hz = (times.len() - 1) as f64 / span_s;
    let (low_hz, high_hz) = if longest_s > 0.0 { (longest_s.recip(), shortest_s.recip()) } else { (hz, hz) };
    let rate = RateEstimate::new(hz, low_hz.min(hz), high_hz.max(hz));
    let fine = StampQuality { losses, rate, tick_s, resolved: true, least_loss: 1, ..StampQuality::default() };
    Some(AlignedStamps { periods, quality: StampQuality { is_rate_changing: true, is_of_loop: true, ..fine } })
}

pub(crate) fn is_of_many(times: &[f64], tick_s: f64) -> bool {
    let span_s = times.last().zip(times.first()).map_or(0.0, |(last, first)| last - first);
    tick_s * (times.len() as f64) > MANY * span_s && span_s > 0.0
}

struct WholeTicks {
    end: usize,
    rows: f64,
    ticks: f64,
}

/// Ticks of many samples: the first sample of each is known; samples are missing where other ticks hold more.
pub(crate) fn by_ticks(times: &[f64], tick_s: f64, stated_hz: Option<f64>) -> Option<AlignedStamps> {
    let starts: Vec<usize> = (1..times.len()).filter(|at| times[*at] > times[*at - 1]).collect();
    let between = |pair: &[usize]| WholeTicks {
        end: pair[1],
        rows: (pair[1] - pair[0]) as f64,
        ticks: ((times[pair[1]] - times[pair[0]]) / tick_s).round(),
    };
    let wholes: Vec<WholeTicks> = starts.windows(2).map(between).collect();
    if wholes.len() < LEAST_TICKS {
        return None;
    }
    // As most ticks, else as all together.
    let mut counts: Vec<f64> = wholes.iter().map(|of| of.rows / of.ticks).collect();
    let usual = quantile(&mut counts, 1, 2);
    let is_alike = |of: &&WholeTicks| (of.rows - usual * of.ticks).abs() <= ROUNDING;
    let alike: Vec<&WholeTicks> = wholes.iter().filter(is_alike).collect();
    let are_most = 2 * alike.len() > wholes.len();
    let counted: Vec<&WholeTicks> = if are_most { alike } else { wholes.iter().collect() };
    let seconds = counted.iter().map(|of| of.ticks).sum::<f64>() * tick_s;
    let hz = counted.iter().map(|of| of.rows).sum::<f64>() / seconds;
    let error = seconds.recip();
    let of_tick = stated_hz.filter(|stated| (stated / hz - 1.0).abs() < 0.1).unwrap_or(hz) * tick_s;
    let mut losses = Vec::new();
    for WholeTicks { end, rows, ticks } in wholes.iter().filter(|_| are_most) {
        let missing = of_tick * ticks - rows;
        if missing > ROUNDING {
            losses.push(LostStretch { before: *end, missing: missing.round() as u64, certain: true });
        }
    }
    let mut periods = Vec::with_capacity(times.len());
    let (mut missing, mut next) = (0_u64, losses.iter().peekable());
    for at in 0..times.len() {
        while let Some(loss) = next.next_if(|loss| loss.before <= at) {
            missing += loss.missing;
        }
        periods.push(at as u64 + missing);
    }
    let rate = RateEstimate::new(hz, (hz - error).max(hz / 2.0), hz + error);
    let (tick_s, width, least_loss) = (Some(tick_s), tick_s * hz, 1);
    let quality = StampQuality { losses, rate, tick_s, width, resolved: true, least_loss, ..StampQuality::default() };
    Some(AlignedStamps { periods, quality })
}

/// Few digits: rounded as the last ones; `None` for others.
pub(crate) fn of_few_digits(times: &[f64]) -> Option<Vec<f64>> {
    let largest = times.iter().fold(0.0, |most: f64, time| most.max(time.abs()));
    let smallest = times.iter().map(|time| time.abs()).filter(|time| *time > 0.0).fold(f64::INFINITY, f64::min);
    let interval = (times.last()? - times.first()?) / (times.len().max(2) - 1) as f64;
    let tick_at = |digits: i32, time: f64| 10f64.powi(time.log10().floor() as i32 + 1 - digits);
    let is_written = |time: f64, tick: f64| {
        let ticks = time / tick;
        (ticks - ticks.round()).abs() <= EXACT * ticks.abs().max(1.0)
    };
    let by_digits = || {
        let digits = FEW_DIGITS.into_iter().find(|digits| {
            times
                .iter()
                .all(|time| *time == 0.0 || is_written(time.abs(), tick_at(*digits, time.abs() * (1.0 + EXACT))))
        })?;
        Some([smallest, largest].map(|time| tick_at(digits, time)))
    };
    let in_single_precision = || {
        let unit = [1.0, 1e3, 1e6, 1e9].into_iter().find(|unit| {
            let is_single =
                |time: &f64| (f64::from((time * unit) as f32) - time * unit).abs() <= EXACT * (time * unit).abs();
            times.iter().all(is_single)
        })?;
        Some([smallest, largest].map(|time| 2f64.powi((time * unit).log2().floor() as i32 + 1 - SINGLE_BITS) / unit))
    };
    let [finest, tick] = by_digits().or_else(in_single_precision)?;
    let is_growing = tick > finest && tick >= LEAST_TICK * interval && interval > 0.0;
    let is_finer = |time: &f64| !is_written(time.abs(), tick);
    (is_growing && times.iter().any(is_finer)).then(|| times.iter().map(|time| (time / tick).round() * tick).collect())
}
