//! A recording that is read in blocks, in memory that does not grow with its length.
//!
//! Tables of register counts, tables in any units and arrays of NumPy are read twice: once for the sample rate, the length, and the
//! size of a count, and once for the samples. Their first rows are read before that, as many as the caller says, to tell the clock of
//! the time stamps; a recording that has no more rows, or another format, is held in memory and is the same as that of the other
//! readers. The samples of a table of counts that has not many more are kept from the first of the two readings for the second one. What a simulation or a log of the bus recorded is in memory already: it is read once, and released as it is read.

use crate::counts::recording::Recording;
use crate::formats::file_format::{FileFormat, InputFile};
use crate::input::input_error::{InputError, Reason};
use crate::input::read_ahead::for_each_ahead;
use crate::input::read_monitor::{ReadMonitor, ReadPass};
use crate::streams::count_stream::{self, CountStream};
use crate::streams::recorded_blocks::RecordedBlocks;
use crate::streams::value_stream::{self, ColumnSample, PlacedRows, ValueColumn, ValueHead, ValueStream};
use crate::tables::any_sensor::{ReadOptions, SensorRecording};
use crate::tables::quantizer::Quantizer;
use crate::tables::sensor_measurement::rounding_note;
use crate::tables::sensor_table::SensorTable;
use crate::time_base::sample_slots::SampleSlots;
use crate::time_base::stamp_quality::StampQuality;
use crate::time_base::stream_clock::{BLOCK, StreamClock};
use crate::time_base::time_base_error::TimeBaseError;
use crate::time_base::{UsableSamples, time_base};
use adis16405_driver::GyroRange;
use measurement::{ChannelProfile, Measurement, RecordingDescription, SampleBlock, lost_part};

pub use crate::time_base::time_base_error::StreamError;

/// Sample periods at the start of a recording that are kept of one that is not held in memory.
const BEGINNING: u64 = 1 << 16;

/// Which recordings become one measurement in memory, instead of being read in blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeptInMemory {
    /// Those of at most so many rows.
    pub rows: u64,
    /// Those of at most so many rows where a larger part than `most_lost` of the first samples never arrived.
    pub rows_with_losses: u64,
    /// Part of the samples.
    pub most_lost: f64,
    /// Those whose time stamps are too irregular to be understood without all of them. Where they are not kept, they are an error.
    pub irregular: bool,
}

impl KeptInMemory {
    /// Whether a larger part is missing of `samples` in so many sample periods.
    fn has_losses(self, samples: u64, periods: u64) -> bool {
        lost_part(samples, periods) > self.most_lost
    }

    /// Whether so many samples in so many sample periods are kept.
    fn has_room(self, samples: u64, periods: u64) -> bool {
        samples <= if self.has_losses(samples, periods) { self.rows_with_losses } else { self.rows }
    }

    /// Whether a recording that has more rows is kept because of its time stamps.
    fn has_to_be_kept(self, has_index: bool, stamps: Option<&StampQuality>) -> bool {
        self.irregular && matches!(StreamClock::new(has_index, stamps), Err(TimeBaseError::Irregular(_)))
    }
}

/// An open recording.
pub struct SampleStream {
    content: Content,
    /// The samples at the start, or all of a recording that is held in memory.
    beginning: Measurement,
    description: RecordingDescription,
    notes: Vec<String>,
    monitor: ReadMonitor,
}

enum Content {
    Held,
    Recorded(Box<RecordedBlocks>),
    Counts(Box<Counts>),
    Values(Box<Values>),
}

/// A table of register counts.
struct Counts {
    source: Source<GyroRange>,
    /// Rows of the longest table whose samples are kept when it is surveyed.
    most_kept: u64,
    /// The samples of all of it, until they are used.
    kept: Vec<SampleBlock>,
}

/// Numbers in any units.
struct Values {
    source: Source<ReadOptions>,
    time_unit_s: f64,
    columns: Vec<StreamedColumn>,
    /// What the user should know of rows that are left out, and of their times.
    notes: Vec<String>,
}

/// A file that is read more than once.
struct Source<O> {
    input: InputFile,
    options: O,
    stated_hz: Option<f64>,
    /// What the time stamps of the first rows show, and whether there is an index.
    head: Option<StampQuality>,
    has_index: bool,
    /// Rows to read at most: those that were read when the reading was stopped.
    most: u64,
}

impl<O> Source<O> {
    fn clock(&self) -> Result<StreamClock, TimeBaseError> {
        StreamClock::new(self.has_index, self.head.as_ref())
    }

    /// The period by which a row that was read twice is known, s.
    fn period_s(&self) -> Option<f64> {
        let by_stamps = self.head.as_ref().and_then(|head| head.rate).map(|rate| rate.hz);
        self.stated_hz.or(by_stamps).filter(|_| self.head.is_some()).map(f64::recip)
    }
}

/// A column whose numbers become counts.
struct StreamedColumn {
    column: ValueColumn,
    sample: ColumnSample,
    /// `None` where no number can be used.
    quantizer: Option<Quantizer>,
}

impl SampleStream {
    /// A recording that is in memory.
    #[must_use]
    pub fn held(measurement: Measurement, monitor: &ReadMonitor) -> Self {
        Self {
            description: RecordingDescription::from(&measurement),
            content: Content::Held,
            beginning: measurement,
            notes: Vec::new(),
            monitor: monitor.clone(),
        }
    }

    /// The rows of any sensor, which become one measurement in memory; `stated_hz` overrides the rate that their time stamps show.
    ///
    /// # Errors
    /// They have no time base.
    pub fn sensor_recording(
        recording: SensorRecording,
        stated_hz: Option<f64>,
        monitor: &ReadMonitor,
    ) -> Result<Self, TimeBaseError> {
        let (base, mut notes) = recording.time_base(stated_hz)?;
        notes.extend(base.stamps.iter().flat_map(StampQuality::notes));
        Ok(Self { notes, ..Self::held(base.measurement, monitor) })
    }

    /// What a simulation or a log of the bus recorded; `stated_hz` overrides the rate that its time stamps show.
    ///
    /// # Errors
    /// It has no time base.
    pub fn recorded(recording: Recording, stated_hz: Option<f64>, kept: KeptInMemory) -> Result<Self, TimeBaseError> {
        let usable = UsableSamples::place(&recording, stated_hz)?;
        let monitor = ReadMonitor::default();
        let notes = usable.stamps.iter().flat_map(StampQuality::notes).collect();
        let description = usable.description(&recording);
        if kept.has_room(description.samples, description.periods) {
            return Ok(Self { notes, ..Self::held(usable.into_measurement(&recording), &monitor) });
        }
        let beginning = usable.before(BEGINNING, &recording);
        let content = Content::Recorded(Box::new(RecordedBlocks::new(recording, usable)));
        Ok(Self { content, beginning, description, notes, monitor })
    }

    /// Opens a table of register counts whose rates were taken in `range`.
    ///
    /// # Errors
    /// The file is damaged, or has no time base: see [`TimeBaseError`].
    pub fn counts(
        input: InputFile,
        range: GyroRange,
        stated_hz: Option<f64>,
        kept: KeptInMemory,
    ) -> Result<Self, StreamError> {
        let rename = |error: InputError| StreamError::Input(input.rename(error));
        let monitor = &input.monitor().clone();
        let head = |most: u64| count_stream::head(input.path(), range, monitor, most).map_err(rename);
        let (mut recording, mut is_all) = head(kept.rows)?;
        let first = recording.samples.first().map(|sample| sample.time_stamp).unwrap_or_default();
        let mut base = time_base(&recording, stated_hz)?;
        if !is_all && kept.has_losses(base.measurement.len() as u64, base.measurement.periods()) {
            (recording, is_all) = head(kept.rows_with_losses)?;
            base = time_base(&recording, stated_hz)?;
        }
        if !is_all && kept.has_to_be_kept(first.index.is_some(), base.stamps.as_ref()) {
            (recording, is_all) = head(u64::MAX)?;
            base = time_base(&recording, stated_hz)?;
        }
        if is_all {
            let notes = base.stamps.iter().flat_map(StampQuality::notes).collect();
            return Ok(Self { notes, ..Self::held(base.measurement, monitor) });
        }
        let source = Source {
            input,
            options: range,
            stated_hz,
            head: base.stamps,
            has_index: first.index.is_some(),
            most: u64::MAX,
        };
        let mut description = RecordingDescription::from(&base.measurement);
        let beginning = base.measurement.before(BEGINNING);
        drop((recording, base.measurement));
        let content = Content::Counts(Box::new(Counts { source, most_kept: kept.rows_with_losses, kept: Vec::new() }));
        description.samples = 0;
        let mut stream = Self { content, beginning, description, notes: Vec::new(), monitor: monitor.clone() };
        stream.survey()?;
        Ok(stream)
    }

    /// Opens a recording of any sensor; one that is neither a table nor an array is kept in memory.
    ///
    /// # Errors
    /// As [`counts`](Self::counts), and where the columns cannot be chosen.
    pub fn any_sensor(
        input: InputFile,
        options: ReadOptions,
        stated_hz: Option<f64>,
        kept: KeptInMemory,
    ) -> Result<Self, StreamError> {
        let monitor = &input.monitor().clone();
        let is_streamed = matches!(input.format(), FileFormat::CountTable | FileFormat::TextTable | FileFormat::Npy);
        if !is_streamed {
            return Ok(Self::sensor_recording(input.read(&options)?, stated_hz, monitor)?);
        }
        let head = |most: u64| {
            let head = value_stream::head(input.path(), input.format(), &options, monitor, most);
            head.map_err(|error| input.rename(error))
        };
        let slots_of = |table: &SensorTable| {
            let rows = table.columns.first().map_or(0, |column| column.values.len());
            let stated_hz = stated_hz.or(table.rate_hz);
            SampleSlots::new(rows, table.times_s.as_deref(), table.indices.as_deref(), stated_hz)
        };
        let ValueHead { mut table, time_unit_s, mut is_all } = head(kept.rows)?;
        let periods = |table: &SensorTable| slots_of(table).map(|of| of.slots.last().map_or(0, |last| last + 1));
        let rows = |table: &SensorTable| table.columns.first().map_or(0, |column| column.values.len() as u64);
        if !is_all && kept.has_losses(rows(&table), periods(&table)?) {
            ValueHead { table, is_all, .. } = head(kept.rows_with_losses)?;
        }
        if !is_all && kept.has_to_be_kept(table.indices.is_some(), slots_of(&table)?.stamps.as_ref()) {
            ValueHead { table, is_all, .. } = head(u64::MAX)?;
        }
        if is_all {
            return Ok(Self::sensor_recording(SensorRecording::new(table, &options.sensor), stated_hz, monitor)?);
        }
        let slots = slots_of(&table)?;
        let stated_hz = stated_hz.or(table.rate_hz);
        let description = RecordingDescription {
            profile: options.sensor.clone(),
            sample_rate_hz: slots.sample_rate_hz,
            samples: 0,
            periods: 0,
            channels: Vec::new(),
            dropped: Default::default(),
            flagged: Default::default(),
        };
        let source = Source {
            input,
            options,
            stated_hz,
            head: slots.stamps,
            has_index: table.indices.is_some(),
            most: u64::MAX,
        };
        let (base, _) = SensorRecording::new(table, &source.options.sensor).time_base(stated_hz)?;
        let beginning = base.measurement.before(BEGINNING);
        drop(base);
        let values = Values { source, time_unit_s, columns: Vec::new(), notes: Vec::new() };
        let content = Content::Values(Box::new(values));
        let mut stream = Self { content, beginning, description, notes: Vec::new(), monitor: monitor.clone() };
        stream.survey()?;
        Ok(stream)
    }

    /// The samples at the start of the recording with their time stamps: all of one that is held in memory, else those of the first 2¹⁶
    /// sample periods, of which the size of a count may be that of these samples alone.
    #[must_use]
    pub fn beginning(&self) -> &Measurement {
        &self.beginning
    }

    /// The same, of a recording that is not read any more.
    #[must_use]
    pub fn into_beginning(self) -> Measurement {
        self.beginning
    }

    /// What is known of the recording before its samples are used.
    #[must_use]
    pub fn description(&self) -> &RecordingDescription {
        &self.description
    }

    /// What the user should know, one sentence each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Whether the recording is one measurement in memory: its [beginning](Self::beginning) is all of it.
    #[must_use]
    pub fn is_in_memory(&self) -> bool {
        matches!(self.content, Content::Held)
    }

    /// Reads the recording once and calls `take` with each block of its samples. [Recorded](Self::recorded) samples that do not become
    /// one measurement are released then, and cannot be read again.
    ///
    /// False if what the [description](Self::description) says has changed on the way, so that it has to be read again: a number
    /// is no multiple of the step of the others, or the reading was stopped. That happens a bounded number of times.
    ///
    /// # Errors
    /// The file is damaged.
    pub fn read(&mut self, take: impl FnMut(SampleBlock)) -> Result<bool, StreamError> {
        self.read_pass(take).map_err(|error| self.renamed(error))
    }

    fn read_pass(&mut self, mut take: impl FnMut(SampleBlock)) -> Result<bool, StreamError> {
        self.monitor.begin_pass(ReadPass::Samples);
        let stopped_at = match &mut self.content {
            Content::Held => {
                self.beginning.blocks(BLOCK).for_each(take);
                None
            }
            Content::Recorded(blocks) => {
                blocks.for_each(take);
                None
            }
            Content::Counts(counts) if !counts.kept.is_empty() => {
                std::mem::take(&mut counts.kept).into_iter().for_each(take);
                None
            }
            Content::Counts(counts) => {
                let mut pass = open_counts(&counts.source, &self.monitor)?;
                let take_block = |block| {
                    take(block);
                    Ok(())
                };
                for_each_ahead(|| pass.next(&self.description.profile), take_block)?;
                pass.is_stopped().then(|| pass.rows())
            }
            Content::Values(values) => {
                let Values { source, time_unit_s, columns, .. } = values.as_mut();
                let mut pass = open_values(source, *time_unit_s, &self.monitor)?;
                let known: Vec<ValueColumn> = columns.iter().map(|of| of.column.clone()).collect();
                let quantizers: Vec<Option<Quantizer>> = columns.iter().map(|of| of.quantizer).collect();
                let mut off_step = vec![false; columns.len()];
                let take_rows = |rows: PlacedRows| {
                    take(rows.into_block(&known, &quantizers, &mut off_step));
                    Ok(())
                };
                for_each_ahead(|| pass.next(), take_rows)?;
                let stopped_at = pass.is_stopped().then(|| pass.rows());
                if stopped_at.is_none() && off_step.contains(&true) {
                    for (of, _) in columns.iter_mut().zip(&off_step).filter(|(_, off_step)| **off_step) {
                        of.quantizer = Some(Quantizer::without_step(&of.sample.values()));
                    }
                    self.describe_columns();
                    return Ok(false);
                }
                stopped_at
            }
        };
        let Some(rows) = stopped_at else { return Ok(true) };
        match &mut self.content {
            Content::Held | Content::Recorded(_) => {}
            Content::Counts(counts) => counts.source.most = rows,
            Content::Values(values) => values.source.most = rows,
        }
        self.survey()?;
        Ok(false)
    }

    /// An error of the file under the name by which the user knows it.
    fn renamed(&self, error: StreamError) -> StreamError {
        match (&self.content, error) {
            (Content::Counts(counts), StreamError::Input(error)) => counts.source.input.rename(error).into(),
            (Content::Values(values), StreamError::Input(error)) => values.source.input.rename(error).into(),
            (_, error) => error,
        }
    }

    /// Reads the recording once for its rate, its length and the size of its counts.
    fn survey(&mut self) -> Result<(), StreamError> {
        self.survey_pass().map_err(|error| self.renamed(error))
    }

    fn survey_pass(&mut self) -> Result<(), StreamError> {
        let Self { content, description, notes, monitor, .. } = self;
        monitor.begin_pass(ReadPass::Survey);
        match content {
            Content::Held | Content::Recorded(_) => {}
            Content::Counts(counts) => {
                let Counts { source, most_kept, kept } = counts.as_mut();
                let mut pass = open_counts(source, monitor)?;
                *kept = pass.survey(*most_kept, &description.profile)?;
                if pass.is_stopped() {
                    source.most = pass.rows();
                }
                let placer = pass.placer;
                description.samples = placer.samples;
                description.periods = placer.periods();
                description.dropped = placer.dropped.clone();
                placer.clock().check(description.samples, description.periods, &description.dropped)?;
                description.dropped.insert("gap", placer.never_arrived);
                description.flagged = placer.flagged.clone();
                description.flagged.extend(placer.clock().warnings());
                description.sample_rate_hz =
                    source.stated_hz.or(placer.clock().rate_hz()).ok_or(TimeBaseError::NoRate)?;
                *notes = placer.clock().note().into_iter().collect();
            }
            Content::Values(values) => {
                let Values { source, time_unit_s, columns, notes } = values.as_mut();
                let mut pass = open_values(source, *time_unit_s, monitor)?;
                let mut samples: Vec<ColumnSample> = pass.columns.iter().map(|_| ColumnSample::new()).collect();
                while let Some(rows) = pass.next()? {
                    samples.iter_mut().zip(&rows.values).for_each(|(sample, values)| sample.extend(values));
                }
                if pass.is_stopped() {
                    source.most = pass.rows();
                }
                let backwards =
                    pass.backwards().map_err(|reason: Reason| InputError::file(source.input.path(), reason))?;
                let left_out = backwards.as_ref().map_or(0, |(rows, _)| *rows);
                description.samples = pass.samples;
                description.periods = pass.periods();
                let dropped = [("time_backwards", left_out), ("repeated", pass.repeated)];
                description.dropped = dropped.into_iter().filter(|(_, count)| *count > 0).collect();
                pass.clock().check(description.samples, description.periods, &description.dropped)?;
                description.dropped.insert("gap", pass.never_arrived.saturating_sub(left_out));
                description.flagged = pass.clock().warnings().collect();
                description.sample_rate_hz =
                    source.stated_hz.or(pass.clock().rate_hz()).ok_or(TimeBaseError::NoRate)?;
                let streamed = |(column, sample): (&ValueColumn, ColumnSample)| StreamedColumn {
                    column: column.clone(),
                    quantizer: sample.is_usable.then(|| Quantizer::new(&sample.values())),
                    sample,
                };
                *columns = pass.columns.iter().zip(samples).map(streamed).collect();
                *notes = backwards.map(|(_, note)| note).into_iter().chain(pass.clock().note()).collect();
                self.describe_columns();
            }
        }
        if self.description.channels.is_empty() {
            let dropped = self.description.dropped.clone();
            return Err(TimeBaseError::TooShort { used: 0, dropped }.into());
        }
        Ok(())
    }

    /// The channels with the size of their counts, and what the user should know of it.
    fn describe_columns(&mut self) {
        let Content::Values(values) = &self.content else { return };
        let Values { columns, notes, .. } = values.as_ref();
        self.description.channels.clear();
        self.notes.clone_from(notes);
        for StreamedColumn { column: ValueColumn { profile, factor, label }, quantizer, .. } in columns {
            match quantizer {
                Some(quantizer) => {
                    let lsb = quantizer.lsb * factor;
                    self.description.channels.push(ChannelProfile { lsb, ..*profile });
                }
                None => self.notes.push(format!("{} ({label}) has no usable value and is left out", profile.name)),
            }
        }
        let rounded = columns.iter().filter_map(|of| Some((&of.column.profile, of.quantizer.as_ref()?)));
        self.notes.extend(rounding_note(rounded));
    }
}

fn open_counts(source: &Source<GyroRange>, monitor: &ReadMonitor) -> Result<CountStream, StreamError> {
    let clock = source.clock()?;
    Ok(CountStream::open(source.input.path(), source.options, monitor, clock, source.period_s(), source.most)?)
}

fn open_values(
    source: &Source<ReadOptions>,
    time_unit_s: f64,
    monitor: &ReadMonitor,
) -> Result<ValueStream, StreamError> {
    let clock = (source.clock()?, source.period_s());
    let file = (source.input.path(), source.input.format());
    Ok(ValueStream::open(file, &source.options, monitor, clock, time_unit_s, source.most)?)
}
