//! A recording written in one of the formats of this program.

use crate::cli::RecordingFormat;
use crate::output::note;
use crate::output_files::OutputFiles;
use adis16405_driver::{BURST_REQUEST, Burst, GyroRange, Register};
use anyhow::{Context, Result, bail};
use recordings::frame_log::{Frame, FrameLogWriter};
use recordings::recording::{RecordedSample, Recording};
use recordings::{count_table_writer, numpy_matrix};
use std::path::Path;

/// Endings of formats that are known but not written.
const NOT_WRITTEN: [&str; 18] = [
    "arrow", "bag", "bin", "db3", "feather", "h5", "hdf5", "json", "mat", "mcap", "npz", "parquet", "pkl", "rda",
    "tdms", "ulg", "xls", "xlsx",
];

/// The format of `out`, by its name if none is `named`: `.npy` is a NumPy array, and every ending that is not of another format a table.
///
/// # Errors
/// The ending is of a format that is not written.
pub(crate) fn format_of(out: &Path, named: Option<RecordingFormat>) -> Result<RecordingFormat> {
    let ending = out.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    match named {
        Some(named) => Ok(named),
        None if ending == "npy" => Ok(RecordingFormat::Npy),
        None if NOT_WRITTEN.contains(&ending.as_str()) => {
            bail!("{}: .{ending} is not written; name a .csv, .csv.gz or .npy file, or say --format", out.display())
        }
        None => Ok(RecordingFormat::Table),
    }
}

/// Writes `recording` to `out`.
pub(crate) fn write(recording: &Recording, out: &Path, format: RecordingFormat, files: &OutputFiles) -> Result<()> {
    match format {
        RecordingFormat::Table => files.write_with(out, |out| Ok(count_table_writer::write(recording, out)?))?,
        RecordingFormat::Frames => files.write_with(out, |out| write_frames(recording, out))?,
        RecordingFormat::Npy => {
            note_columns(out, &files.write_with(out, |out| Ok(numpy_matrix::write(recording, out)?))?);
        }
    }
    if format == RecordingFormat::Table && recording.range != GyroRange::Dps300 {
        note(format_args!("the table does not say the range: read it with --range {}", full_scale(recording.range)));
    }
    Ok(())
}

/// Prints the names of the columns of an array, whose file does not have them.
pub(crate) fn note_columns(out: &Path, names: &[String]) {
    note(format_args!("columns of {}: {}", out.display(), names.join(", ")));
}

/// Writes every sample as the burst that the part would have sent, after the write that selects the gyro range.
fn write_frames(recording: &Recording, out: &Path) -> Result<()> {
    let time = |(row, sample): (usize, &RecordedSample)| {
        sample.time_stamp.time_s.with_context(|| format!("sample {row} has no time, which a frame log needs"))
    };
    let first = recording.samples.iter().enumerate().map(time).next();
    let Some(first_s) = first.transpose()? else { bail!("no samples") };
    let mut log = FrameLogWriter::create(out)?;
    let code = match recording.range {
        GyroRange::Dps300 => 0x0400,
        GyroRange::Dps150 => 0x0200,
        GyroRange::Dps75 => 0x0100,
    };
    let select = Register::SensAvg.write_high_frame(code).to_vec();
    log.write(&Frame { time_s: first_s, miso: vec![0; select.len()], mosi: select })?;
    for entry in recording.samples.iter().enumerate() {
        let miso = Burst::from_counts(&entry.1.counts).to_bytes().to_vec();
        log.write(&Frame { time_s: time(entry)?, mosi: BURST_REQUEST.to_vec(), miso })?;
    }
    Ok(log.finish()?)
}

/// Full scale of the gyroscopes, °/s.
fn full_scale(range: GyroRange) -> u32 {
    match range {
        GyroRange::Dps300 => 300,
        GyroRange::Dps150 => 150,
        GyroRange::Dps75 => 75,
    }
}
