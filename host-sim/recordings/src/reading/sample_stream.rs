//! The samples of a recording on their time base, read in batches.
//!
//! A first reading tells the rate, the length, and the size of a count. The rows of a recording that is short enough are kept from it; a
//! longer one is read once more for its samples. Both go the same way, so that memory does not depend on the length of a recording, and
//! nothing else does either.

use crate::batch_source::{BatchSource, RecordedRows};
use crate::file_format::{RecordedInput, options_of_counts};
use crate::reading::column_survey::{ColumnSurvey, refusal, rounding_note};
use crate::reading::full_scale::FullScale;
use crate::recording::{Recording, Verdict};
use adis16405_driver::{Faults, GyroRange};
use measurement::{
    ChannelProfile, MeasuredChannel, Measurement, RecordingDescription, SampleBlock, SensorProfile, adis16405,
    lost_part,
};
use readers::{
    ACCELEROMETER, BATCH, ColumnQuantizer, GYROSCOPE, InputError, MAGNETOMETER, PaddingFinder, ReadMonitor,
    ReadOptions, ReadPass, RowBefore, Unpadded, ValueColumn, WantedRows,
};
use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use time_base::{Clock, Place, Placed, RowStamp, StampQuality, TimeBaseError, TimeRange};

type Batch = readers::Batch<Verdict>;

pub use readers::{RowsRead, StreamError};

/// Sample periods at the start of a recording whose samples are kept.
const BEGINNING: u64 = 1 << 16;
/// Rows that are kept of a longer recording, to begin with.
const ROWS_OF_BEGINNING: usize = 1 << 16;
/// Numbers that are kept, so that the file is not read again: 64 MiB.
const MOST_KEPT_VALUES: u64 = 1 << 23;

/// Fewest channels whose equal rows may be one sample that was read twice; fewer are equal by chance.
const MIN_CHANNELS_OF_REPEAT: usize = 3;

/// Which recordings become one measurement in memory, instead of being read in blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeptInMemory {
    /// Those of at most so many rows.
    pub rows: u64,
    /// Those of at most so many rows where a larger part than `most_lost` of the samples never arrived.
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

    /// True if so many samples in so many sample periods are one measurement.
    fn has_room(self, samples: u64, periods: u64) -> bool {
        samples <= if lost_part(samples, periods) > self.most_lost { self.rows_with_losses } else { self.rows }
    }
}

/// Part of a recording that is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The sample rate, Hz, if it is stated: it overrides the one that the time stamps show.
    pub stated_hz: Option<f64>,
    /// A part by time.
    pub part: Option<TimeRange>,
    /// Which recordings become one measurement.
    pub kept: KeptInMemory,
    /// Rows that are read at a time; the result is the same for any number.
    pub batch_rows: usize,
}

impl Reading {
    /// All samples, of which `kept` become one measurement.
    #[must_use]
    pub fn new(stated_hz: Option<f64>, kept: KeptInMemory) -> Self {
        Self { stated_hz, part: None, kept, batch_rows: BATCH }
    }

    /// The same of a part.
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

/// Facts of the samples before they are used.
struct SurveyedSamples {
    /// The samples at the start, or all of a recording that is held in memory.
    beginning: Measurement,
    description: RecordingDescription,
    notes: Vec<String>,
    /// True if `beginning` is all of it.
    is_in_memory: bool,
}

/// Origin of the rows.
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

    /// How many rows there are, where the first `rows` of them tell it.
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
    /// The stream of a simulation or of a log of the bus.
    ///
    /// # Errors
    /// It has no time base.
    pub fn recorded(recording: Recording, reading: Reading) -> Result<Self, TimeBaseError> {
        let origin = Origin::Recording(Cow::Owned(recording));
        Self::open(origin, reading, &ReadMonitor::default()).map_err(without_file)
    }

    /// Opens a table of register counts whose rates were taken in `range`.
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

    fn open(origin: Origin<'static>, reading: Reading, monitor: &ReadMonitor) -> Result<Self, StreamError> {
        let mut survey = Survey::read(&origin, reading, u64::MAX, monitor)?;
        let samples = survey.samples(reading.kept)?;
        Ok(Self { origin, reading, survey, samples, monitor: monitor.clone() })
    }

    /// The samples at the start of the recording with their time stamps: all of one that is held in memory, else those of the first 2¹⁶
    /// sample periods, of which the size of a count may be that of these samples alone.
    #[must_use]
    pub fn beginning(&self) -> &Measurement {
        &self.samples.beginning
    }

    /// The same, of a recording that is not read any more.
    #[must_use]
    pub fn into_beginning(self) -> Measurement {
        self.samples.beginning
    }

    /// Description of the recording before its samples are used.
    #[must_use]
    pub fn description(&self) -> &RecordingDescription {
        &self.samples.description
    }

    /// Notes for the user, one sentence each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.samples.notes
    }

    /// Rows that were read of the file.
    #[must_use]
    pub fn rows_read(&self) -> &RowsRead {
        &self.survey.read
    }

    /// Quality of the time stamps; `None` where there are none.
    #[must_use]
    pub fn stamps(&self) -> Option<&StampQuality> {
        self.survey.stamps.as_ref()
    }

    /// True if the recording is one measurement in memory: its [beginning](Self::beginning) is all of it.
    #[must_use]
    pub fn is_in_memory(&self) -> bool {
        self.samples.is_in_memory
    }

    /// Reads the recording once and calls `take` with each block of its samples.
    ///
    /// False if what the [description](Self::description) says has changed on the way, so that it has to be read again: a number
    /// is no multiple of the step of the others, or the reading was stopped. That happens a bounded number of times.
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
        if survey.has_all_rows {
            survey.kept.iter().try_for_each(|batch| give(&mut placer, Some(batch.clone())))?;
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
                *survey = Survey::read(origin, *reading, read.rows, monitor)?;
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

/// Counts of the rows that are placed.
#[derive(Debug, Clone, Default)]
struct Totals {
    /// Place of the first usable sample, and of the last one.
    first: Option<Placed>,
    last: Placed,
    /// Rows that were left out since the last usable one.
    left_out: u64,
    samples: u64,
    never_arrived: u64,
    /// Rows that were left out, by cause, without those that never arrived.
    dropped: BTreeMap<&'static str, u64>,
    flagged: BTreeMap<&'static str, u64>,
}

/// Cause of rows that are left out because their time goes back.
const TIME_BACKWARDS: &str = "time_backwards";

impl Totals {
    fn leave_out(&mut self, cause: &'static str) {
        *self.dropped.entry(cause).or_insert(0) += 1;
        self.left_out += 1;
    }

    /// Counts a row; its sample period from the first usable sample, if it is used.
    fn add(&mut self, place: Place, verdict: Option<&Verdict>, has_index: bool) -> Option<u64> {
        if let Some(cause) = verdict.and_then(|verdict| verdict.loss) {
            self.leave_out(cause);
            return None;
        }
        let Place::At(placed) = place else {
            self.leave_out("repeated");
            return None;
        };
        // Hardly any row has one.
        let warnings = verdict.map(|verdict| verdict.faults & Faults::WARNINGS).filter(|faults| !faults.is_empty());
        for cause in warnings.into_iter().flat_map(Faults::causes) {
            *self.flagged.entry(cause).or_insert(0) += 1;
        }
        let lost = match self.first {
            None => 0,
            // A row that is left out has an index too.
            Some(_) if has_index => (placed.period - self.last.period - 1).saturating_sub(self.left_out),
            Some(_) => placed.missing - self.last.missing,
        };
        self.never_arrived = self.never_arrived.saturating_add(lost);
        let first = *self.first.get_or_insert(placed);
        (self.last, self.left_out) = (placed, 0);
        self.samples += 1;
        Some(placed.period.saturating_sub(first.period))
    }

    /// Sample periods from the first usable sample to the last, both included.
    fn periods(&self) -> u64 {
        self.first.map_or(0, |first| (self.last.period - first.period).saturating_add(1))
    }

    /// Samples that are missing or were refused, by cause.
    fn dropped(&self, has_index: bool) -> BTreeMap<&'static str, u64> {
        let mut dropped = self.dropped.clone();
        // By their stamps, rows that were left out are missing between the others.
        let left_out = dropped.get(TIME_BACKWARDS).copied().filter(|_| !has_index).unwrap_or(0);
        dropped.insert("gap", self.never_arrived.saturating_sub(left_out));
        dropped
    }
}

/// Finds the sample periods of rows, which may be known only when later rows have come.
struct Placer {
    clock: Clock,
    can_repeat: bool,
    before: RowBefore,
    /// Batches whose rows are not all placed, and how many of the first one are.
    waiting: VecDeque<Batch>,
    placed: usize,
    totals: Totals,
    has_index: bool,
    /// Sample periods of the usable rows of the first batch.
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

    /// Takes the next rows, or their end. Returns the batches of which all rows are placed now, without the rows that are not used; their
    /// `indices` are the sample periods from the first usable sample.
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

    /// The first batch, without the rows that are not used.
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

    /// Facts of the rows for the clock.
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

/// A column whose numbers become counts.
struct StreamedColumn {
    column: ValueColumn,
    survey: ColumnSurvey,
    /// `None` where no number can be used.
    quantizer: Option<ColumnQuantizer>,
}

/// Findings of the first reading of a recording.
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
    /// The first rows, or all of them, of so many.
    kept: VecDeque<Batch>,
    has_all_rows: bool,
    rows: u64,
}

impl Survey {
    /// Reads `most_rows` rows, without the padding at either end of them.
    fn read(origin: &Origin, reading: Reading, most_rows: u64, monitor: &ReadMonitor) -> Result<Self, StreamError> {
        let mut padding = PaddingFinder::default();
        let survey = Self::read_kept(origin, reading, most_rows, monitor, Unpadded::ALL, &mut padding);
        let Some(unpadded) = padding.finish() else { return survey };
        let mut survey = Self::read_kept(origin, reading, most_rows, monitor, unpadded, &mut PaddingFinder::default())?;
        survey.read.padding = unpadded.first + padding.rows() - unpadded.end;
        survey.read.notes.push(unpadded.note(padding.rows()));
        Ok(survey)
    }

    /// The same of these rows. A file that has fewer rows than its first ones let expect is read once more, since they have to be kept.
    fn read_kept(
        origin: &Origin,
        reading: Reading,
        most_rows: u64,
        monitor: &ReadMonitor,
        unpadded: Unpadded,
        padding: &mut PaddingFinder,
    ) -> Result<Self, StreamError> {
        let read = |kept: Kept, padding: &mut PaddingFinder| {
            Self::read_rows(origin, reading.wanted(most_rows), kept, monitor, unpadded, padding)
        };
        let kept = Kept { is_by_expectation: reading.part.is_none(), ..Kept::new(reading.kept) };
        let survey = read(kept, padding)?;
        let is_as_expected = survey.has_all_rows || survey.rows > reading.kept.most_rows();
        if is_as_expected { Ok(survey) } else { read(Kept::new(reading.kept), &mut PaddingFinder::default()) }
    }

    fn read_rows(
        origin: &Origin,
        wanted: WantedRows,
        mut kept: Kept,
        monitor: &ReadMonitor,
        unpadded: Unpadded,
        padding: &mut PaddingFinder,
    ) -> Result<Self, StreamError> {
        monitor.begin_pass(ReadPass::FirstRows);
        let mut source = origin.open()?;
        let columns: Vec<ValueColumn> = source.columns().to_vec();
        let stated_hz = wanted.stated_hz.or(source.rate_hz());
        let mut placer = Placer::new(Clock::new(stated_hz)?, columns.len());
        let mut surveys = vec![ColumnSurvey::new(); columns.len()];
        let mut full_scale = FullScale::new(&columns);
        let mut rows_before = 0u64;
        // The numbers of a batch, NaN where they are refused.
        let mut usable: Vec<Vec<f64>> = Vec::new();
        let are_registers = columns.iter().any(|column| column.register.is_some());
        let read = source.for_each_batch(wanted, |mut batch| {
            let all_rows = batch.rows as u64;
            unpadded.apply(rows_before, &mut batch);
            // Registers that do not change are frozen ones, which the burst validator counts.
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
        let quantizer = |(at, (survey, column)): (usize, (&ColumnSurvey, &ValueColumn))| {
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
        Ok(Self {
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
            has_all_rows: kept.has_all_rows,
            rows: kept.rows,
            kept: kept.batches,
        })
    }

    /// Makes the measurement of the rows that are kept.
    fn samples(&mut self, limit: KeptInMemory) -> Result<SurveyedSamples, StreamError> {
        let has_room = limit.has_room(self.totals.samples, self.totals.periods());
        let is_in_memory = self.has_all_rows && has_room;
        let before = if is_in_memory { u64::MAX } else { BEGINNING };
        let mut off_step = vec![false; self.columns.len()];
        let mut beginning = self.measurement(before, &mut off_step)?;
        // A column leaves its step once.
        while off_step.contains(&true) {
            self.leave_step(&mut off_step);
            beginning = self.measurement(before, &mut off_step)?;
        }
        let description = self.description();
        if is_in_memory {
            self.kept = VecDeque::new();
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

    /// Sentences on the rows, the columns and the clock.
    fn notes(&self) -> Vec<String> {
        let mut notes = self.read.notes.clone();
        notes.extend(self.full_scale_notes.iter().cloned());
        for StreamedColumn { column, survey, .. } in self.columns.iter().filter(|of| of.quantizer.is_none()) {
            let what = if survey.is_zero() {
                "is never filled: it is zero in every row, as its other axes are"
            } else {
                "has no usable value"
            };
            notes.push(format!("{} ({}) {what}, and is left out", column.profile.name, column.label));
        }
        notes.extend(self.missing_notes());
        let rounded = self.columns.iter().filter_map(|of| Some((&of.column.profile, of.quantizer.as_ref()?)));
        notes.extend(rounding_note(rounded));
        notes.extend(self.stamps.iter().flat_map(StampQuality::notes));
        notes.extend(self.clock.note().map(str::to_owned));
        notes
    }

    /// Sentences on numbers that are no measurement; channels that have as many share one.
    fn missing_notes(&self) -> Vec<String> {
        let mut channels: BTreeMap<(&str, u64, usize), Vec<&str>> = BTreeMap::new();
        for StreamedColumn { column, survey, .. } in self.columns.iter().filter(|of| of.quantizer.is_some()) {
            for (cause, count) in &survey.refused {
                let what = match *cause {
                    "missing" => "missing",
                    "not_finite" => "infinite",
                    "out_of_range" => "outside of any range",
                    // The reports count the faults of a register.
                    _ => continue,
                };
                channels.entry((what, *count, survey.rows())).or_default().push(column.profile.name);
            }
        }
        let note = |((what, count, rows), names): ((&str, u64, usize), Vec<&str>)| {
            let are = if count == 1 { "is" } else { "are" };
            format!("{count} of {rows} values of {} {are} {what}", names.join(", "))
        };
        channels.into_iter().map(note).collect()
    }

    /// Gives the columns that are set in `off_step` other counts, and unsets them.
    fn leave_step(&mut self, off_step: &mut [bool]) {
        for (of, off_step) in self.columns.iter_mut().zip(off_step) {
            if std::mem::take(off_step) {
                of.quantizer = Some(of.survey.quantizer_without_step());
            }
        }
    }

    /// The usable samples of rows that are placed.
    fn block(&self, rows: &Batch, off_step: &mut [bool]) -> SampleBlock {
        let channels = self.columns.iter().zip(&rows.values).zip(off_step);
        let channels = channels.filter_map(|((of, values), off_step)| of.channel(values, &rows.verdicts, off_step));
        SampleBlock { channels: channels.collect(), slots: rows.indices.clone() }
    }

    /// The samples of the rows that are kept, before the sample period `before`.
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
        let end = self.has_all_rows.then_some(None);
        for batch in self.kept.iter().cloned().map(Some).chain(end) {
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

/// The columns of vectors that are zero in every row, beside others that are not: messages have fields that a program never fills.
fn never_filled(columns: &[ValueColumn], surveys: &[ColumnSurvey]) -> Vec<usize> {
    let of_group = |group: &[&str; 3]| -> Vec<usize> {
        let is_own = |at: &usize| group.contains(&columns[*at].profile.name) && columns[*at].register.is_none();
        let own: Vec<usize> = (0..columns.len()).filter(is_own).collect();
        if own.len() == group.len() && own.iter().all(|at| surveys[*at].is_zero()) { own } else { Vec::new() }
    };
    let unfilled: Vec<usize> = [GYROSCOPE, ACCELEROMETER, MAGNETOMETER].iter().flat_map(of_group).collect();
    if unfilled.len() < columns.len() { unfilled } else { Vec::new() }
}

/// Adds the samples of a block at `times_s`.
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
    /// Its profile with the size of its counts; `None` where no number can be used.
    fn profile(&self) -> Option<ChannelProfile> {
        let lsb = self.quantizer.as_ref()?.lsb * self.column.factor;
        Some(ChannelProfile { lsb, ..self.column.profile })
    }

    /// Its numbers as counts; `off_step` is set where one is no multiple of the step of the others.
    fn channel(&self, values: &[f64], verdicts: &[Verdict], off_step: &mut bool) -> Option<MeasuredChannel> {
        let (quantizer, profile) = (self.quantizer.as_ref()?, self.profile()?);
        if self.column.register.is_some() && verdicts.iter().all(|verdict| verdict.refused.is_empty()) {
            // All words of the register are counts, but for those that are missing.
            if !values.iter().any(|value| value.is_nan()) {
                return Some(MeasuredChannel::new(profile, values.iter().map(|value| *value as i32).collect()));
            }
        }
        let mut counts = Vec::with_capacity(values.len());
        let mut refused: BTreeMap<&'static str, Vec<usize>> = BTreeMap::new();
        for (position, &value) in values.iter().enumerate() {
            let count = match refusal(&self.column, value, verdicts.get(position)) {
                // The word of a register that is refused stays as it was read.
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

/// Rows that are kept from the first reading.
struct Kept {
    limit: KeptInMemory,
    batches: VecDeque<Batch>,
    rows: u64,
    has_all_rows: bool,
    /// True if they are dropped as soon as more are expected than can be kept.
    is_by_expectation: bool,
}

impl Kept {
    fn new(limit: KeptInMemory) -> Self {
        Self { limit, batches: VecDeque::new(), rows: 0, has_all_rows: true, is_by_expectation: false }
    }

    /// Keeps a batch; true if from now on not all rows are kept. `expected` tells by a number of rows how many there are in all.
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
    /// The usable samples.
    pub measurement: Measurement,
    /// Quality of the time stamps; `None` where the samples have none.
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
    let (origin, monitor) = (Origin::Recording(Cow::Borrowed(recording)), ReadMonitor::default());
    let reading = Reading::new(rate_hz, KeptInMemory::ALL);
    let mut survey = Survey::read(&origin, reading, u64::MAX, &monitor).map_err(without_file)?;
    let samples = survey.samples(reading.kept).map_err(without_file)?;
    Ok(EstimatedTimeBase { measurement: samples.beginning, stamps: survey.stamps })
}

/// The samples of a recording in a part of its time.
///
/// # Errors
/// There is neither a time nor a rate, or no sample in the part.
pub fn part_of(mut recording: Recording, part: TimeRange, stated_hz: Option<f64>) -> Result<Recording, TimeBaseError> {
    let is_inside = RecordedRows::new(&recording).inside(part, stated_hz)?;
    let mut is_inside = is_inside.into_iter();
    recording.samples.retain(|_| is_inside.next().unwrap_or(false));
    Ok(recording)
}
