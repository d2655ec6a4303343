//! `convert`: a recording in another format.

use crate::cli::ConvertArguments;
use crate::output::{check_file, note};
use crate::recording_file;
use anyhow::{Context, Result};
use recordings::count_table;
use recordings::recorded_file::RecordedFile;

/// Reads a table or a frame log and writes it anew.
pub(crate) fn run(arguments: &ConvertArguments) -> Result<()> {
    let ConvertArguments { file, out, to, range } = arguments;
    check_file(out, &[file]).with_context(|| out.display().to_string())?;
    let recording = match RecordedFile::open(file)? {
        RecordedFile::Table(_) => count_table::read(file, (*range).into())?,
        RecordedFile::Frames(_) => {
            let replayed = simulation::replay(file, (*range).into())?;
            if replayed.other_transactions > 0 {
                note(format_args!("{} transactions that are no bursts are left out", replayed.other_transactions));
            }
            replayed.recording
        }
    };
    recording_file::write(&recording, out, recording_file::format_of(out, *to))
}
