//! Time base of a recording: its sample rate, and the sample period in which each sample was taken.
//!
//! A sample that was read late is not a lost sample. A host that stalls reads the samples that have queued up one right after
//! the other, so that their time stamps show one long interval and then several short ones. Such samples are aligned to
//! periods of their own; a gap is only what they do not fill. Time stamps that are coarser than the sample period look like
//! losses: then the rate must be given.

use crate::recording::{RecordedSample, Recording};
use adis16405_driver::{Channel, Faults};
use measurement::{MeasuredChannel, Measurement, adis16405};
use std::collections::{BTreeMap, VecDeque};

/// Fewest samples that give one octave of the Allan deviation: two adjacent windows of one sample in each half of the record.
const MIN_SAMPLES: u64 = 4;

/// Faults for which a sample is left out. The other faults are warnings; their samples are used.
const REFUSED: Faults =
    Faults::all().difference(Faults::REPEATED).difference(Faults::ERROR_ALARM).difference(Faults::SUPPLY);

/// Longest interval, in sample periods, at which a sample equal to the one before is the same sample read twice. Equal samples
/// farther apart are chance: a filtered output of few counts repeats about once in a thousand samples.
const MAX_REPEATED_READ_INTERVAL: f64 = 0.75;

/// Samples over which the lower envelope of the lateness is sought: the deepest queue whose late delivery is distinguished from a loss.
/// The last samples of a record have fewer after them, so there a late delivery may count as a loss.
const MAX_QUEUE: usize = 64;

/// Share of the envelope's change that its phase follows at each sample: a sample period that is wrong by a fraction `ε` makes
/// the phase lag by `ε/PHASE_TRACKING` periods, so that an error of up to 3 % causes no false loss.
const PHASE_TRACKING: f64 = 1.0 / 16.0;

/// Intervals that are taken for one sample period with jitter, in units of the median interval. Those of samples that have
/// queued up are shorter, those across gaps and stalls longer.
const ONE_PERIOD: std::ops::Range<f64> = 0.4..1.6;

/// Why a recording has no time base.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TimeBaseError {
    /// No rate was given and none can be measured.
    #[error("no sample rate: give --rate HZ, or a recording with a time_s column")]
    NoRate,
    /// The given rate is not positive and finite.
    #[error("a sample rate of {0} Hz: it must be positive and finite")]
    InvalidRate(f64),
    /// Most time stamps are equal, or they span no time.
    #[error("the time stamps show no sample period: give --rate HZ")]
    NoPeriod,
    /// Too few samples for one octave of the Allan deviation.
    #[error("record too short: {used} usable samples, one octave needs {MIN_SAMPLES}")]
    TooShort {
        /// Samples without a fault for which they are left out.
        used: u64,
    },
}

/// The usable samples of `recording` on their time base.
///
/// `rate_hz` overrides the rate that the time stamps show. Gaps are read from the sample index where there is one, else from
/// the time stamps; without either only samples that are left out for a fault are missing.
///
/// # Errors
/// There is no usable rate, or there are fewer than 4 usable samples.
pub fn measurement(recording: &Recording, rate_hz: Option<f64>) -> Result<Measurement, TimeBaseError> {
    if let Some(rate) = rate_hz
        && !(rate.is_finite() && rate > 0.0)
    {
        return Err(TimeBaseError::InvalidRate(rate));
    }
    let samples = &recording.samples;
    let Usable { positions, mut dropped, flagged } = Usable::select(samples, rate_hz);
    if (positions.len() as u64) < MIN_SAMPLES {
        return Err(TimeBaseError::TooShort { used: positions.len() as u64 });
    }
    let (periods, measured_hz) = sample_periods(samples, &positions, rate_hz)?;
    let (slots, never_arrived) = slots(&positions, &periods);
    dropped.insert("gap", never_arrived);
    let sample_rate_hz = rate_hz.or(measured_hz).ok_or(TimeBaseError::NoRate)?;

    let profile = adis16405::profile(recording.range.lsb());
    let channel = |channel: &Channel| {
        let counts = positions.iter().map(|&p| i32::from(samples[p].counts.get(*channel))).collect();
        MeasuredChannel::new(profile.channels[*channel as usize], counts)
    };
    Ok(Measurement {
        channels: recording.channels.iter().map(channel).collect(),
        profile,
        sample_rate_hz,
        stated_rate_hz: rate_hz,
        times_s: positions.iter().map(|&p| samples[p].time_stamp.time_s).collect(),
        slots,
        dropped,
        flagged,
    })
}

/// The samples of a recording that can be used.
struct Usable {
    /// Indices into [`Recording::samples`].
    positions: Vec<usize>,
    /// Samples that are left out, by cause.
    dropped: BTreeMap<&'static str, u64>,
    /// Samples that are used although a warning was raised, by cause.
    flagged: BTreeMap<&'static str, u64>,
}

impl Usable {
    fn select(samples: &[RecordedSample], rate_hz: Option<f64>) -> Self {
        let times: Option<Vec<f64>> = samples.iter().map(|sample| sample.time_stamp.time_s).collect();
        let period_s = times.and_then(|times| sample_period(&times, rate_hz));
        // 0 without times: then no sample is taken to be read twice.
        let shortest_s = MAX_REPEATED_READ_INTERVAL * period_s.unwrap_or(0.0);
        let time = |position: usize| samples[position].time_stamp.time_s;
        let read_twice = |position: usize| match (position.checked_sub(1).and_then(time), time(position)) {
            (Some(previous), Some(now)) => now - previous < shortest_s,
            _ => false,
        };
        let mut usable =
            Self { positions: Vec::with_capacity(samples.len()), dropped: BTreeMap::new(), flagged: BTreeMap::new() };
        for (position, sample) in samples.iter().enumerate() {
            let refused = if read_twice(position) { REFUSED | Faults::REPEATED } else { REFUSED };
            match (sample.faults & refused).cause() {
                Some(cause) => *usable.dropped.entry(cause).or_insert(0) += 1,
                None => {
                    usable.positions.push(position);
                    for cause in sample.faults.causes() {
                        *usable.flagged.entry(cause).or_insert(0) += 1;
                    }
                }
            }
        }
        usable
    }
}

/// The sample period in which each usable sample was taken, counted from any origin, and the rate in Hz where the recording
/// shows it.
fn sample_periods(
    samples: &[RecordedSample],
    positions: &[usize],
    rate_hz: Option<f64>,
) -> Result<(Vec<u64>, Option<f64>), TimeBaseError> {
    let indices: Option<Vec<u64>> = positions.iter().map(|&p| samples[p].time_stamp.index).collect();
    let times: Option<Vec<f64>> = positions.iter().map(|&p| samples[p].time_stamp.time_s).collect();
    match (indices, times) {
        (Some(indices), times) => {
            let measured_hz = times.and_then(|times| fit_rate(&indices, &times, |_| true));
            Ok((indices, measured_hz))
        }
        (None, Some(times)) => {
            let period_s = sample_period(&times, rate_hz).ok_or(TimeBaseError::NoPeriod)?;
            let Alignment { periods, on_time } = Alignment::new(&times, period_s);
            let measured_hz = fit_rate(&periods, &times, |at| on_time[at]);
            if rate_hz.is_none() && measured_hz.is_none() {
                return Err(TimeBaseError::NoPeriod);
            }
            Ok((periods, measured_hz))
        }
        // Without time stamps a sample that is left out leaves its own period empty, and nothing else is missing.
        (None, None) => Ok((positions.iter().map(|&p| p as u64).collect(), None)),
    }
}

/// The periods counted from the first sample, strictly increasing, and the number of missing samples that are not samples
/// left out for a fault. One gap has at most `u32::MAX` periods.
fn slots(positions: &[usize], periods: &[u64]) -> (Vec<u64>, u64) {
    let (mut slots, mut slot, mut never_arrived) = (Vec::with_capacity(positions.len()), 0_u64, 0_u64);
    for at in 0..positions.len() {
        if let Some(before) = at.checked_sub(1) {
            let missing = periods[at].saturating_sub(periods[before]).saturating_sub(1);
            let left_out = (positions[at] - positions[before] - 1) as u64;
            never_arrived = never_arrived.saturating_add(missing.saturating_sub(left_out));
            slot = slot.saturating_add(missing.min(u64::from(u32::MAX))).saturating_add(1);
        }
        slots.push(slot);
    }
    (slots, never_arrived)
}

/// Time stamps aligned to sample periods.
///
/// A sample is read after it was taken, never before. The lateness `c_i = t_i/T − i`, in periods `T`, therefore has a lower
/// envelope: the number of samples lost before sample `i`. A stall of the host lifts `c` above the envelope until the queue is
/// empty; a lost sample lifts the envelope itself by one for the rest of the record.
struct Alignment {
    /// Period of each sample, counted from the first; grows by at least one a sample.
    periods: Vec<u64>,
    /// Whether the sample was read less than a period after the envelope, so that its time stamp tells when it was taken.
    on_time: Vec<bool>,
}

impl Alignment {
    /// Aligns `times` (s, not decreasing) to periods of `period_s`.
    fn new(times: &[f64], period_s: f64) -> Self {
        let Some(&origin) = times.first() else {
            return Self { periods: Vec::new(), on_time: Vec::new() };
        };
        let lateness: Vec<f64> =
            times.iter().enumerate().map(|(at, time)| (time - origin) / period_s - at as f64).collect();
        let envelope = minimum_ahead(&lateness, MAX_QUEUE);
        let mut phase = envelope[0];
        let mut missing = 0u64;
        let mut periods = Vec::with_capacity(times.len());
        let mut on_time = Vec::with_capacity(times.len());
        for (at, (late, least)) in lateness.iter().zip(envelope).enumerate() {
            let excess = least - missing as f64 - phase;
            if excess >= 0.5 {
                // A float beyond the range of u64 saturates.
                missing = missing.saturating_add(excess.round() as u64);
            }
            let rest = least - missing as f64 - phase;
            if rest.is_finite() {
                phase += rest * PHASE_TRACKING;
            }
            periods.push(missing.saturating_add(at as u64));
            on_time.push(late - missing as f64 - phase < 1.0);
        }
        Self { periods, on_time }
    }
}

/// The sample period in s: of `rate_hz`, or else as the `times` show it.
///
/// From times it is the mean of the intervals near the median; the median alone is biased when jitter is skewed. `None` if
/// most intervals are 0.
fn sample_period(times: &[f64], rate_hz: Option<f64>) -> Option<f64> {
    if let Some(rate) = rate_hz {
        return Some(rate.recip());
    }
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if intervals.is_empty() {
        return None;
    }
    let middle = intervals.len() / 2;
    let median = *intervals.select_nth_unstable_by(middle, f64::total_cmp).1;
    let of_one_period = || intervals.iter().filter(|interval| ONE_PERIOD.contains(&(*interval / median)));
    let period = of_one_period().sum::<f64>() / of_one_period().count() as f64;
    (period > 0.0 && period.is_finite()).then_some(period)
}

/// For each value the minimum of it and the `window − 1` values after it.
fn minimum_ahead(values: &[f64], window: usize) -> Vec<f64> {
    let mut least = vec![0.0; values.len()];
    // Positions ahead whose values decrease with their distance; the back is the minimum of the window.
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

/// Sample rate in Hz: one over the slope of the least-squares line of time over period, for the samples that `admitted`
/// selects. `None` if they span no time.
fn fit_rate(periods: &[u64], times: &[f64], admitted: impl Fn(usize) -> bool) -> Option<f64> {
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
    let rate = xx / xy;
    (rate.is_finite() && rate > 0.0).then_some(rate)
}
