//! Batches of a file or of memory, with the verdicts of the burst validator.

use crate::recording::{NOT_RECORDED, RecordedSample, Recorder, Recording, Verdict};
use adis16405_driver::{Burst, Channel, Counts, GyroRange};
use measurement::{ChannelProfile, SensorProfile, adis16405};
use readers::{
    Batch, FileRows, PartFilter, ReadMonitor, RegisterField, RowsRead, StreamError, ValueColumn, WantedRows,
    may_begin_threads,
};
use std::panic::resume_unwind;
use std::sync::mpsc::sync_channel;
use std::thread;
use time_base::{TimeBaseError, TimeRange};

pub(crate) fn field(channel: Channel) -> RegisterField {
    RegisterField { place: channel as usize, limits: channel.limits() }
}

pub(crate) type ProfiledColumn = ValueColumn<ChannelProfile>;

pub(crate) fn channel(register: Option<RegisterField>) -> Option<Channel> {
    register.and_then(|register| Channel::ALL.get(register.place).copied())
}

pub(crate) enum BatchSource<'a> {
    /// Register counts have a validator.
    File(FileRows<'a>, Vec<ProfiledColumn>, Option<Box<Recorder>>),
    Recording(RecordedRows<'a>),
}

impl<'a> BatchSource<'a> {
    /// Any sensor, or an ADIS16405's counts in `range`.
    pub(crate) fn file(rows: FileRows<'a>, sensor: &SensorProfile, range: Option<GyroRange>) -> Self {
        let profiled = |ValueColumn { channel, factor, label, register }: ValueColumn| {
            Some(ProfiledColumn { channel: sensor.channel(channel.name)?, factor, label, register })
        };
        let columns: Vec<ProfiledColumn> = rows.columns().iter().cloned().filter_map(profiled).collect();
        let channels: Option<Vec<Channel>> = columns.iter().map(|column| channel(column.register)).collect();
        let validator = range.zip(channels).map(|(range, channels)| Box::new(Recorder::new(channels, range)));
        Self::File(rows, columns, validator)
    }

    pub(crate) fn columns(&self) -> &[ProfiledColumn] {
        match self {
            Self::File(_, columns, _) => columns,
            Self::Recording(recording) => &recording.columns,
        }
    }

    /// Stated rate, Hz, if there are no time stamps.
    pub(crate) fn rate_hz(&self) -> Option<f64> {
        match self {
            Self::File(rows, ..) => rows.rate_hz(),
            Self::Recording(_) => None,
        }
    }

    pub(crate) fn for_each_batch(
        &mut self,
        wanted: WantedRows,
        mut take: impl FnMut(Batch<Verdict>) -> Result<(), StreamError>,
    ) -> Result<RowsRead, StreamError> {
        let monitor = match self {
            Self::File(rows, ..) => rows.monitor().clone(),
            Self::Recording(_) => ReadMonitor::default(),
        };
        let read = |give: &mut dyn FnMut(Batch<Verdict>) -> bool| match self {
            Self::File(rows, _, validator) => rows.read(wanted, &mut |batch| {
                let verdicts = validator.as_mut().map(|validator| verdicts(validator, &batch));
                give(batch.with_verdicts(verdicts.unwrap_or_default()))
            }),
            Self::Recording(recording) => recording.read(wanted, give),
        };
        for_each_batch(read, |batch| {
            monitor.ask();
            take(batch)
        })
    }
}

/// Calls `take` with each batch of `read`, on another thread if possible; an error of the file, the part or `take`.
pub(crate) fn for_each_batch<B: Send>(
    read: impl FnOnce(&mut dyn FnMut(B) -> bool) -> Result<RowsRead, StreamError> + Send,
    mut take: impl FnMut(B) -> Result<(), StreamError>,
) -> Result<RowsRead, StreamError> {
    if !may_begin_threads() {
        let mut taken = Ok(());
        let read = read(&mut |batch| {
            taken = take(batch);
            taken.is_ok()
        });
        return taken.and(read);
    }
    let (send, batches) = sync_channel::<B>(1);
    thread::scope(|scope| {
        let reader = scope.spawn(move || read(&mut |batch| send.send(batch).is_ok()));
        let taken = batches.into_iter().try_for_each(take);
        let read = reader.join().unwrap_or_else(|panic| resume_unwind(panic));
        taken.and(read)
    })
}

/// Verdicts on register counts within their fields; missing ones count as not recorded.
fn verdicts(validator: &mut Recorder, batch: &Batch) -> Vec<Verdict> {
    let verdict = |row: usize| {
        let mut counts = NOT_RECORDED;
        for (channel, column) in validator.channels().iter().zip(&batch.values) {
            if !column[row].is_nan() {
                counts[*channel as usize] = column[row] as i16;
            }
        }
        validator.judge(&Burst::from_counts(&Counts::new(counts)))
    };
    (0..batch.rows).map(verdict).collect()
}

pub(crate) struct RecordedRows<'a> {
    recording: &'a Recording,
    columns: Vec<ProfiledColumn>,
    has_times: bool,
    has_indices: bool,
}

impl<'a> RecordedRows<'a> {
    pub(crate) fn new(recording: &'a Recording) -> Self {
        let profile = adis16405::profile(recording.range.lsb());
        let column = |&channel: &Channel| {
            let (of, register) = (profile.channels[channel as usize], Some(field(channel)));
            ProfiledColumn { channel: of, factor: of.lsb, label: channel.name().to_owned(), register }
        };
        Self {
            columns: recording.channels.iter().map(column).collect(),
            has_times: recording.samples.iter().all(|sample| sample.time_stamp.time_s.is_some()),
            has_indices: recording.samples.iter().all(|sample| sample.time_stamp.index.is_some()),
            recording,
        }
    }

    /// Positions of the samples in a part.
    pub(crate) fn inside(&self, part: TimeRange, stated_hz: Option<f64>) -> Result<Vec<usize>, TimeBaseError> {
        let wanted = WantedRows { part: Some(part), ..WantedRows::all(stated_hz) };
        let mut filter = PartFilter::new(wanted, None);
        let samples = &self.recording.samples;
        let mut batch = Batch { verdicts: (0..samples.len()).collect(), ..self.stamps(samples) };
        filter.apply(&mut batch)?;
        filter.finish()?;
        Ok(batch.verdicts)
    }

    fn stamps<V>(&self, samples: &[RecordedSample]) -> Batch<V> {
        let times = samples.iter().filter_map(|sample| sample.time_stamp.time_s);
        let indices = samples.iter().filter_map(|sample| sample.time_stamp.index);
        Batch {
            rows: samples.len(),
            times: if self.has_times { times.collect() } else { Vec::new() },
            indices: if self.has_indices { indices.collect() } else { Vec::new() },
            ..Batch::default()
        }
    }

    fn read(&self, wanted: WantedRows, give: &mut dyn FnMut(Batch<Verdict>) -> bool) -> Result<RowsRead, StreamError> {
        let samples = &self.recording.samples;
        let samples = &samples[..samples.len().min(usize::try_from(wanted.most_rows).unwrap_or(usize::MAX))];
        let mut filter = PartFilter::new(wanted, None);
        for part in samples.chunks(wanted.batch_rows) {
            let column = |&channel: &Channel| part.iter().map(|of| f64::from(of.counts.get(channel))).collect();
            let mut batch = Batch {
                values: self.recording.channels.iter().map(column).collect(),
                verdicts: part.iter().map(RecordedSample::verdict).collect(),
                ..self.stamps(part)
            };
            let may_go_on = filter.apply(&mut batch)?;
            if !give(batch) || !may_go_on {
                break;
            }
        }
        filter.finish()?;
        Ok(RowsRead { rows: samples.len() as u64, damage: self.recording.damage.clone(), ..RowsRead::default() })
    }
}
