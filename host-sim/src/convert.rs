//! `convert`: a recording in another format.

use crate::analyze::{Recorded, read};
use crate::cli::{ConvertArguments, RecordingFormat};
use crate::output::{check_file, note};
use crate::recording_file;
use anyhow::{Context, Result, bail};
use recordings::any_sensor::SensorRecording;
use std::path::Path;

/// Reads a recording of any format and writes it anew.
pub(crate) fn run(arguments: &ConvertArguments) -> Result<()> {
    let ConvertArguments { input, out, to } = arguments;
    check_file(out, &[&input.file]).with_context(|| out.display().to_string())?;
    let format = recording_file::format_of(out, *to);
    match read(input)? {
        Recorded::Counts(recording) => recording_file::write(&recording, out, format),
        Recorded::AnySensor(recording) => {
            recording.notes().iter().for_each(|sentence| note(format_args!("{sentence}")));
            write(&recording, out, format).with_context(|| out.display().to_string())
        }
    }
}

fn write(recording: &SensorRecording, out: &Path, format: RecordingFormat) -> Result<()> {
    match format {
        RecordingFormat::Table => Ok(recording.write_table(out)?),
        RecordingFormat::Npy => {
            recording_file::note_columns(out, &recording.write_array(out)?);
            Ok(())
        }
        RecordingFormat::Frames => {
            bail!("an SPI frame log has the register counts of an ADIS16405, which the recording has not")
        }
    }
}
