//! `batch`: one report per recording, for many files or folders, with one analysis per core at a time.

use crate::analyze::report;
use crate::cli::{BatchArguments, RecordingArguments};
use crate::inspect::{self, read_or_ask};
use crate::output::{self, Analysed, Incomplete, brief, note, progress_bar};
use crate::output_files::OutputFiles;
use anyhow::{Context, Result, bail, ensure};
use noise_analysis::parallel::{in_parallel, on_at_most, on_one_thread};
use recordings::file_format::files_of_bag;
use recordings::{Printable, ReadMonitor};
use reports::json::ReportJson;
use reports::reading::ReadingRecord;
use reports::rows::{ReportRow, rows};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Endings that the name of a report does not keep.
const ENDINGS: [&str; 2] = [".gz", ".csv"];

/// A recording, and the file of its report.
struct Work {
    recording: RecordingArguments,
    report: PathBuf,
}

/// A recording that has a report, or the reason why it has none.
enum Outcome {
    Reported(Box<Analysed>),
    /// The report exists already.
    Kept,
    Failed(String),
}

/// Writes the report of each recording. A recording that cannot be analysed does not stop the others.
///
/// # Errors
/// Two recordings would have one report, a file cannot be written, or a recording could not be analysed.
pub(crate) fn run(arguments: &BatchArguments) -> Result<()> {
    let BatchArguments { recording, more, each_sensor, quick, output, resume, rows: of_rows, jobs, quiet, force } =
        arguments;
    let mut given = Vec::new();
    for folder in [&recording.input.file].into_iter().chain(more) {
        let is_folder = folder.is_dir() && files_of_bag(folder).unwrap_or_default().is_empty();
        let files = if is_folder { files_below(folder)? } else { vec![folder.clone()] };
        ensure!(!files.is_empty(), "{}: no file in it", folder.display());
        for file in files {
            // The folders of the reports mirror those of the recordings.
            let below = file.strip_prefix(folder).ok().filter(|_| is_folder).and_then(Path::parent);
            let of_file = recording.of_file(&file);
            let sensors = if *each_sensor { inspect::each_sensor(&of_file)? } else { vec![of_file] };
            given.extend(sensors.into_iter().map(|sensor| (sensor, output.join(below.unwrap_or(Path::new(""))))));
        }
    }
    let inputs = given.iter().map(|(recording, _)| recording.input.file.as_path());
    let outputs = OutputFiles::new(inputs, *force || *resume);
    let all = with_reports(given)?;
    for folder in all.iter().filter_map(|work| work.report.parent()) {
        fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    for work in &all {
        outputs.check(&work.report)?;
    }
    let table = of_rows.as_deref().map(|file| open_rows(file, *resume, &outputs)).transpose()?.map(Mutex::new);
    let bar = progress_bar(all.len() as u64, "{wide_bar} {pos}/{len} {eta}");
    let analyse = |work: &Work| {
        let outcome = on_one_thread(|| analysed(work, *quick, *resume, &outputs));
        let written = table.as_ref().map_or(Ok(()), |table| {
            write_rows(&work.recording, &outcome, &mut table.lock().unwrap_or_else(PoisonError::into_inner))
        });
        bar.inc(1);
        written.map(|()| outcome)
    };
    let each = || in_parallel(&all, analyse);
    let outcomes = jobs.map_or_else(each, |jobs| on_at_most(jobs.get(), each));
    bar.finish_and_clear();
    let outcomes: Vec<Outcome> = outcomes.into_iter().collect::<Result<_>>()?;
    conclude(&all, &outcomes, output, *quiet)
}

/// Names the recordings without a report, and those not read to their end.
fn conclude(all: &[Work], outcomes: &[Outcome], out: &Path, is_quiet: bool) -> Result<()> {
    let (mut failed, mut incomplete, mut kept) = (0, 0, 0);
    for (work, outcome) in all.iter().zip(outcomes) {
        let file = work.recording.input.file.display();
        match outcome {
            Outcome::Reported(analysed) if analysed.is_complete() => {}
            Outcome::Reported(_) => {
                incomplete += 1;
                note(format_args!("{file}: not read to its end; its report says why"));
            }
            Outcome::Kept => kept += 1,
            Outcome::Failed(reason) => {
                failed += 1;
                note(format_args!("no report: {reason}"));
            }
        }
    }
    if !is_quiet {
        let before = if kept > 0 { format!(", {kept} of them from before") } else { String::new() };
        let written = all.len() - failed;
        output::print(|to| {
            writeln!(to, "{written} of {} reports in {}{before}", all.len(), Printable(&out.display().to_string()))
        })?;
    }
    if failed > 0 {
        bail!("{failed} of {} recordings have no report", all.len());
    }
    if incomplete > 0 {
        return Err(Incomplete(format!("{incomplete} of {} recordings were not read to their end", all.len())).into());
    }
    Ok(())
}

/// The files below a folder whose names do not begin with a dot, sorted by name. A bag of ROS 2 is its folder.
fn files_below(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let mut paths: Vec<PathBuf> = entries.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    paths.retain(|path| !path.file_name().unwrap_or_default().to_string_lossy().starts_with('.'));
    paths.sort();
    let mut files = Vec::new();
    for path in paths {
        let is_link = fs::symlink_metadata(&path).is_ok_and(|of| of.is_symlink());
        if !path.is_dir() || !files_of_bag(&path).unwrap_or_default().is_empty() {
            files.push(path);
        } else if !is_link {
            files.extend(files_below(&path)?);
        }
    }
    Ok(files)
}

/// Opens the file of the rows. If the work is resumed, new rows are added to the existing ones.
fn open_rows(file: &Path, resume: bool, outputs: &OutputFiles) -> Result<File> {
    outputs.check(file)?;
    let open = OpenOptions::new().create(true).write(true).append(resume).truncate(!resume).open(file);
    open.with_context(|| file.display().to_string())
}

fn analysed(work: &Work, is_quick: bool, resume: bool, outputs: &OutputFiles) -> Outcome {
    let analyse = || -> Result<Outcome> {
        if resume && is_up_to_date(work, is_quick)? {
            return Ok(Outcome::Kept);
        }
        let analysed = read_or_ask(&work.recording, |recording| {
            report(recording, is_quick, &ReadMonitor::default(), &mut |_, _| {})
        })?;
        let json = ReportJson::new(&analysed.report, analysed.reading.as_ref());
        output::write_json(&json, &work.report, outputs)?;
        Ok(Outcome::Reported(Box::new(analysed)))
    };
    analyse().unwrap_or_else(|error| Outcome::Failed(named(&work.recording.input.file, &error)))
}

/// True if the report exists and is of the same bytes, read in the same way by this version.
fn is_up_to_date(work: &Work, is_quick: bool) -> Result<bool> {
    #[derive(Deserialize)]
    struct WithReading {
        reading: ReadingRecord,
    }
    let Ok(text) = fs::read_to_string(&work.report) else { return Ok(false) };
    let Ok(WithReading { reading }) = serde_json::from_str(&text) else { return Ok(false) };
    if reading.version != env!("CARGO_PKG_VERSION") || reading.options != work.recording.options(is_quick) {
        return Ok(false);
    }
    let Some(before) = reading.sha256 else { return Ok(false) };
    let input = work.recording.input.open(&ReadMonitor::default())?;
    Ok(input.begin_hash().and_then(|hash| hash.finish()).is_ok_and(|now| now == before))
}

/// Adds the rows of a recording. An existing report has its rows in the file already.
fn write_rows(recording: &RecordingArguments, outcome: &Outcome, table: &mut File) -> Result<()> {
    let file = recording.input.file.display().to_string();
    let name = recording.input.topic.as_ref().map_or_else(|| file.clone(), |topic| format!("{file}#{topic}"));
    let rows = match outcome {
        Outcome::Reported(analysed) => rows(&analysed.report, &name, analysed.reading.as_ref()),
        Outcome::Kept => return Ok(()),
        Outcome::Failed(reason) => vec![ReportRow::failed(&name, &brief(reason), env!("CARGO_PKG_VERSION"))],
    };
    let mut lines = Vec::new();
    for row in &rows {
        serde_json::to_writer(&mut lines, row)?;
        lines.push(b'\n');
    }
    // All rows of a recording are written at once: if the program ends, no part of a recording remains.
    Ok(table.write_all(&lines)?)
}

/// An error with the name of its file in front, unless it begins with it.
fn named(file: &Path, error: &anyhow::Error) -> String {
    let (name, text) = (file.display().to_string(), format!("{error:#}"));
    if text.starts_with(&name) { text } else { format!("{name}: {text}") }
}

/// The recordings with their reports. A report has the name of its file, and of its sensor if one is named.
fn with_reports(recordings: Vec<(RecordingArguments, PathBuf)>) -> Result<Vec<Work>> {
    let mut known: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
    let mut all = Vec::with_capacity(recordings.len());
    for (at, (recording, folder)) in recordings.iter().enumerate() {
        let input = &recording.input;
        let name = output::source_name(&input.file);
        let stem = ENDINGS.iter().fold(name.as_str(), |name, ending| match name.strip_suffix(ending) {
            Some("") | None => name,
            Some(stem) => stem,
        });
        let of_file = || recordings.iter().enumerate().filter(|(_, (other, _))| other.input.file == input.file);
        // If a file has several sensors, each report has the sensor's name, or its number.
        let sensor = match (of_file().count(), &input.topic) {
            (1, _) => String::new(),
            (_, Some(topic)) => {
                let plain = topic.replace(|letter: char| !letter.is_ascii_alphanumeric(), "-");
                format!("-{}", plain.trim_matches('-'))
            }
            (_, None) => format!("-{}", of_file().position(|(other, _)| other == at).unwrap_or(0)),
        };
        let report = folder.join(format!("{stem}{sensor}.json"));
        if let Some(other) = known.insert(report.clone(), input.file.clone()) {
            let [one, other, report] = [&other, &input.file, &report].map(|path| path.display().to_string());
            bail!("{} and {} would both have the report {}", Printable(&one), Printable(&other), Printable(&report));
        }
        all.push(Work { recording: recording.clone(), report });
    }
    Ok(all)
}
