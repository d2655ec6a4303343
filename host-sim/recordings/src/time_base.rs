//! Time base of a recording: its sample rate, and the sample period in which each sample was taken.
//!
//! A sample that was read late is not a lost sample, and stamps that are coarser than the sample period are no losses:
//! a loss is counted only where nothing else explains the stamps. What they cannot tell is said in [`StampQuality`].

mod clock_rate;
mod indexed_clock;
mod lateness_track;
mod lower_envelope;
pub(crate) mod sample_slots;
mod stamp_alignment;
pub(crate) mod stamp_quality;
mod stamp_tick;
pub(crate) mod stream_clock;
pub(crate) mod time_base_error;
mod time_range;

use crate::counts::recording::{RecordedSample, Recording};
use crate::time_base::lateness_track::COARSE;
use crate::time_base::sample_slots::{MAX_REPEATED_READ_INTERVAL, contradiction, slots, usual_interval};
use crate::time_base::stamp_alignment::StampAlignment;
use crate::time_base::time_base_error::MIN_SAMPLES;
use adis16405_driver::{Channel, Faults};
use measurement::{MeasuredChannel, Measurement, RecordingDescription, SensorProfile, adis16405};
use std::collections::BTreeMap;

pub use crate::time_base::indexed_clock::ClockStep;
pub use crate::time_base::lateness_track::LostStretch;
pub use crate::time_base::stamp_alignment::RateEstimate;
pub use crate::time_base::stamp_quality::StampQuality;
pub use crate::time_base::time_base_error::TimeBaseError;
pub use crate::time_base::time_range::TimeRange;

/// Distance before a loss, in widths of the lateness, at which a sample that was taken to be read twice may be what is missing.
const SEARCHED_WIDTHS: f64 = 4.0;

/// A recording on its time base.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatedTimeBase {
    /// The usable samples.
    pub measurement: Measurement,
    /// What the time stamps show; `None` where the samples have none.
    pub stamps: Option<StampQuality>,
}

/// The usable samples of `recording` on their time base, as [`time_base`] gives them.
///
/// # Errors
/// As [`time_base`].
pub fn measurement(recording: &Recording, rate_hz: Option<f64>) -> Result<Measurement, TimeBaseError> {
    time_base(recording, rate_hz).map(|base| base.measurement)
}

/// The usable samples of `recording` on their time base, and what the time stamps show.
///
/// `rate_hz` overrides the rate that the time stamps show. Gaps are read from the sample index where there is one, else from
/// the time stamps; without either only samples that are left out for a fault are missing.
///
/// # Errors
/// There is no usable rate or the given one contradicts the stamps, there are fewer than 4 usable samples, no two of them
/// are neighbours, or the gaps are more than 64 times as long as the samples.
pub fn time_base(recording: &Recording, rate_hz: Option<f64>) -> Result<EstimatedTimeBase, TimeBaseError> {
    let usable = UsableSamples::place(recording, rate_hz)?;
    Ok(EstimatedTimeBase { stamps: usable.stamps.clone(), measurement: usable.into_measurement(recording) })
}

/// Which samples of a recording can be used, and where they lie in time.
pub(crate) struct UsableSamples {
    /// Indices into [`Recording::samples`].
    pub(crate) positions: Vec<usize>,
    /// The measurement without counts and time stamps.
    pub(crate) base: Measurement,
    /// What the time stamps show.
    pub(crate) stamps: Option<StampQuality>,
}

impl UsableSamples {
    /// Of a recording, as [`time_base`].
    pub(crate) fn place(recording: &Recording, rate_hz: Option<f64>) -> Result<Self, TimeBaseError> {
        if let Some(rate) = rate_hz
            && !(rate.is_finite() && rate > 0.0)
        {
            return Err(TimeBaseError::InvalidRate(rate));
        }
        let samples = &recording.samples;
        let mut usable = Usable::select(samples, rate_hz);
        if (usable.positions.len() as u64) < MIN_SAMPLES {
            return Err(TimeBaseError::TooShort { used: usable.positions.len() as u64, dropped: usable.dropped });
        }
        let SamplePeriods { periods, never_arrived, stamps } = sample_periods(samples, &mut usable, rate_hz)?;
        let Usable { positions, mut dropped, mut flagged, .. } = usable;
        let measured_hz = stamps.as_ref().and_then(|stamps| stamps.rate).map(|rate| rate.hz);
        let sample_rate_hz = rate_hz.or(measured_hz).ok_or(TimeBaseError::NoRate)?;
        let slots = slots(&periods)?;
        dropped.insert("gap", never_arrived);
        if let Some(stamps) = &stamps {
            flagged.extend(stamps.warnings());
        }
        let base = Measurement {
            profile: adis16405::profile(recording.range.lsb()),
            sample_rate_hz,
            stated_rate_hz: rate_hz,
            slots,
            times_s: None,
            channels: Vec::new(),
            dropped,
            flagged,
        };
        Ok(Self { positions, base, stamps })
    }

    /// The samples of `recording`, of which these are the usable ones.
    pub(crate) fn into_measurement(self, recording: &Recording) -> Measurement {
        with_samples(self.base, recording, &self.positions)
    }

    /// The same, before the sample period `slot`, as [`Measurement::before`].
    pub(crate) fn before(&self, slot: u64, recording: &Recording) -> Measurement {
        let base = self.base.before(slot);
        let positions = &self.positions[..base.len()];
        with_samples(base, recording, positions)
    }

    /// What is known of `recording` before its samples are used.
    pub(crate) fn description(&self, recording: &Recording) -> RecordingDescription {
        let profile = |channel: &Channel| self.base.profile.channels[*channel as usize];
        let channels = recording.channels.iter().map(profile).collect();
        RecordingDescription { channels, ..RecordingDescription::from(&self.base) }
    }
}

fn with_samples(base: Measurement, recording: &Recording, positions: &[usize]) -> Measurement {
    let samples = positions.iter().map(|&position| recording.samples[position]);
    Measurement {
        channels: channels(&recording.channels, &base.profile, samples.clone()),
        times_s: samples.map(|sample| sample.time_stamp.time_s).collect(),
        ..base
    }
}

/// The channels of some samples.
pub(crate) fn channels(
    recorded: &[Channel],
    profile: &SensorProfile,
    samples: impl Iterator<Item = RecordedSample> + Clone,
) -> Vec<MeasuredChannel> {
    let channel = |&channel: &Channel| {
        let counts = samples.clone().map(|sample| i32::from(sample.counts.get(channel))).collect();
        let refused = refused_positions(channel, samples.clone());
        MeasuredChannel { refused, ..MeasuredChannel::new(profile.channels[channel as usize], counts) }
    };
    recorded.iter().map(channel).collect()
}

/// Positions of the samples that are refused in `channel` alone, by cause.
fn refused_positions(
    channel: Channel,
    samples: impl Iterator<Item = RecordedSample>,
) -> BTreeMap<&'static str, Vec<usize>> {
    let mut refused: BTreeMap<&'static str, Vec<usize>> = BTreeMap::new();
    for (position, sample) in samples.enumerate().filter(|(_, sample)| !sample.refused.is_empty()) {
        if let Some(cause) = sample.cause_of_refusal(channel) {
            refused.entry(cause).or_default().push(position);
        }
    }
    refused
}

/// The samples of a recording that can be used.
struct Usable {
    /// Indices into [`Recording::samples`].
    positions: Vec<usize>,
    /// Samples that are left out, by cause.
    dropped: BTreeMap<&'static str, u64>,
    /// Samples that are used although a warning was raised, by cause.
    flagged: BTreeMap<&'static str, u64>,
    /// Samples that were read twice, whatever other faults they have, in their order.
    read_twice: Vec<usize>,
}

impl Usable {
    fn select(samples: &[RecordedSample], rate_hz: Option<f64>) -> Self {
        let times: Option<Vec<f64>> = samples.iter().map(|sample| sample.time_stamp.time_s).collect();
        let period_s = rate_hz.map(f64::recip).or_else(|| usual_interval(&times.unwrap_or_default()));
        // 0 without times: then no sample is taken to be read twice.
        let shortest_s = MAX_REPEATED_READ_INTERVAL * period_s.unwrap_or(0.0);
        let time = |position: usize| samples[position].time_stamp.time_s;
        let read_twice = |position: usize| match (position.checked_sub(1).and_then(time), time(position)) {
            (Some(previous), Some(now)) => now - previous < shortest_s,
            _ => false,
        };
        let mut usable = Self {
            positions: Vec::with_capacity(samples.len()),
            dropped: BTreeMap::new(),
            flagged: BTreeMap::new(),
            read_twice: Vec::new(),
        };
        for (position, sample) in samples.iter().enumerate() {
            let read_twice = read_twice(position) && sample.faults.contains(Faults::REPEATED);
            if read_twice {
                usable.read_twice.push(position);
            }
            match sample.cause_of_loss(read_twice) {
                Some(cause) => *usable.dropped.entry(cause).or_insert(0) += 1,
                None => {
                    usable.positions.push(position);
                    for cause in (sample.faults & Faults::WARNINGS).causes() {
                        *usable.flagged.entry(cause).or_insert(0) += 1;
                    }
                }
            }
        }
        usable
    }

    /// All samples but those that were read twice: a sample that is left out for another fault arrived at its time.
    fn arrived(&self, samples: usize) -> Vec<usize> {
        (0..samples).filter(|position| self.read_twice.binary_search(position).is_err()).collect()
    }

    /// Takes samples back that equal the one before by chance: where the coarse stamps of the others show that as many samples are
    /// missing. Returns whether there are any.
    fn take_back(&mut self, samples: &[RecordedSample], alignment: &StampAlignment) -> bool {
        let arrived = self.arrived(samples.len());
        let reach = (SEARCHED_WIDTHS * alignment.width).ceil() as usize;
        let mut taken = Vec::new();
        let mut read_twice = self.read_twice.iter().copied().peekable();
        for loss in &alignment.losses {
            let first = arrived[loss.before.saturating_sub(reach)];
            let last = arrived[(loss.before + reach / 4).min(arrived.len() - 1)];
            let mut missing = loss.missing;
            while let Some(position) = read_twice.next_if(|&position| position < last) {
                if position > first && missing > 0 {
                    taken.push(position);
                    missing -= 1;
                }
            }
        }
        self.read_twice.retain(|position| taken.binary_search(position).is_err());
        for &position in &taken {
            // It stays left out for another fault.
            if samples[position].cause_of_loss(false).is_none() {
                if let Some(count) = Faults::REPEATED.cause().and_then(|cause| self.dropped.get_mut(cause)) {
                    *count -= 1;
                }
                for cause in (samples[position].faults & Faults::WARNINGS).causes() {
                    *self.flagged.entry(cause).or_insert(0) += 1;
                }
                self.positions.push(position);
            }
        }
        self.dropped.retain(|_, count| *count > 0);
        self.positions.sort_unstable();
        !taken.is_empty()
    }
}

/// Where the usable samples lie in time.
struct SamplePeriods {
    /// The sample period in which each was taken, counted from any origin.
    periods: Vec<u64>,
    /// Samples between them that never arrived.
    never_arrived: u64,
    /// What the time stamps show.
    stamps: Option<StampQuality>,
}

fn sample_periods(
    samples: &[RecordedSample],
    usable: &mut Usable,
    rate_hz: Option<f64>,
) -> Result<SamplePeriods, TimeBaseError> {
    let indices: Option<Vec<u64>> = usable.positions.iter().map(|&p| samples[p].time_stamp.index).collect();
    let times_of = |positions: &[usize]| -> Option<Vec<f64>> {
        let mut times = Vec::with_capacity(positions.len());
        for &position in positions {
            times.push(samples[position].time_stamp.time_s?);
        }
        Some(times)
    };
    if let Some(indices) = indices {
        let least = indices.windows(2).map(|pair| pair[1] - pair[0]).min().unwrap_or(1);
        if least > 1 {
            return Err(TimeBaseError::NoNeighbours(least));
        }
        let stamps = times_of(&usable.positions).map(|times| StampQuality::of_index(&indices, &times));
        let never_arrived = indices.windows(2).zip(usable.positions.windows(2)).map(|(indices, positions)| {
            let left_out = (positions[1] - positions[0] - 1) as u64;
            (indices[1] - indices[0] - 1).saturating_sub(left_out)
        });
        let never_arrived = never_arrived.fold(0, u64::saturating_add);
        return Ok(SamplePeriods { periods: indices, never_arrived, stamps });
    }
    // The positions of those that arrived are made anew where they are needed: the alignment takes the memory.
    let Some(mut times) = times_of(&usable.arrived(samples.len())) else {
        // Without time stamps a sample that is left out leaves its own period empty, and nothing else is missing.
        let periods = usable.positions.iter().map(|&position| position as u64).collect();
        return Ok(SamplePeriods { periods, never_arrived: 0, stamps: None });
    };
    let mut alignment = StampAlignment::new(&times, rate_hz).ok_or(TimeBaseError::NoPeriod)?;
    // Coarse stamps do not tell a sample that was read twice from one that equals the one before by chance; the number of
    // samples does.
    if alignment.width >= COARSE && usable.take_back(samples, &alignment) {
        times = times_of(&usable.arrived(samples.len())).unwrap_or_default();
        alignment = StampAlignment::new(&times, rate_hz).ok_or(TimeBaseError::NoPeriod)?;
    }
    match rate_hz {
        Some(stated_hz) => contradiction(&times, &alignment, stated_hz)?,
        None if alignment.rate.is_none() => return Err(TimeBaseError::NoPeriod),
        None => {}
    }
    drop(times);
    let arrived = usable.arrived(samples.len());
    let StampAlignment { periods, late, mut losses, rate, tick_s, width, resolved, least_loss, is_rate_changing } =
        alignment;
    losses.iter_mut().for_each(|loss| loss.before = arrived[loss.before]);
    let usable_range = usable.positions.first().zip(usable.positions.last());
    let between =
        |loss: &&LostStretch| usable_range.is_some_and(|(first, last)| loss.before > *first && loss.before <= *last);
    let never_arrived = losses.iter().filter(between).map(|loss| loss.missing).fold(0, u64::saturating_add);
    let late = late.into_iter().filter(|late| *late).count() as u64;
    // Both lists of positions increase, and the usable samples have arrived.
    let mut usable_positions = usable.positions.iter().peekable();
    let periods = arrived
        .iter()
        .zip(periods)
        .filter(|(position, _)| usable_positions.next_if(|usable| usable == position).is_some())
        .map(|(_, period)| period)
        .collect();
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
    Ok(SamplePeriods { periods, never_arrived, stamps: Some(stamps) })
}
