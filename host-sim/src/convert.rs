//! `convert`: a recording in another format.

use crate::analyze::{Recorded, read};
use crate::cli::{ConvertArguments, InputArguments, RecordingFormat};
use crate::inspect::read_or_ask;
use crate::output::note;
use crate::output_files::OutputFiles;
use crate::recording_file;
use anyhow::{Result, bail};
use recordings::any_sensor::SensorRecording;
use std::path::Path;

/// Reads a recording of any format and writes it anew.
pub(crate) fn run(arguments: &ConvertArguments) -> Result<()> {
    let ConvertArguments { recording, out, format } = arguments;
    let InputArguments { file, sensor, .. } = &recording.input;
    if recording.rate.is_some() && recording.time_range().is_none() {
        bail!("--rate says where --from and --to are in a recording without times; leave it out");
    }
    let sensor = sensor.as_deref().map(Path::new);
    let files = OutputFiles::beside([file.as_path()].into_iter().chain(sensor));
    files.check(out)?;
    let format = recording_file::format_of(out, *format);
    match read_or_ask(recording, read)? {
        Recorded::Counts(recording) => recording_file::write(&recording, out, format, &files),
        Recorded::AnySensor(recording) => {
            recording.notes().iter().for_each(|sentence| note(format_args!("{sentence}")));
            write(&recording, out, format, &files)
        }
    }
}

fn write(recording: &SensorRecording, out: &Path, format: RecordingFormat, files: &OutputFiles) -> Result<()> {
    match format {
        RecordingFormat::Table => files.write_with(out, |out| Ok(recording.write_table(out)?)),
        RecordingFormat::Npy => {
            recording_file::note_columns(out, &files.write_with(out, |out| Ok(recording.write_array(out)?))?);
            Ok(())
        }
        RecordingFormat::Frames => {
            bail!("an SPI frame log has the register counts of an ADIS16405, which the recording has not")
        }
    }
}
