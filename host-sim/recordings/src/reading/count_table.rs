//! Text tables of ADIS16405 register counts.

use crate::batch_source::{channel, for_each_batch};
use crate::file_format::{self, RecordedInput, options_of_counts};
use crate::recording::{MAX_SAMPLES, NOT_RECORDED, Recorder, Recording, TimeStamp};
use adis16405_driver::{Burst, Channel, Counts, GyroRange};
use readers::{Batch, FileBytes, FileRows, InputError, InputFile, ReadMonitor, Reason, StreamError, WantedRows};
use time_base::TimeRange;

/// Reads a table, plain or gzip, with rates in `range`.
///
/// Columns: `<channel>_counts` in any order, optional `sample` (index) and `time_s`.
///
/// # Errors
/// The file cannot be read, or a row is at fault.
pub fn read(file: impl Into<FileBytes>, range: GyroRange) -> Result<Recording, InputError> {
    let file = &file.into();
    recorded(file, range, |take| for_each_row(file, range, take))
}

/// The recording of the rows that `read` gives; an error without any.
fn recorded<E: From<InputError>>(
    file: &FileBytes,
    range: GyroRange,
    read: impl FnOnce(&mut TakeRow) -> Result<Option<String>, E>,
) -> Result<Recording, E> {
    // Channels are known with the first row.
    let mut recorder: Option<Recorder> = None;
    let damage = read(&mut |channels, row, counts| {
        let recorder = recorder.get_or_insert_with(|| Recorder::new(channels.to_vec(), range));
        recorder.push(row, &Burst::from_counts(&counts));
        Ok(())
    })?;
    let recording = recorder.map(Recorder::finish).ok_or_else(|| file.error(Reason::NoData))?;
    Ok(Recording { damage, ..recording })
}

type TakeRow<'a> = dyn FnMut(&[Channel], TimeStamp, Counts) -> Result<(), Reason> + 'a;

/// Calls `take` with channels and each row: stamp and counts, absent ones as in [`NOT_RECORDED`]; returns the reason of an early end.
///
/// # Errors
/// As [`read`], and what `take` refuses.
pub fn for_each_row(
    file: impl Into<FileBytes>,
    range: GyroRange,
    take: impl FnMut(&[Channel], TimeStamp, Counts) -> Result<(), Reason>,
) -> Result<Option<String>, InputError> {
    let file = &file.into();
    let options = options_of_counts(range);
    let input = InputFile::recognised(file.name(), vec![file.clone()], &ReadMonitor::default())?;
    let rows = file_format::rows(&input, &options, true)?;
    for_each_row_of(rows, WantedRows::all(None), file, take).map_err(|error| match error {
        StreamError::Input(error) => error,
        StreamError::TimeBase(error) => file.error(Reason::other(format!("replay over the bus: {error}"))),
    })
}

/// The part of a table of counts, as [`read`].
///
/// # Errors
/// As [`read`], or there is neither a time nor a rate, or no row in the part.
pub fn read_part(
    input: &RecordedInput,
    range: GyroRange,
    part: Option<TimeRange>,
    stated_hz: Option<f64>,
) -> Result<Recording, StreamError> {
    let source = input.rows(&options_of_counts(range), true)?;
    let wanted = WantedRows { part, ..WantedRows::all(stated_hz) };
    recorded(input.bytes(), range, |take| for_each_row_of(source, wanted, input.bytes(), take))
}

fn for_each_row_of(
    mut source: FileRows,
    wanted: WantedRows,
    file: &FileBytes,
    mut take: impl FnMut(&[Channel], TimeStamp, Counts) -> Result<(), Reason>,
) -> Result<Option<String>, StreamError> {
    let channels: Vec<Channel> = source.columns().iter().filter_map(|column| channel(column.register)).collect();
    let mut rows = 0u64;
    let read = for_each_batch(
        |give| source.read(wanted, give),
        |batch: Batch| {
            for row in 0..batch.rows {
                rows += 1;
                if rows > MAX_SAMPLES {
                    return Err(InputError::row(file.name(), rows, "", Reason::TooManySamples).into());
                }
                let mut counts = NOT_RECORDED;
                for (channel, column) in channels.iter().zip(&batch.values) {
                    if column[row].is_nan() {
                        let reason = Reason::NotInteger(String::new());
                        return Err(InputError::row(file.name(), rows, channel.name(), reason).into());
                    }
                    counts[*channel as usize] = column[row] as i16;
                }
                let stamp = TimeStamp { index: batch.indices.get(row).copied(), time_s: batch.times.get(row).copied() };
                take(&channels, stamp, Counts::new(counts))
                    .map_err(|reason| InputError::row(file.name(), rows, "", reason))?;
            }
            Ok(())
        },
    )?;
    Ok(read.damage)
}
