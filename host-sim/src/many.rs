//! `analyze --reports`: one report a recording, as many recordings at a time as there are cores.

use crate::cli::RecordingArguments;
use crate::output::{self, Analysed, Incomplete, note, progress_bar};
use crate::output_files::OutputFiles;
use anyhow::{Context, Result, bail};
use noise_analysis::parallel::{in_parallel, on_one_thread};
use recordings::Printable;
use reports::json::ReportJson;
use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Endings that the name of a report does not keep.
const ENDINGS: [&str; 2] = [".gz", ".csv"];

/// Writes the report of each of `recordings` into `folder`. One that cannot be analysed does not keep the others from it.
///
/// # Errors
/// Two would have one report, the folder cannot be written, or one could not be analysed.
pub(crate) fn write_reports(
    recordings: &[RecordingArguments],
    folder: &Path,
    is_quiet: bool,
    outputs: &OutputFiles,
    analyze: impl Fn(&RecordingArguments) -> Result<Analysed> + Sync,
) -> Result<()> {
    let reports = names(recordings, folder)?;
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    for report in &reports {
        outputs.check(report)?;
    }
    let bar = progress_bar(recordings.len() as u64, "{wide_bar} {pos}/{len} {eta}");
    let work: Vec<(&RecordingArguments, &PathBuf)> = recordings.iter().zip(&reports).collect();
    let written: Vec<Result<bool, String>> = in_parallel(&work, |(recording, report)| {
        let written = on_one_thread(|| {
            let analysed = analyze(recording)?;
            let json = ReportJson::from(&analysed.report).with_reading(analysed.reading.as_ref());
            output::write_json(&json, report, outputs)?;
            Ok(analysed.is_complete())
        });
        bar.inc(1);
        written.map_err(|error| named(&recording.input.file, &error))
    });
    bar.finish_and_clear();
    let incomplete: Vec<String> = written
        .iter()
        .zip(recordings)
        .filter(|(written, _)| matches!(written, Ok(false)))
        .map(|(_, recording)| recording.input.file.display().to_string())
        .collect();
    incomplete.iter().for_each(|file| note(format_args!("{file}: not read to its end; its report says why")));
    let failures: Vec<String> = written.into_iter().filter_map(Result::err).collect();
    failures.iter().for_each(|failure| note(format_args!("no report: {failure}")));
    let written = recordings.len() - failures.len();
    if !is_quiet {
        output::print(|out| {
            writeln!(out, "{written} of {} reports in {}", recordings.len(), Printable(&folder.display().to_string()))
        })?;
    }
    if !failures.is_empty() {
        bail!("{} of {} recordings have no report", failures.len(), recordings.len());
    }
    if !incomplete.is_empty() {
        let count = incomplete.len();
        return Err(Incomplete(format!("{count} of {} recordings were not read to their end", recordings.len())).into());
    }
    Ok(())
}

/// An error with the name of its file before it, where it does not begin with it.
fn named(file: &Path, error: &anyhow::Error) -> String {
    let (name, text) = (file.display().to_string(), format!("{error:#}"));
    if text.starts_with(&name) { text } else { format!("{name}: {text}") }
}

/// The report of each recording: the name of its file, and that of its sensor where one is named.
fn names(recordings: &[RecordingArguments], folder: &Path) -> Result<Vec<PathBuf>> {
    let mut known: BTreeMap<PathBuf, &Path> = BTreeMap::new();
    let mut reports = Vec::with_capacity(recordings.len());
    for recording in recordings {
        let input = &recording.input;
        let file = input.file.as_path();
        let name = output::source_name(file);
        let stem = ENDINGS.iter().fold(name.as_str(), |name, ending| match name.strip_suffix(ending) {
            Some("") | None => name,
            Some(stem) => stem,
        });
        let of_file = recordings.iter().filter(|other| other.input.file == *file);
        // Of several sensors of a file each has its own name, or its number.
        let sensor = match (of_file.clone().count(), &input.topic) {
            (1, _) => String::new(),
            (_, Some(topic)) => {
                let plain = topic.replace(|letter: char| !letter.is_ascii_alphanumeric(), "-");
                format!("-{}", plain.trim_matches('-'))
            }
            (_, None) => {
                format!("-{}", of_file.clone().position(|other| std::ptr::eq(other, recording)).unwrap_or(0))
            }
        };
        let report = folder.join(format!("{stem}{sensor}.json"));
        if let Some(other) = known.insert(report.clone(), file) {
            let [one, other, report] = [other, file, &report].map(|path| path.display().to_string());
            bail!("{} and {} would both have the report {}", Printable(&one), Printable(&other), Printable(&report));
        }
        reports.push(report);
    }
    Ok(reports)
}
