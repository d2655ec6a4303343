//! Samples on their time base, in batches, in bounded memory: a first reading finds rate, length and counts.

use crate::batch_source::{BatchSource, ProfiledColumn, RecordedRows};
use crate::file_format::{ReadOptions, RecordedInput, options_of_counts};
use crate::reading::column_survey::{ColumnSurvey, refusal, rounding_note};
use crate::reading::full_scale::FullScale;
use crate::recording::{Recording, Verdict};
use adis16405_driver::{Faults, GyroRange};
use measurement::{
    ChannelProfile, MeasuredChannel, Measurement, RecordingDescription, SampleBlock, SensorProfile, adis16405,
    lost_part,
};
use readers::ReadingNote;
use readers::{
    ACCELEROMETER, BATCH, ColumnQuantizer, GYROSCOPE, InputError, MAGNETOMETER, PaddingFinder, ReadMonitor, ReadPass,
    RowBefore, Unpadded, WantedRows,
};
use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use time_base::{Clock, Place, Placed, RowStamp, StampQuality, TimeBaseError, TimeRange};

type Batch = readers::Batch<Verdict>;

pub use readers::{RowsRead, StreamError};

/// Sample periods kept from the start.
const BEGINNING: u64 = 1 << 16;
/// Rows kept of a longer recording at first.
const ROWS_OF_BEGINNING: usize = 1 << 16;
/// 64 MiB, to avoid a second reading.
const MOST_KEPT_VALUES: u64 = 1 << 23;

/// Fewest channels for a repeated sample; fewer are equal by chance.
const MIN_CHANNELS_OF_REPEAT: usize = 3;

/// Limits of a measurement in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeptInMemory {
    pub rows: u64,
    /// Most rows with more than `most_lost` missing.
    pub rows_with_losses: u64,
    /// Part of the samples.
    pub most_lost: f64,
}

impl KeptInMemory {
    /// All of them.
    pub const ALL: Self = Self { rows: u64::MAX, rows_with_losses: u64::MAX, most_lost: 1.0 };

    /// Rows of the longest recording that may be one measurement.
    fn most_rows(self) -> u64 {
        self.rows_with_losses.max(self.rows)
    }

    /// True for a measurement in memory.
    fn has_room(self, samples: u64, periods: u64) -> bool {
        samples <= if lost_part(samples, periods) > self.most_lost { self.rows_with_losses } else { self.rows }
    }
}

/// How a recording is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Stated rate, Hz; overrides the time stamps.
    pub stated_hz: Option<f64>,
    pub part: Option<TimeRange>,
    /// Limits of a measurement in memory.
    pub kept: KeptInMemory,
    /// Per batch; does not affect the result.
    pub batch_rows: usize,
}

impl Reading {
    /// All samples, of which `kept` become one measurement.
    #[must_use]
    pub fn new(stated_hz: Option<f64>, kept: KeptInMemory) -> Self {
        Self { stated_hz, part: None, kept, batch_rows: BATCH }
    }

    /// The reading of a part.
    #[must_use]
    pub fn of_part(self, part: Option<TimeRange>) -> Self {
        Self { part, ..self }
    }

    fn wanted(self, most_rows: u64) -> WantedRows {
        WantedRows { part: self.part, stated_hz: self.stated_hz, most_rows, batch_rows: self.batch_rows.max(1) }
    }
}

/// An open recording.
pub struct SampleStream {
    origin: Origin<'static>,
    reading: Reading,
    survey: Survey,
    samples: SurveyedSamples,
    monitor: ReadMonitor,
}

struct SurveyedSamples {
    beginning: Measurement,
    description: RecordingDescription,
    notes: Vec<ReadingNote>,
    /// `beginning` is all.
    is_in_memory: bool,
}

enum Origin<'a> {
    File { input: RecordedInput, options: Box<ReadOptions>, range: Option<GyroRange> },
    Recording(Cow<'a, Recording>),
}

impl Origin<'_> {
    fn open(&self) -> Result<BatchSource<'_>, InputError> {
        match self {
            Self::File { input, options, range } => input.batches(options, *range),
            Self::Recording(recording) => Ok(BatchSource::Recording(RecordedRows::new(recording))),
        }
    }

    /// Estimate by the first `rows`.
    fn expected_rows(&self, rows: u64) -> Option<u64> {
        match self {
            Self::File { input, .. } => input.expected_rows(rows),
            Self::Recording(_) => None,
        }
    }

    fn sensor(&self) -> SensorProfile {
        match self {
            Self::File { options, .. } => options.sensor.clone(),
            Self::Recording(recording) => adis16405::profile(recording.range.lsb()),
        }
    }
}

impl SampleStream {
    /// From a simulation or a bus log.
    ///
    /// # Errors
    /// It has no time base.
    pub fn recorded(recording: Recording, reading: Reading) -> Result<Self, TimeBaseError> {
        let origin = Origin::Recording(Cow::Owned(recording));
        Self::open(origin, reading, &ReadMonitor::default()).map_err(without_file)
    }

    /// ADIS16405 register counts with rates in `range`.
    ///
    /// # Errors
    /// The file is damaged, or has no time base: see [`TimeBaseError`].
    pub fn counts(input: RecordedInput, range: GyroRange, reading: Reading) -> Result<Self, StreamError> {
        let options = Box::new(options_of_counts(range));
        let monitor = input.monitor().clone();
        Self::open(Origin::File { input, options, range: Some(range) }, reading, &monitor)
    }

    /// Opens a recording of any sensor.
    ///
    /// # Errors
    /// As [`counts`](Self::counts), and where the columns cannot be chosen.
    pub fn any_sensor(input: RecordedInput, options: ReadOptions, reading: Reading) -> Result<Self, StreamError> {
        let monitor = input.monitor().clone();
        Self::open(Origin::File { input, options: Box::new(options), range: None }, reading, &monitor)
    }

    fn open(mut origin: Origin<'static>, reading: Reading, monitor: &ReadMonitor) -> Result<Self, StreamError> {
        let survey = SurveyPass { origin: &origin, reading, most_rows: u64::MAX, monitor }.survey();
        let mut survey = survey.or_else(|error| match &mut origin {
            // A stated rate needs no times, which may be the fault.
            Origin::File { options, .. } if reading.stated_hz.is_some() => {
                options.selection = std::mem::take(&mut options.selection).without_time();
                let pass = SurveyPass { origin: &origin, reading, most_rows: u64::MAX, monitor };
                let Ok(mut survey) = pass.survey() else { return Err(error) };
                survey.read.notes.push(format!("the time stamps are ignored: {error}").into());
                Ok(survey)
            }
            _ => Err(error),
        })?;
        let samples = survey.samples(reading.kept)?;
        Ok(Self { origin, reading, survey, samples, monitor: monitor.clone() })
    }

    /// The samples at the start with stamps: all if in memory, else 2¹⁶ sample periods.
    #[must_use]
    pub fn beginning(&self) -> &Measurement {
        &self.samples.beginning
    }

    /// Ends the reading.
    #[must_use]
    pub fn into_beginning(self) -> Measurement {
        self.samples.beginning
    }

    /// Description before the samples are used.
    #[must_use]
    pub fn description(&self) -> &RecordingDescription {
        &self.samples.description
    }

    /// Remarks for the user, one sentence each.
    #[must_use]
    pub fn notes(&self) -> &[ReadingNote] {
        &self.samples.notes
    }

    /// The rows read.
    #[must_use]
    pub fn rows_read(&self) -> &RowsRead {
        &self.survey.read
    }

    /// `None` without stamps.
    #[must_use]
    pub fn stamps(&self) -> Option<&StampQuality> {
        self.survey.stamps.as_ref()
    }

    /// True if the [beginning](Self::beginning) is all.
    #[must_use]
    pub fn is_in_memory(&self) -> bool {
        self.samples.is_in_memory
    }

    /// Reads once, calling `take` with each block.
    ///
    /// False if the [description](Self::description) has changed (a number off the step, a stop): read again, at most a
    /// bounded number of times.
    ///
    /// # Errors
    /// The file is damaged.
    pub fn read(&mut self, mut take: impl FnMut(SampleBlock)) -> Result<bool, StreamError> {
        let Self { survey, origin, reading, monitor, samples } = self;
        if samples.is_in_memory {
            samples.beginning.blocks(BATCH).for_each(take);
            return Ok(true);
        }
        let mut off_step = vec![false; survey.columns.len()];
        let mut placer = Placer::new(survey.clock.again()?, survey.columns.len());
        let mut give = |placer: &mut Placer, batch: Option<Batch>| -> Result<(), StreamError> {
            for rows in placer.place(batch)? {
                take(survey.block(&rows, &mut off_step));
            }
            Ok(())
        };
        if survey.kept.has_all_rows {
            survey.kept.batches.iter().try_for_each(|batch| give(&mut placer, Some(batch.clone())))?;
        } else {
            monitor.begin_pass(ReadPass::Samples);
            let wanted = reading.wanted(survey.read.rows);
            let mut rows_before = 0;
            let read = origin.open()?.for_each_batch(wanted, |mut batch| {
                let rows = batch.rows as u64;
                survey.unpadded.apply(rows_before, &mut batch);
                rows_before += rows;
                give(&mut placer, Some(batch))
            })?;
            if read.is_stopped && read.rows < survey.read.rows {
                *survey = SurveyPass { origin, reading: *reading, most_rows: read.rows, monitor }.survey()?;
                survey.read.is_stopped = true;
                *samples = survey.samples(reading.kept)?;
                return Ok(false);
            }
        }
        give(&mut placer, None)?;
        if !off_step.contains(&true) {
            return Ok(true);
        }
        survey.leave_step(&mut off_step);
        *samples = survey.samples(reading.kept)?;
        Ok(false)
    }
}

/// The error of a recording in memory.
fn without_file(error: StreamError) -> TimeBaseError {
    match error {
        StreamError::TimeBase(error) => error,
        StreamError::Input(error) => TimeBaseError::Irregular(error.to_string()),
    }
}

#[derive(Debug, Clone, Default)]
struct Totals {
    first: Option<Placed>,
    last: Placed,
    left_out: u64,
    samples: u64,
    never_arrived: u64,
    /// By cause, without those that never arrived.
    dropped: BTreeMap<&'static str, u64>,
    flagged: BTreeMap<&'static str, u64>,
}

/// Cause of rows whose time goes back.
const TIME_BACKWARDS: &str = "time_backwards";

impl Totals {
    fn leave_out(&mut self, cause: &'static str) {
        *self.dropped.entry(cause).or_insert(0) += 1;
        self.left_out += 1;
    }

    /// Returns the sample period from the first usable sample, if used.
    fn add(&mut self, place: Place, verdict: Option<&Verdict>, has_index: bool) -> Option<u64> {
        if let Some(cause) = verdict.and_then(|verdict| verdict.loss) {
            self.leave_out(cause);
            return None;
        }
        let Place::At(placed) = place else {
            self.leave_out("repeated");
            return None;
        };
        let warnings = verdict.map(|verdict| verdict.faults & Faults::WARNINGS).filter(|faults| !faults.is_empty());
        for cause in warnings.into_iter().flat_map(Faults::causes) {
            *self.flagged.entry(cause).or_insert(0) += 1;
        }
        let lost = match self.first {
            None => 0,
            // Rows left out have an index too.
            Some(_) if has_index => (placed.period - self.last.period - 1).saturating_sub(self.left_out),
            Some(_) => placed.missing - self.last.missing,
        };
        self.never_arrived = self.never_arrived.saturating_add(lost);
        let first = *self.first.get_or_insert(placed);
        (self.last, self.left_out) = (placed, 0);
        self.samples += 1;
        Some(placed.period.saturating_sub(first.period))
    }

    /// From the first to the last usable sample, inclusive.
    fn periods(&self) -> u64 {
        self.first.map_or(0, |first| (self.last.period - first.period).saturating_add(1))
    }

    fn dropped(&self, has_index: bool) -> BTreeMap<&'static str, u64> {
        let mut dropped = self.dropped.clone();
        // Rows left out are gaps by the stamps.
        let left_out = dropped.get(TIME_BACKWARDS).copied().filter(|_| !has_index).unwrap_or(0);
        dropped.insert("gap", self.never_arrived.saturating_sub(left_out));
        dropped
    }
}

/// Sample periods of rows, which may need later rows.
struct Placer {
    clock: Clock,
    can_repeat: bool,
    before: RowBefore,
    /// Not all placed, with the number placed in the first.
    waiting: VecDeque<Batch>,
    placed: usize,
    totals: Totals,
    has_index: bool,
    periods: Vec<u64>,
    is_used: Vec<bool>,
}

impl Placer {
    fn new(clock: Clock, columns: usize) -> Self {
        Self {
            clock,
            can_repeat: columns >= MIN_CHANNELS_OF_REPEAT,
            before: RowBefore::default(),
            waiting: VecDeque::new(),
            placed: 0,
            totals: Totals::default(),
            has_index: false,
            periods: Vec::new(),
            is_used: Vec::new(),
        }
    }

    /// Takes rows or the end; returns completed batches, `indices` being sample periods from the first usable sample.
    fn place(&mut self, batch: Option<Batch>) -> Result<Vec<Batch>, TimeBaseError> {
        let is_last = batch.is_none();
        let batch = batch.unwrap_or_default();
        let stamps = self.stamps(&batch);
        self.has_index |= !batch.indices.is_empty();
        if !is_last {
            self.waiting.push_back(batch);
        }
        let mut places = self.clock.place(stamps, is_last)?.into_iter();
        let mut complete = Vec::new();
        while let Some(batch) = self.waiting.front() {
            if self.placed == batch.rows {
                complete.extend(self.complete());
                continue;
            }
            let Some(place) = places.next() else { break };
            for _ in batch.backwards.iter().filter(|at| **at == self.placed) {
                self.totals.leave_out(TIME_BACKWARDS);
            }
            let period = self.totals.add(place, batch.verdicts.get(self.placed), self.has_index);
            self.is_used.push(period.is_some());
            self.periods.extend(period);
            self.placed += 1;
        }
        Ok(complete)
    }

    fn complete(&mut self) -> Option<Batch> {
        let mut batch = self.waiting.pop_front()?;
        for _ in batch.backwards.iter().filter(|at| **at >= self.placed) {
            self.totals.leave_out(TIME_BACKWARDS);
        }
        self.placed = 0;
        batch.indices = Vec::new();
        batch.backwards = Vec::new();
        batch.retain(&std::mem::take(&mut self.is_used));
        batch.indices = std::mem::take(&mut self.periods);
        Some(batch)
    }

    fn stamps(&mut self, batch: &Batch) -> Vec<RowStamp> {
        // Without times no row is a repeat.
        let can_repeat = self.can_repeat && !batch.times.is_empty();
        let equals = if can_repeat { self.before.equals(batch) } else { vec![false; batch.rows] };
        let stamp = |(row, is_equal)| RowStamp {
            time_s: batch.times.get(row).copied(),
            index: batch.indices.get(row).copied(),
            is_equal,
        };
        equals.into_iter().enumerate().map(stamp).collect()
    }
}

struct StreamedColumn {
    column: ProfiledColumn,
    survey: ColumnSurvey,
    quantizer: Option<ColumnQuantizer>,
}

struct Survey {
    sensor: SensorProfile,
    unpadded: Unpadded,
    columns: Vec<StreamedColumn>,
    clock: Clock,
    stamps: Option<StampQuality>,
    stated_hz: Option<f64>,
    sample_rate_hz: f64,
    totals: Totals,
    has_index: bool,
    full_scale: u64,
    full_scale_notes: Vec<String>,
    read: RowsRead,
    kept: Kept,
}

/// A reading of up to `most_rows`.
#[derive(Clone, Copy)]
struct SurveyPass<'a> {
    origin: &'a Origin<'a>,
    reading: Reading,
    most_rows: u64,
    monitor: &'a ReadMonitor,
}

impl SurveyPass<'_> {
    /// Without padding.
    fn survey(self) -> Result<Survey, StreamError> {
        let mut padding = PaddingFinder::default();
        let survey = self.unpadded(Unpadded::ALL, &mut padding);
        let Some(unpadded) = padding.finish() else { return survey };
        let mut survey = self.unpadded(unpadded, &mut PaddingFinder::default())?;
        survey.read.padding = unpadded.first + padding.rows() - unpadded.end;
        survey.read.notes.push(unpadded.note(padding.rows()).into());
        Ok(survey)
    }

    /// Reads again if fewer rows than expected have to be kept.
    fn unpadded(self, unpadded: Unpadded, padding: &mut PaddingFinder) -> Result<Survey, StreamError> {
        let new = || Kept::new(self.reading.kept);
        let kept = Kept { is_by_expectation: self.reading.part.is_none(), ..new() };
        let survey = self.rows(kept, unpadded, padding)?;
        let is_as_expected = survey.kept.has_all_rows || survey.kept.rows > self.reading.kept.most_rows();
        if is_as_expected { Ok(survey) } else { self.rows(new(), unpadded, &mut PaddingFinder::default()) }
    }

    fn rows(self, mut kept: Kept, unpadded: Unpadded, padding: &mut PaddingFinder) -> Result<Survey, StreamError> {
        let Self { origin, reading, most_rows, monitor } = self;
        let wanted = reading.wanted(most_rows);
        monitor.begin_pass(ReadPass::FirstRows);
        let mut source = origin.open()?;
        let columns: Vec<ProfiledColumn> = source.columns().to_vec();
        let stated_hz = wanted.stated_hz.or(source.rate_hz());
        let mut placer = Placer::new(Clock::new(stated_hz)?, columns.len());
        let mut surveys = vec![ColumnSurvey::default(); columns.len()];
        let mut full_scale = FullScale::new(&columns);
        let mut rows_before = 0u64;
        // NaN if refused.
        let mut usable: Vec<Vec<f64>> = Vec::new();
        let are_registers = columns.iter().any(|column| column.register.is_some());
        let read = source.for_each_batch(wanted, |mut batch| {
            let all_rows = batch.rows as u64;
            unpadded.apply(rows_before, &mut batch);
            // The burst validator counts frozen registers.
            if !are_registers {
                padding.add(&batch);
            }
            if kept.add(&batch, |rows| origin.expected_rows(rows)) {
                monitor.begin_pass(ReadPass::Survey);
            }
            usable.clone_from(&batch.values);
            for (survey, (column, values)) in surveys.iter_mut().zip(columns.iter().zip(&mut usable)) {
                survey.add(column, values, &batch.verdicts);
            }
            full_scale.add_rows(&columns, rows_before, &usable);
            rows_before += all_rows;
            placer.place(Some(batch))?;
            Ok(())
        })?;
        placer.place(None)?;
        let Placer { totals, clock, has_index, .. } = placer;
        let unfilled = never_filled(&columns, &surveys);
        let quantizer = |(at, (survey, column)): (usize, (&ColumnSurvey, &ProfiledColumn))| {
            survey.quantizer(column).filter(|_| !unfilled.contains(&at))
        };
        let quantizers: Vec<Option<ColumnQuantizer>> =
            surveys.iter().zip(&columns).enumerate().map(quantizer).collect();
        let (full_scale, full_scale_notes) = full_scale.finish(&columns, &quantizers);
        let mut dropped = totals.dropped(has_index);
        if quantizers.iter().all(Option::is_none) {
            for (cause, count) in surveys.iter().flat_map(|survey| &survey.refused) {
                let most = dropped.entry(*cause).or_insert(0);
                *most = (*most).max(*count);
            }
            return Err(TimeBaseError::TooShort { used: 0, dropped }.into());
        }
        dropped.remove("gap");
        let sample_rate_hz = clock.rate_hz(totals.samples, totals.periods(), &dropped)?;
        let columns = columns.into_iter().zip(surveys).zip(quantizers);
        Ok(Survey {
            columns: columns
                .map(|((column, survey), quantizer)| StreamedColumn { column, survey, quantizer })
                .collect(),
            sensor: origin.sensor(),
            unpadded,
            stamps: clock.stamps(),
            clock,
            stated_hz,
            sample_rate_hz,
            totals,
            has_index,
            full_scale,
            full_scale_notes,
            read,
            kept,
        })
    }
}

impl Survey {
    fn samples(&mut self, limit: KeptInMemory) -> Result<SurveyedSamples, StreamError> {
        let has_room = limit.has_room(self.totals.samples, self.totals.periods());
        let is_in_memory = self.kept.has_all_rows && has_room;
        let before = if is_in_memory { u64::MAX } else { BEGINNING };
        let mut off_step = vec![false; self.columns.len()];
        let mut beginning = self.measurement(before, &mut off_step)?;
        // At most once per column.
        while off_step.contains(&true) {
            self.leave_step(&mut off_step);
            beginning = self.measurement(before, &mut off_step)?;
        }
        let description = self.description();
        if is_in_memory {
            self.kept.batches.clear();
            beginning.dropped.clone_from(&description.dropped);
            beginning.flagged.clone_from(&description.flagged);
        }
        Ok(SurveyedSamples { beginning, description, notes: self.notes(), is_in_memory })
    }

    fn description(&self) -> RecordingDescription {
        let dropped = self.totals.dropped(self.has_index);
        let mut flagged = self.totals.flagged.clone();
        flagged.extend(Some(("saturated", self.full_scale)).filter(|(_, count)| *count > 0));
        flagged.extend(self.stamps.iter().flat_map(StampQuality::warnings));
        RecordingDescription {
            profile: self.sensor.clone(),
            sample_rate_hz: self.sample_rate_hz,
            samples: self.totals.samples,
            periods: self.totals.periods(),
            channels: self.columns.iter().filter_map(StreamedColumn::profile).collect(),
            dropped,
            flagged,
        }
    }

    fn notes(&self) -> Vec<ReadingNote> {
        let unfilled = self.columns.iter().filter(|of| of.quantizer.is_none());
        let unfilled = unfilled.map(|StreamedColumn { column, survey, .. }| {
            let what = if survey.is_zero() {
                "is never filled: it is zero in every row, as its other axes are"
            } else {
                "has no usable value"
            };
            format!("{} ({}) {what}, and is left out", column.channel.name, column.label)
        });
        let rounded = self.columns.iter().filter_map(|of| Some((&of.column.channel, of.quantizer.as_ref()?)));
        let of_samples = self.full_scale_notes.iter().cloned().chain(unfilled).chain(self.missing_notes());
        let of_samples = of_samples.chain(rounding_note(rounded));
        let of_times = self.stamps.iter().flat_map(StampQuality::notes).chain(self.clock.note().map(str::to_owned));
        self.read.notes.iter().cloned().chain(of_samples.chain(of_times).map(ReadingNote::from)).collect()
    }

    /// Channels with equal counts share a note.
    fn missing_notes(&self) -> Vec<String> {
        let mut channels: BTreeMap<(&str, u64, usize), Vec<&str>> = BTreeMap::new();
        for StreamedColumn { column, survey, .. } in self.columns.iter().filter(|of| of.quantizer.is_some()) {
            for (cause, count) in &survey.refused {
                let what = match *cause {
                    "missing" => "missing",
                    "not_finite" => "infinite",
                    "out_of_range" => "outside of any range",
                    // Reports count register faults.
                    _ => continue,
                };
                channels.entry((what, *count, survey.rows())).or_default().push(column.channel.name);
            }
        }
        let note = |((what, count, rows), names): ((&str, u64, usize), Vec<&str>)| {
            let are = if count == 1 { "is" } else { "are" };
            format!("{count} of {rows} values of {} {are} {what}", names.join(", "))
        };
        channels.into_iter().map(note).collect()
    }

    /// Requantizes the columns set in `off_step`.
    fn leave_step(&mut self, off_step: &mut [bool]) {
        for (of, off_step) in self.columns.iter_mut().zip(off_step) {
            if std::mem::take(off_step) {
                of.quantizer = Some(of.survey.quantizer_without_step());
            }
        }
    }

    fn block(&self, rows: &Batch, off_step: &mut [bool]) -> SampleBlock {
        let channels = self.columns.iter().zip(&rows.values).zip(off_step);
        let channels = channels.filter_map(|((of, values), off_step)| of.channel(values, &rows.verdicts, off_step));
        SampleBlock { channels: channels.collect(), slots: rows.indices.clone() }
    }

    /// Before the sample period `before`.
    fn measurement(&self, before: u64, off_step: &mut [bool]) -> Result<Measurement, StreamError> {
        let mut measurement = Measurement {
            profile: self.sensor.clone(),
            sample_rate_hz: self.sample_rate_hz,
            stated_rate_hz: self.stated_hz,
            slots: Vec::new(),
            times_s: Some(Vec::new()),
            channels: Vec::new(),
            dropped: BTreeMap::new(),
            flagged: BTreeMap::new(),
        };
        let mut placer = Placer::new(self.clock.again()?, self.columns.len());
        let end = self.kept.has_all_rows.then_some(None);
        for batch in self.kept.batches.iter().cloned().map(Some).chain(end) {
            for rows in placer.place(batch)? {
                append(&mut measurement, self.block(&rows, off_step), &rows.times);
            }
            if measurement.slots.last().is_some_and(|last| *last >= before) {
                break;
            }
        }
        let samples = measurement.slots.len();
        measurement.times_s = measurement.times_s.filter(|times| times.len() == samples && samples > 0);
        Ok(if before == u64::MAX { measurement } else { measurement.before(before) })
    }
}

/// All-zero vectors beside others: unfilled fields.
fn never_filled(columns: &[ProfiledColumn], surveys: &[ColumnSurvey]) -> Vec<usize> {
    let of_group = |group: &[&str; 3]| -> Vec<usize> {
        let is_own = |at: &usize| group.contains(&columns[*at].channel.name) && columns[*at].register.is_none();
        let own: Vec<usize> = (0..columns.len()).filter(is_own).collect();
        if own.len() == group.len() && own.iter().all(|at| surveys[*at].is_zero()) { own } else { Vec::new() }
    };
    let unfilled: Vec<usize> = [GYROSCOPE, ACCELEROMETER, MAGNETOMETER].iter().flat_map(of_group).collect();
    if unfilled.len() < columns.len() { unfilled } else { Vec::new() }
}

fn append(measurement: &mut Measurement, block: SampleBlock, times_s: &[f64]) {
    let samples = measurement.slots.len();
    measurement.slots.extend(block.slots);
    measurement.times_s.iter_mut().for_each(|times| times.extend(times_s));
    if measurement.channels.is_empty() {
        measurement.channels = block.channels;
        return;
    }
    for (channel, next) in measurement.channels.iter_mut().zip(block.channels) {
        channel.counts.extend(next.counts);
        for (cause, positions) in next.refused {
            channel.refused.entry(cause).or_default().extend(positions.into_iter().map(|at| at + samples));
        }
    }
}

impl StreamedColumn {
    fn profile(&self) -> Option<ChannelProfile> {
        let lsb = self.quantizer.as_ref()?.lsb * self.column.factor;
        Some(ChannelProfile { lsb, ..self.column.channel })
    }

    /// Sets `off_step` for a number off the step.
    fn channel(&self, values: &[f64], verdicts: &[Verdict], off_step: &mut bool) -> Option<MeasuredChannel> {
        let (quantizer, profile) = (self.quantizer.as_ref()?, self.profile()?);
        if self.column.register.is_some() && verdicts.iter().all(|verdict| verdict.refused.is_empty()) {
            // All but missing words are counts.
            if !values.iter().any(|value| value.is_nan()) {
                return Some(MeasuredChannel::new(profile, values.iter().map(|value| *value as i32).collect()));
            }
        }
        let mut counts = Vec::with_capacity(values.len());
        let mut refused: BTreeMap<&'static str, Vec<usize>> = BTreeMap::new();
        for (position, &value) in values.iter().enumerate() {
            let count = match refusal(&self.column, value, verdicts.get(position)) {
                // A refused register word stays.
                Some(cause) => {
                    refused.entry(cause).or_default().push(position);
                    quantizer.count(value).filter(|_| self.column.register.is_some())
                }
                None => {
                    let (count, is_on_step) = quantizer.count_on_step(value);
                    *off_step |= !is_on_step;
                    if count.is_none() {
                        refused.entry("out_of_range").or_default().push(position);
                    }
                    count
                }
            };
            counts.push(count.unwrap_or_default());
        }
        Some(MeasuredChannel { refused, ..MeasuredChannel::new(profile, counts) })
    }
}

struct Kept {
    limit: KeptInMemory,
    batches: VecDeque<Batch>,
    rows: u64,
    has_all_rows: bool,
    /// Dropped as soon as too many are expected.
    is_by_expectation: bool,
}

impl Kept {
    fn new(limit: KeptInMemory) -> Self {
        Self { limit, batches: VecDeque::new(), rows: 0, has_all_rows: true, is_by_expectation: false }
    }

    /// True if not all rows are kept any more; `expected` estimates the total.
    fn add(&mut self, batch: &Batch, expected: impl Fn(u64) -> Option<u64>) -> bool {
        let had_all_rows = self.has_all_rows;
        self.rows += batch.rows as u64;
        let most = self.limit.most_rows().max(MOST_KEPT_VALUES / batch.values.len().max(1) as u64);
        let is_expected_more = || {
            let can_tell = self.is_by_expectation && self.rows >= ROWS_OF_BEGINNING as u64;
            can_tell && expected(self.rows).is_some_and(|expected| expected > most)
        };
        if self.has_all_rows && (self.rows > most || is_expected_more()) {
            self.has_all_rows = false;
            let mut rows = 0;
            self.batches.retain(|batch| {
                rows += batch.rows;
                rows - batch.rows < ROWS_OF_BEGINNING
            });
        }
        let kept: usize = if self.has_all_rows { 0 } else { self.batches.iter().map(|batch| batch.rows).sum() };
        if self.has_all_rows || kept < ROWS_OF_BEGINNING {
            self.batches.push_back(batch.clone());
        }
        had_all_rows && !self.has_all_rows
    }
}

/// A recording on its time base.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatedTimeBase {
    pub measurement: Measurement,
    /// `None` without stamps.
    pub stamps: Option<StampQuality>,
}

/// The usable samples of `recording` on their time base, as [`time_base`] gives them.
///
/// # Errors
/// As [`time_base`].
pub fn measurement(recording: &Recording, rate_hz: Option<f64>) -> Result<Measurement, TimeBaseError> {
    time_base(recording, rate_hz).map(|base| base.measurement)
}

/// Usable samples on their time base, and stamp quality.
///
/// `rate_hz` overrides the stamps. Gaps follow from the index, else from stamps; with neither, only refused samples are
/// missing.
///
/// # Errors
/// There is no usable rate or the given one contradicts the stamps, there are fewer than 4 usable samples, no two of
/// them are neighbours, or the gaps are more than 64 times as long as the samples.
pub fn time_base(recording: &Recording, rate_hz: Option<f64>) -> Result<EstimatedTimeBase, TimeBaseError> {
    let (origin, monitor) = (Origin::Recording(Cow::Borrowed(recording)), ReadMonitor::default());
    let reading = Reading::new(rate_hz, KeptInMemory::ALL);
    let pass = SurveyPass { origin: &origin, reading, most_rows: u64::MAX, monitor: &monitor };
    let mut survey = pass.survey().map_err(without_file)?;
    let samples = survey.samples(reading.kept).map_err(without_file)?;
    Ok(EstimatedTimeBase { measurement: samples.beginning, stamps: survey.stamps })
}

/// The samples of a recording in a part of its time.
///
/// # Errors
/// There is neither a time nor a rate, or no sample in the part.
pub fn part_of(mut recording: Recording, part: TimeRange, stated_hz: Option<f64>) -> Result<Recording, TimeBaseError> {
    let inside = RecordedRows::new(&recording).inside(part, stated_hz)?;
    recording.samples = inside.into_iter().map(|at| recording.samples[at]).collect();
    Ok(recording)
}
