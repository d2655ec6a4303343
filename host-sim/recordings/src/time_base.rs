//! Time base of a recording: its sample rate, and the sample period in which each sample was taken.
//!
//! A sample that was read late is not a lost sample, and stamps that are coarser than the sample period are no losses:
//! a loss is counted only where nothing else explains the stamps. What they cannot tell is said in [`StampQuality`].

use crate::indexed_clock::IndexedClock;
use crate::lateness_track::COARSE;
use crate::recording::{RecordedSample, Recording};
use crate::stamp_alignment::{StampAlignment, uncertain};
use adis16405_driver::{Channel, Faults};
use measurement::{MeasuredChannel, Measurement, adis16405};
use std::collections::BTreeMap;

pub use crate::indexed_clock::ClockStep;
pub use crate::lateness_track::LostStretch;
pub use crate::stamp_alignment::RateEstimate;

/// Fewest samples that give one octave of the Allan deviation: two adjacent windows of one sample in each half of the record.
const MIN_SAMPLES: u64 = 4;

/// Faults of one channel's word: the sample is left out in this channel alone.
const REFUSED_IN_A_CHANNEL: Faults = Faults::IMPOSSIBLE_RATE.union(Faults::X_SIGN);

/// Faults for which a sample is left out in every channel. The others are warnings; their samples are used.
const REFUSED: Faults = Faults::all()
    .difference(REFUSED_IN_A_CHANNEL)
    .difference(Faults::REPEATED)
    .difference(Faults::ERROR_ALARM)
    .difference(Faults::SUPPLY);

/// Longest interval, in sample periods, at which a sample equal to the one before is the same sample read twice. Equal samples
/// farther apart are chance: a filtered output of few counts repeats about once in a thousand samples.
const MAX_REPEATED_READ_INTERVAL: f64 = 0.75;

/// Samples whose median duration tells which interval is shorter than a period.
const REPEATED_READ_WINDOW: usize = 32;

/// Distance before a loss, in widths of the lateness, at which a sample that was taken to be read twice may be what is missing.
const SEARCHED_WIDTHS: f64 = 4.0;

/// Largest relative difference between the stated and the measured rate: a wrong nominal rate and a clock on a breadboard,
/// not another rate.
const MAX_RATE_CONTRADICTION: f64 = 0.1;

/// Share of samples that follow their neighbour below which the stated rate is doubted.
const MIN_NEIGHBOURS: f64 = 0.75;

/// Most sample periods of a recording for each of its samples, and beside them. The gaps of a series of this length fit into
/// memory.
const MAX_PERIODS_PER_SAMPLE: u64 = 64;
const MAX_PERIODS: u64 = 1 << 22;

/// Why a recording has no time base.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
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
    /// The time stamps show another rate than the given one.
    #[error("--rate {stated_hz} contradicts the time stamps: by them it is {measured_hz:.4} Hz")]
    RateContradictsStamps {
        /// As given, Hz.
        stated_hz: f64,
        /// By the time stamps, Hz.
        measured_hz: f64,
    },
    /// No sample follows another one by one sample period.
    #[error("no two neighbouring samples: a step of the column sample is at least {0}")]
    NoNeighbours(u64),
    /// The gaps are so long that their periods do not fit into memory.
    #[error(
        "{samples} samples in {periods} sample periods: the gaps are longer than this analysis holds; give each stretch its \
         own file"
    )]
    TooSparse {
        /// Usable samples.
        samples: u64,
        /// Sample periods from the first to the last.
        periods: u64,
    },
    /// Too few samples for one octave of the Allan deviation.
    #[error("record too short: {used} usable samples, one octave needs {MIN_SAMPLES}{}", list(.dropped))]
    TooShort {
        /// Samples without a fault for which they are left out.
        used: u64,
        /// Samples that were left out, by cause.
        dropped: BTreeMap<&'static str, u64>,
    },
}

/// The causes for which samples were left out, as the end of a sentence.
fn list(dropped: &BTreeMap<&'static str, u64>) -> String {
    let causes: Vec<String> = dropped.iter().map(|(cause, count)| format!("{cause} {count}")).collect();
    if causes.is_empty() { String::new() } else { format!("; left out: {}", causes.join(", ")) }
}

/// A recording on its time base.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatedTimeBase {
    /// The usable samples.
    pub measurement: Measurement,
    /// What the time stamps show; `None` where the samples have none.
    pub stamps: Option<StampQuality>,
}

/// What the time stamps of a recording show, and what they cannot show.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StampQuality {
    /// The rate by the clock that stamped the samples, whatever rate was stated.
    pub rate: Option<RateEstimate>,
    /// Tick of that clock, s: the step that all stamps are multiples of. `None` where it is less than a twentieth of a period.
    pub tick_s: Option<f64>,
    /// Width of the lateness of ordinary samples, sample periods: the tick and the jitter. 0 where the samples have an index.
    pub width: f64,
    /// Losses that the stamps show, refused samples included; none where the samples have an index.
    pub losses: Vec<LostStretch>,
    /// Whether losses of single samples are told from the rounding of the stamps.
    pub resolved: bool,
    /// Samples that were read at least a period later than the others.
    pub late: u64,
    /// Where the index and the stamps contradict each other.
    pub clock_steps: Vec<ClockStep>,
}

impl StampQuality {
    /// What a reader of the analysis has to know, one sentence each; none for stamps that leave no doubt.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let (Some(rate), true) = (self.rate, self.width >= COARSE) {
            let tick = self.tick_s.map_or_else(String::new, |tick| format!(", ticks of {:.4} ms", 1e3 * tick));
            notes.push(format!(
                "the time stamps are coarser than the sample period ({:.2} periods{tick}): {:.4} Hz ({:.4} to {:.4}); a loss \
                 is located to {:.0} samples",
                self.width, rate.hz, rate.low_hz, rate.high_hz, self.width.ceil(),
            ));
        }
        let uncertain: u64 = self.uncertain_losses();
        if uncertain > 0 {
            notes.push(format!(
                "{uncertain} lost samples are uncertain: the rounding of the time stamps may show the same"
            ));
        }
        if !self.resolved {
            notes.push("losses of single samples cannot be told from the rounding of the time stamps".to_owned());
        }
        if let Some(step) = self.clock_steps.first() {
            notes.push(format!(
                "index and time contradict each other at {} places, first before sample {} by {:+.3} s; the index is believed",
                self.clock_steps.len(),
                step.before,
                step.seconds
            ));
        }
        notes
    }

    /// Samples in losses that something else may explain.
    pub fn uncertain_losses(&self) -> u64 {
        uncertain(&self.losses, self.resolved)
    }
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
        let warnings = [
            ("late_delivery", stamps.late),
            ("uncertain_loss", stamps.uncertain_losses()),
            ("clock_step", stamps.clock_steps.len() as u64),
        ];
        flagged.extend(warnings.into_iter().filter(|(_, count)| *count > 0));
    }

    let profile = adis16405::profile(recording.range.lsb());
    let channel = |channel: &Channel| {
        let counts = positions.iter().map(|&p| i32::from(samples[p].counts.get(*channel))).collect();
        let refused = refused_positions(*channel, positions.iter().map(|&p| &samples[p]));
        MeasuredChannel { refused, ..MeasuredChannel::new(profile.channels[*channel as usize], counts) }
    };
    let measurement = Measurement {
        channels: recording.channels.iter().map(channel).collect(),
        profile,
        sample_rate_hz,
        stated_rate_hz: rate_hz,
        times_s: positions.iter().map(|&p| samples[p].time_stamp.time_s).collect(),
        slots,
        dropped,
        flagged,
    };
    Ok(EstimatedTimeBase { measurement, stamps })
}

/// Positions of the samples that are refused in `channel` alone, by cause.
fn refused_positions<'a>(
    channel: Channel,
    samples: impl Iterator<Item = &'a RecordedSample>,
) -> BTreeMap<&'static str, Vec<usize>> {
    let mut refused: BTreeMap<&'static str, Vec<usize>> = BTreeMap::new();
    for (position, sample) in samples.enumerate().filter(|(_, sample)| sample.faults.intersects(REFUSED_IN_A_CHANNEL)) {
        let is_gyro = [Channel::GyroX, Channel::GyroY, Channel::GyroZ].contains(&channel);
        let impossible = is_gyro && sample.counts.get(channel).unsigned_abs() > Faults::LARGEST_RATE.unsigned_abs();
        let own = if impossible {
            Faults::IMPOSSIBLE_RATE
        } else if channel == Channel::GyroX {
            sample.faults & Faults::X_SIGN
        } else {
            Faults::empty()
        };
        if let Some(cause) = own.cause() {
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
            let refused = if read_twice(position) { REFUSED | Faults::REPEATED } else { REFUSED };
            let faults = sample.faults & refused;
            match faults.cause() {
                Some(cause) => {
                    *usable.dropped.entry(cause).or_insert(0) += 1;
                    if faults.contains(Faults::REPEATED) {
                        usable.read_twice.push(position);
                    }
                }
                None => {
                    usable.positions.push(position);
                    for cause in sample.faults.difference(REFUSED_IN_A_CHANNEL).causes() {
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

    /// Takes samples back that equal the one before by chance: where the coarse stamps of the others, `arrived`, show that as
    /// many samples are missing. Returns whether there are any.
    fn take_back(&mut self, samples: &[RecordedSample], arrived: &[usize], alignment: &StampAlignment) -> bool {
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
            let faults = samples[position].faults;
            // It stays left out for another fault.
            if (faults & REFUSED).cause().is_none() {
                if let Some(count) = Faults::REPEATED.cause().and_then(|cause| self.dropped.get_mut(cause)) {
                    *count -= 1;
                }
                for cause in faults.difference(REFUSED_IN_A_CHANNEL).causes() {
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

/// The mean interval of the window of samples that lasts as long as half of the others, s.
fn usual_interval(times: &[f64]) -> Option<f64> {
    let window = if times.len() > 4 * REPEATED_READ_WINDOW { REPEATED_READ_WINDOW } else { 1 };
    let mut durations: Vec<f64> = times.windows(window + 1).map(|row| row[window] - row[0]).collect();
    let middle = durations.len() / 2;
    let duration = (!durations.is_empty()).then(|| *durations.select_nth_unstable_by(middle, f64::total_cmp).1)?;
    (duration > 0.0 && duration.is_finite()).then_some(duration / window as f64)
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
        positions.iter().map(|&position| samples[position].time_stamp.time_s).collect()
    };
    if let Some(indices) = indices {
        let least = indices.windows(2).map(|pair| pair[1] - pair[0]).min().unwrap_or(1);
        if least > 1 {
            return Err(TimeBaseError::NoNeighbours(least));
        }
        let stamps = times_of(&usable.positions).map(|times| {
            let IndexedClock { rate, steps } = IndexedClock::new(&indices, &times);
            StampQuality { rate, clock_steps: steps, resolved: true, ..StampQuality::default() }
        });
        let never_arrived = indices.windows(2).zip(usable.positions.windows(2)).map(|(indices, positions)| {
            let left_out = (positions[1] - positions[0] - 1) as u64;
            (indices[1] - indices[0] - 1).saturating_sub(left_out)
        });
        let never_arrived = never_arrived.fold(0, u64::saturating_add);
        return Ok(SamplePeriods { periods: indices, never_arrived, stamps });
    }
    let mut arrived = usable.arrived(samples.len());
    let Some(mut times) = times_of(&arrived) else {
        // Without time stamps a sample that is left out leaves its own period empty, and nothing else is missing.
        let periods = usable.positions.iter().map(|&position| position as u64).collect();
        return Ok(SamplePeriods { periods, never_arrived: 0, stamps: None });
    };
    let mut alignment = StampAlignment::new(&times, rate_hz).ok_or(TimeBaseError::NoPeriod)?;
    // Coarse stamps do not tell a sample that was read twice from one that equals the one before by chance; the number of
    // samples does.
    if alignment.width >= COARSE && usable.take_back(samples, &arrived, &alignment) {
        arrived = usable.arrived(samples.len());
        times = times_of(&arrived).unwrap_or_default();
        alignment = StampAlignment::new(&times, rate_hz).ok_or(TimeBaseError::NoPeriod)?;
    }
    match rate_hz {
        Some(stated_hz) => contradiction(&times, &alignment, stated_hz)?,
        None if alignment.rate.is_none() => return Err(TimeBaseError::NoPeriod),
        None => {}
    }
    let StampAlignment { periods, late, mut losses, rate, tick_s, width, resolved } = alignment;
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
    let stamps = StampQuality { rate, tick_s, width, losses, resolved, late, clock_steps: Vec::new() };
    Ok(SamplePeriods { periods, never_arrived, stamps: Some(stamps) })
}

/// Checks a stated rate against the stamps.
fn contradiction(times: &[f64], alignment: &StampAlignment, stated_hz: f64) -> Result<(), TimeBaseError> {
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
fn slots(periods: &[u64]) -> Result<Vec<u64>, TimeBaseError> {
    let first = periods.first().copied().unwrap_or(0);
    let slots: Vec<u64> = periods.iter().map(|period| period.saturating_sub(first)).collect();
    // Periods beyond the range of u64 are all the same.
    let is_increasing = slots.is_sorted_by(|one, next| one < next);
    let (samples, span) = (slots.len() as u64, slots.last().copied().unwrap_or(0));
    if !is_increasing || (span / MAX_PERIODS_PER_SAMPLE > samples && span > MAX_PERIODS) {
        return Err(TimeBaseError::TooSparse { samples, periods: span.saturating_add(1) });
    }
    Ok(slots)
}
