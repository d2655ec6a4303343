//! `analyze` and `replay`: the report of a recording in a file.

use crate::cli::RecordingArguments;
use crate::output::note;
use anyhow::{Context, Result};
use noise_analysis::report::Report;
use recordings::count_table;
use recordings::recording::Recording;
use recordings::time_base::{StampQuality, time_base};

/// Analyses a table of register counts.
pub(crate) fn analyze_table(arguments: &RecordingArguments) -> Result<Report> {
    let recording = count_table::read(&arguments.file, arguments.range.into())?;
    analyze_file(&recording, arguments)
}

/// Analyses what the driver reads of a table or a frame log over the emulated bus.
pub(crate) fn analyze_replay(arguments: &RecordingArguments) -> Result<Report> {
    let replayed = simulation::replay(&arguments.file, arguments.range.into())?;
    if replayed.other_transactions > 0 {
        note(format_args!("{} transactions that are no bursts", replayed.other_transactions));
    }
    analyze_file(&replayed.recording, arguments)
}

/// Analyses a recording; `rate_hz` overrides the rate that its time stamps show.
pub(crate) fn analyze_recording(recording: &Recording, rate_hz: Option<f64>) -> Result<Report> {
    let base = time_base(recording, rate_hz)?;
    for sentence in base.stamps.iter().flat_map(StampQuality::notes) {
        note(format_args!("{sentence}"));
    }
    Ok(noise_analysis::analysis::analyze(&base.measurement))
}

fn analyze_file(recording: &Recording, arguments: &RecordingArguments) -> Result<Report> {
    analyze_recording(recording, arguments.rate).with_context(|| arguments.file.display().to_string())
}
