//! When the samples of a recording were taken: the sample rate, and where samples are missing.
//!
//! A sample that was read late is not a lost sample. A host that stalls finds several samples queued and reads them
//! back to back, so the time stamps show one long interval and then several short ones. Such a flush is spread back, one
//! period apart; only what the flush does not make up for is a gap. Time stamps that are coarser than the period look
//! like losses; there the rate must be given.

mod deliveries;

use crate::recording::{Recording, Sample};
use adis16405_driver::{Channel, Faults};
use deliveries::Deliveries;
use measurement::{MeasuredChannel, Measurement, adis16405};
use std::collections::BTreeMap;

/// Fewest samples that give an octave: two adjacent windows of one sample in each half of the record.
pub const FEWEST_SAMPLES: u64 = 4;

/// Faults for which a sample is left out; the others are warnings about data that are there.
const REFUSED: Faults =
    Faults::all().difference(Faults::REPEATED).difference(Faults::ERROR_ALARM).difference(Faults::SUPPLY);

/// Equal neighbours closer than this part of a period are one sample read twice; farther apart they are chance, which
/// a filtered output of few counts brings about once in a thousand samples.
const RE_READ_WITHIN: f64 = 0.75;

/// One step along the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Index into [`Recording::samples`].
    Sample(usize),
    /// So many samples are missing here.
    Gap(u32),
}

/// The samples of a recording in equal steps of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeline {
    /// As given, or as measured from the time stamps, Hz.
    pub sample_rate_hz: f64,
    /// What the user says the rate is, Hz.
    pub stated_rate_hz: Option<f64>,
    /// In the order of time.
    pub steps: Vec<Step>,
    /// Samples that the steps leave out, by cause; `gap` (always there) counts those that never arrived.
    pub dropped: BTreeMap<&'static str, u64>,
    /// Samples that are used although something about them was noticed, by cause.
    pub flagged: BTreeMap<&'static str, u64>,
}

/// Why a recording has no timeline.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TimelineError {
    /// No rate was given and none can be measured.
    #[error("no sample rate: give --rate HZ, or a recording with a time_s column")]
    NoRate,
    /// The rate that was given is no rate.
    #[error("a sample rate of {0} Hz: it must be positive and finite")]
    BadRate(f64),
    /// Most time stamps are equal, or they span no time.
    #[error("the time stamps show no sample period: give --rate HZ")]
    NoPeriod,
    /// Too few samples for one octave of the Allan deviation.
    #[error("record too short: {used} usable samples, one octave needs {FEWEST_SAMPLES}")]
    TooShort {
        /// Samples that are left after the unusable ones.
        used: u64,
    },
}

impl Timeline {
    /// Lays the samples of `recording` along a line of equal periods.
    ///
    /// `rate`, in Hz, overrides what the time stamps say. Gaps are read from the sample index where there is one, else from
    /// the time stamps; without either the samples are taken to be complete.
    ///
    /// # Errors
    /// There is no usable rate, or there are fewer than [`FEWEST_SAMPLES`] usable samples.
    pub fn of(recording: &Recording, rate: Option<f64>) -> Result<Self, TimelineError> {
        if let Some(rate) = rate
            && !(rate.is_finite() && rate > 0.0)
        {
            return Err(TimelineError::BadRate(rate));
        }
        let samples = &recording.samples;
        let re_reads = ReReads::of(samples, rate);
        let mut dropped = BTreeMap::from([("gap", 0)]);
        let mut flagged = BTreeMap::new();
        let mut used = Vec::with_capacity(samples.len());
        for (position, sample) in samples.iter().enumerate() {
            let refused = if re_reads.contain(samples, position) { REFUSED | Faults::REPEATED } else { REFUSED };
            match (sample.faults & refused).cause() {
                Some(cause) => *dropped.entry(cause).or_insert(0) += 1,
                None => {
                    used.push(position);
                    for cause in sample.faults.causes() {
                        *flagged.entry(cause).or_insert(0) += 1;
                    }
                }
            }
        }
        if (used.len() as u64) < FEWEST_SAMPLES {
            return Err(TimelineError::TooShort { used: used.len() as u64 });
        }
        let (slots, measured) = slots(samples, &used, rate)?;
        let (steps, never_arrived) = steps(&used, &slots);
        dropped.insert("gap", never_arrived);
        let sample_rate_hz = rate.or(measured).ok_or(TimelineError::NoRate)?;
        Ok(Self { sample_rate_hz, stated_rate_hz: rate, steps, dropped, flagged })
    }
}

/// The samples of `recording` that can be used, on their time base. `rate`, in Hz, overrides what the time stamps say.
///
/// # Errors
/// As [`Timeline::of`].
pub fn measurement(recording: &Recording, rate: Option<f64>) -> Result<Measurement, TimelineError> {
    let timeline = Timeline::of(recording, rate)?;
    let (mut slots, mut used, mut slot) = (Vec::new(), Vec::new(), 0_u64);
    for step in &timeline.steps {
        match *step {
            Step::Gap(missing) => slot = slot.saturating_add(u64::from(missing)),
            Step::Sample(position) => {
                slots.push(slot);
                used.push(&recording.samples[position]);
                slot = slot.saturating_add(1);
            }
        }
    }
    let profile = adis16405::profile(recording.range.lsb());
    let channel = |channel: &Channel| MeasuredChannel {
        profile: profile.channels[*channel as usize],
        counts: used.iter().map(|sample| i32::from(sample.counts.get(*channel))).collect(),
    };
    Ok(Measurement {
        channels: recording.channels.iter().map(channel).collect(),
        profile,
        sample_rate_hz: timeline.sample_rate_hz,
        stated_rate_hz: timeline.stated_rate_hz,
        times_s: used.iter().map(|sample| sample.clock.time_s).collect(),
        slots,
        dropped: timeline.dropped,
        flagged: timeline.flagged,
    })
}

/// What tells a sample that was read twice from two that are equal by chance: it comes too soon.
struct ReReads {
    /// Shortest interval between two samples that were both taken, s; 0 where there is no clock.
    shortest: f64,
}

impl ReReads {
    fn of(samples: &[Sample], rate: Option<f64>) -> Self {
        let times: Option<Vec<f64>> = samples.iter().map(|sample| sample.clock.time_s).collect();
        let period = times.and_then(|times| period(&times, rate));
        Self { shortest: RE_READ_WITHIN * period.unwrap_or(0.0) }
    }

    fn contain(&self, samples: &[Sample], position: usize) -> bool {
        let time = |position: usize| samples.get(position).and_then(|sample| sample.clock.time_s);
        match (position.checked_sub(1).and_then(time), time(position)) {
            (Some(previous), Some(now)) => now - previous < self.shortest,
            _ => false,
        }
    }
}

/// Sample period in s, as `rate` tells or else as the `times` show.
fn period(times: &[f64], rate: Option<f64>) -> Option<f64> {
    rate.map(f64::recip).or_else(|| deliveries::period(times))
}

/// The period in which each used sample was taken, counted from any origin, and the rate in Hz where it can be measured.
fn slots(samples: &[Sample], used: &[usize], rate: Option<f64>) -> Result<(Vec<u64>, Option<f64>), TimelineError> {
    let indices: Option<Vec<u64>> = used.iter().map(|&p| samples[p].clock.index).collect();
    let times: Option<Vec<f64>> = used.iter().map(|&p| samples[p].clock.time_s).collect();
    match (indices, times) {
        (Some(indices), times) => {
            let measured = times.and_then(|t| deliveries::rate(&indices, &t, |_| true));
            Ok((indices, measured))
        }
        (None, Some(times)) => {
            let period = period(&times, rate).ok_or(TimelineError::NoPeriod)?;
            let deliveries = Deliveries::with_period(&times, period);
            let measured = deliveries.rate(&times);
            if rate.is_none() && measured.is_none() {
                return Err(TimelineError::NoPeriod);
            }
            Ok((deliveries.slots, measured))
        }
        // Untimed: a refused sample leaves its own place empty, nothing else is missing.
        (None, None) => Ok((used.iter().map(|&p| p as u64).collect(), None)),
    }
}

/// Samples and gaps, and how many of the missing samples are not accounted for by refused ones.
fn steps(used: &[usize], slots: &[u64]) -> (Vec<Step>, u64) {
    let mut steps = Vec::with_capacity(used.len());
    let mut never_arrived = 0u64;
    for (at, &position) in used.iter().enumerate() {
        if at > 0 {
            let missing = slots[at].saturating_sub(slots[at - 1]).saturating_sub(1);
            let refused = (position - used[at - 1] - 1) as u64;
            never_arrived = never_arrived.saturating_add(missing.saturating_sub(refused));
            if missing > 0 {
                steps.push(Step::Gap(u32::try_from(missing).unwrap_or(u32::MAX)));
            }
        }
        steps.push(Step::Sample(position));
    }
    (steps, never_arrived)
}
