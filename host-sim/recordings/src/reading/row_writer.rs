//! Rows of any sensor as a table with units, and as a NumPy array, batch by batch.

use crate::batch_source::for_each_batch;
use crate::counts::count_table_writer::write_text;
use crate::counts::numpy_matrix::{MatrixWriter, SiUnit};
use crate::file_format::{ReadOptions, RecordedInput};
use readers::ReadingNote;
use readers::{Batch, RowsRead, StreamError, ValueColumn, WantedRows};
use std::fmt::Write as _;
use std::io;
use std::path::Path;
use time_base::TimeRange;

/// The rows of a file that are written.
#[derive(Debug)]
pub struct SensorRows<'a> {
    pub input: &'a RecordedInput,
    pub options: ReadOptions,
    pub part: Option<TimeRange>,
    /// Places the part if there are no times, Hz.
    pub stated_hz: Option<f64>,
}

/// Why rows are not written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    #[error(transparent)]
    Read(#[from] StreamError),
    #[error(transparent)]
    Write(#[from] io::Error),
}

/// Result of a writing.
#[derive(Debug, Clone, PartialEq)]
pub struct WrittenRows {
    pub columns: Vec<String>,
    /// Remarks for the user, one sentence each.
    pub notes: Vec<ReadingNote>,
    pub is_complete: bool,
}

impl SensorRows<'_> {
    /// Writes CSV, gzip for a name in `.gz`: `sample` and `time_s`, if recorded, then channels as `gyro_x [deg/s]`;
    /// times from the first sample, `NaN` if missing.
    ///
    /// # Errors
    /// The rows cannot be read, or the file not written.
    pub fn write_table(&self, file: &Path) -> Result<WrittenRows, WriteError> {
        write_text(file, |out| {
            let mut text = String::new();
            self.for_each_batch(|columns, batch, names| {
                if names.is_empty() {
                    let stamps = [("sample", !batch.indices.is_empty()), ("time_s", !batch.times.is_empty())];
                    names.extend(stamps.into_iter().filter(|(_, has)| *has).map(|(name, _)| name.to_owned()));
                    names.extend(columns.iter().map(|of| format!("{} [{}]", of.channel.name, of.channel.unit)));
                    writeln!(out, "{}", names.join(","))?;
                }
                text.clear();
                for row in 0..batch.rows {
                    let start = text.len();
                    if let Some(index) = batch.indices.get(row) {
                        let _ = write!(text, ",{index}");
                    }
                    if let Some(time) = batch.times.get(row) {
                        let _ = write!(text, ",{time}");
                    }
                    for (column, values) in columns.iter().zip(&batch.values) {
                        let _ = write!(text, ",{}", values[row] * column.factor);
                    }
                    text.remove(start);
                    text.push('\n');
                }
                out.write_all(text.as_bytes())
            })
        })
    }

    /// Writes a NumPy array of doubles: time in s, if any, rad/s, m/s², others in the analysis' unit.
    ///
    /// # Errors
    /// The rows cannot be read, or the file not written.
    pub fn write_array(&self, file: &Path) -> Result<WrittenRows, WriteError> {
        let mut matrix = MatrixWriter::create(file)?;
        let written = self.for_each_batch(|columns, batch, names| {
            let units: Vec<SiUnit> = columns.iter().map(|column| SiUnit::of(column.channel.unit)).collect();
            if names.is_empty() {
                names.extend(Some("time_s".to_owned()).filter(|_| !batch.times.is_empty()));
                let channels = columns.iter().zip(&units);
                names.extend(channels.map(|(column, unit)| format!("{}_{}", column.channel.name, unit.suffix)));
            }
            for row in 0..batch.rows {
                let time = batch.times.get(row).copied();
                let channels = columns.iter().zip(&batch.values).zip(&units);
                let channels = channels.map(|((column, values), unit)| values[row] * column.factor * unit.factor);
                matrix.write_row(time.into_iter().chain(channels))?;
            }
            Ok(())
        })?;
        matrix.finish(written.columns.len())?;
        Ok(written)
    }

    /// Calls `write` with columns, batch, and names.
    fn for_each_batch(
        &self,
        mut write: impl FnMut(&[ValueColumn], &Batch, &mut Vec<String>) -> io::Result<()>,
    ) -> Result<WrittenRows, WriteError> {
        let mut source = self.input.rows(&self.options, false).map_err(StreamError::from)?;
        let columns = source.columns().to_vec();
        let (mut names, mut failure) = (Vec::new(), None);
        let wanted = WantedRows { part: self.part, ..WantedRows::all(self.stated_hz) };
        let mut first_s = None;
        let read = for_each_batch(
            |give| source.read(wanted, give),
            |mut batch: Batch| {
                if let Some(&first) = batch.times.first() {
                    let first_s = *first_s.get_or_insert(first);
                    batch.times.iter_mut().for_each(|time| *time -= first_s);
                }
                if failure.is_none() {
                    failure = write(&columns, &batch, &mut names).err();
                }
                Ok(())
            },
        );
        if let Some(failure) = failure {
            return Err(failure.into());
        }
        let read = read?;
        let is_complete = read.is_complete();
        let RowsRead { damage, notes, .. } = read;
        Ok(WrittenRows {
            columns: names,
            notes: notes.into_iter().chain(damage.map(ReadingNote::from)).collect(),
            is_complete,
        })
    }
}
