//! The sample period in which each row of a recording was taken, from its time stamps or its index.

use crate::time_base::stamp_alignment::StampAlignment;
use crate::time_base::stamp_quality::StampQuality;
use crate::time_base::time_base_error::{MIN_SAMPLES, TimeBaseError};
use std::collections::BTreeMap;

/// Longest interval, in sample periods, at which a sample equal to the one before is the same sample read twice. Equal samples
/// farther apart are chance: a filtered output of few counts repeats about once in a thousand samples.
pub(crate) const MAX_REPEATED_READ_INTERVAL: f64 = 0.75;

/// Samples whose median duration tells which interval is shorter than a period.
const REPEATED_READ_WINDOW: usize = 32;

/// Largest relative difference between the stated and the measured rate: a wrong nominal rate and a clock on a breadboard,
/// not another rate.
const MAX_RATE_CONTRADICTION: f64 = 0.1;

/// Share of samples that follow their neighbour below which the stated rate is doubted.
const MIN_NEIGHBOURS: f64 = 0.75;

/// Most sample periods of a recording for each of its samples, and beside them. The gaps of a series of this length fit into
/// memory.
const MAX_PERIODS_PER_SAMPLE: u64 = 64;
const MAX_PERIODS: u64 = 1 << 22;

/// Where rows lie in time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SampleSlots {
    /// Sample period of each row, counted from the first; increasing.
    pub(crate) slots: Vec<u64>,
    /// Sample periods without a row.
    pub(crate) never_arrived: u64,
    /// As stated, else by the stamps, Hz.
    pub(crate) sample_rate_hz: f64,
    /// What the time stamps show; `None` where there are none.
    pub(crate) stamps: Option<StampQuality>,
}

impl SampleSlots {
    /// Of `rows` rows with `times_s` (s, not decreasing) or `indices` (increasing), if they have them: the index counts where
    /// there are both. A stated rate overrides that of the stamps.
    ///
    /// # Errors
    /// There is no usable rate or the stated one contradicts the stamps, there are fewer than 4 rows, no two of them are
    /// neighbours, or the gaps are more than 64 times as long as the rows.
    pub(crate) fn new(
        rows: usize,
        times_s: Option<&[f64]>,
        indices: Option<&[u64]>,
        stated_hz: Option<f64>,
    ) -> Result<Self, TimeBaseError> {
        if let Some(rate) = stated_hz.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
            return Err(TimeBaseError::InvalidRate(rate));
        }
        if (rows as u64) < MIN_SAMPLES {
            return Err(TimeBaseError::TooShort { used: rows as u64, dropped: BTreeMap::new() });
        }
        let (periods, never_arrived, stamps) = match (indices, times_s) {
            (Some(indices), _) => {
                let steps = || indices.windows(2).map(|pair| pair[1] - pair[0]);
                let least = steps().min().unwrap_or(1);
                if least > 1 {
                    return Err(TimeBaseError::NoNeighbours(least));
                }
                let missing = steps().fold(0, |sum: u64, step| sum.saturating_add(step - 1));
                (indices.to_vec(), missing, times_s.map(|times| StampQuality::of_index(indices, times)))
            }
            (None, Some(times)) => {
                let alignment = StampAlignment::new(times, stated_hz).ok_or(TimeBaseError::NoPeriod)?;
                match stated_hz {
                    Some(stated_hz) => contradiction(times, &alignment, stated_hz)?,
                    None if alignment.rate.is_none() => return Err(TimeBaseError::NoPeriod),
                    None => {}
                }
                let StampAlignment {
                    periods,
                    late,
                    losses,
                    rate,
                    tick_s,
                    width,
                    resolved,
                    least_loss,
                    is_rate_changing,
                } = alignment;
                let missing = losses.iter().fold(0, |sum: u64, loss| sum.saturating_add(loss.missing));
                let late = late.into_iter().filter(|late| *late).count() as u64;
                let stamps = StampQuality {
                    rate,
                    tick_s,
                    width,
                    losses,
                    resolved,
                    least_loss,
                    is_rate_changing,
                    late,
                    clock_steps: Vec::new(),
                };
                (periods, missing, Some(stamps))
            }
            (None, None) => ((0..rows as u64).collect(), 0, None),
        };
        let measured_hz = stamps.as_ref().and_then(|stamps| stamps.rate).map(|rate| rate.hz);
        let sample_rate_hz = stated_hz.or(measured_hz).ok_or(TimeBaseError::NoRate)?;
        Ok(Self { slots: slots(&periods)?, never_arrived, sample_rate_hz, stamps })
    }
}

/// The mean interval of the window of samples that lasts as long as half of the others, s.
pub(crate) fn usual_interval(times: &[f64]) -> Option<f64> {
    let window = if times.len() > 4 * REPEATED_READ_WINDOW { REPEATED_READ_WINDOW } else { 1 };
    let mut durations: Vec<f64> = times.windows(window + 1).map(|row| row[window] - row[0]).collect();
    let middle = durations.len() / 2;
    let duration = (!durations.is_empty()).then(|| *durations.select_nth_unstable_by(middle, f64::total_cmp).1)?;
    (duration > 0.0 && duration.is_finite()).then_some(duration / window as f64)
}

/// Checks a stated rate against the stamps.
pub(crate) fn contradiction(times: &[f64], alignment: &StampAlignment, stated_hz: f64) -> Result<(), TimeBaseError> {
    let differs = |measured_hz: f64| (measured_hz / stated_hz - 1.0).abs() > MAX_RATE_CONTRADICTION;
    let few_neighbours = (alignment.losses.len() as f64) > (1.0 - MIN_NEIGHBOURS) * times.len() as f64;
    if !few_neighbours && !alignment.rate.is_some_and(|rate| differs(rate.hz)) {
        return Ok(());
    }
    match StampAlignment::new(times, None) {
        Some(StampAlignment { rate: Some(rate), losses, .. })
            if differs(rate.hz) && losses.len() <= times.len() / 4 =>
        {
            Err(TimeBaseError::RateContradictsStamps { stated_hz, measured_hz: rate.hz })
        }
        _ => Ok(()),
    }
}

/// The periods counted from the first sample, strictly increasing.
pub(crate) fn slots(periods: &[u64]) -> Result<Vec<u64>, TimeBaseError> {
    let first = periods.first().copied().unwrap_or(0);
    let slots: Vec<u64> = periods.iter().map(|period| period.saturating_sub(first)).collect();
    // Periods beyond the range of u64 are all the same.
    let is_increasing = slots.is_sorted_by(|one, next| one < next);
    let (samples, span) = (slots.len() as u64, slots.last().copied().unwrap_or(0));
    if !is_increasing || is_too_sparse(samples, span) {
        return Err(TimeBaseError::TooSparse { samples, periods: span.saturating_add(1) });
    }
    Ok(slots)
}

/// Whether the gaps of `samples` samples that span so many periods are too long.
pub(crate) fn is_too_sparse(samples: u64, span: u64) -> bool {
    span / MAX_PERIODS_PER_SAMPLE > samples && span > MAX_PERIODS
}
