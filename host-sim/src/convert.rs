//! `convert`: a recording in another format.

use crate::analyze::{Recorded, open_rows};
use crate::cli::{ConvertArguments, InputArguments, RecordingArguments, RecordingFormat};
use crate::inspect::read_or_ask;
use crate::output::{Incomplete, Misuse, note};
use crate::output_files::OutputFiles;
use crate::recording_file;
use anyhow::{Error, Result, anyhow, bail};
use observatory::recording_report::named;
use recordings::row_writer::{SensorRows, WriteError, WrittenRows};
use std::path::Path;

/// Reads a recording of any format and writes it anew.
pub(crate) fn run(arguments: &ConvertArguments) -> Result<()> {
    let ConvertArguments { recording, out, format, force } = arguments;
    let InputArguments { file, sensor, .. } = &recording.input;
    if recording.rate.is_some() && recording.time_range().is_none() {
        let words = "--rate says where --from and --to are in a recording without times; leave it out";
        return Err(Misuse(words.to_owned()).into());
    }
    let sensor = sensor.as_deref().map(Path::new);
    let files = OutputFiles::new([file.as_path()].into_iter().chain(sensor), *force);
    files.check(out)?;
    let format = recording_file::format_of(out, *format)?;
    read_or_ask(recording, |recording| convert(recording, out, format, &files))
}

fn convert(arguments: &RecordingArguments, out: &Path, format: RecordingFormat, files: &OutputFiles) -> Result<()> {
    match open_rows(arguments)? {
        Recorded::Counts(recording) => {
            recording_file::write(&recording, out, format, files)?;
            recording.damage.iter().for_each(|sentence| note(format_args!("{sentence}")));
            Incomplete::check(recording.damage.is_none())
        }
        Recorded::AnySensor(input, options) => {
            let (part, stated_hz) = (arguments.time_range(), arguments.rate);
            let written = write(&SensorRows { input: &input, options: *options, part, stated_hz }, out, format, files)?;
            written.notes.iter().for_each(|sentence| note(format_args!("{sentence}")));
            Incomplete::check(written.is_complete)
        }
    }
}

fn write(rows: &SensorRows, out: &Path, format: RecordingFormat, files: &OutputFiles) -> Result<WrittenRows> {
    let mut unread = None;
    // An error of the reader already names the input.
    let mut without_name = |error: WriteError| match error {
        WriteError::Write(error) => Error::from(error),
        WriteError::Read(error) => {
            unread = Some(error);
            anyhow!("not read")
        }
    };
    let written = match format {
        RecordingFormat::Table => files.write_with(out, |out| rows.write_table(out).map_err(&mut without_name)),
        RecordingFormat::Npy => files.write_with(out, |out| rows.write_array(out).map_err(&mut without_name)),
        RecordingFormat::Frames => {
            bail!("an SPI frame log has the register counts of an ADIS16405, which the recording has not")
        }
    };
    if let Some(error) = unread {
        return Err(named(error, rows.input.name()));
    }
    let written = written?;
    if format == RecordingFormat::Npy {
        recording_file::note_columns(out, &written.columns);
    }
    Ok(written)
}
