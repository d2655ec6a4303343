//! `explain`: the reports of recordings in sentences, and on demand their figures.

use crate::cli::ExplainArguments;
use crate::output::{note, print};
use crate::output_files::OutputFiles;
use anyhow::{Context, Result};
use noise_analysis::analysis::analyze;
use noise_analysis::report::Report;
use recordings::Printable;
use recordings::count_table;
use recordings::time_base::{StampQuality, time_base};
use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Explains every recording that is named, or is in a folder that is named.
pub(crate) fn run(arguments: &ExplainArguments) -> Result<()> {
    let mut stems = BTreeSet::new();
    let tables: Vec<Vec<PathBuf>> =
        arguments.recordings.iter().map(|path| count_table::tables_in(path)).collect::<Result<_, _>>()?;
    let files = OutputFiles::beside(tables.iter().flatten().map(PathBuf::as_path));
    for file in tables.iter().flatten() {
        let recording = count_table::read(file, arguments.range.into())?;
        let base = time_base(&recording, arguments.rate).with_context(|| file.display().to_string())?;
        for sentence in base.stamps.iter().flat_map(StampQuality::notes) {
            note(format_args!("{}: {sentence}", file.display()));
        }
        let report = analyze(&base.measurement);
        print(|out| {
            writeln!(out, "\n══ {}", Printable(&file.display().to_string()))?;
            reports::explanation::write(&report, out)
        })?;
        if let Some(folder) = &arguments.pictures {
            write_figures(&report, &distinct_stem(file, &mut stems), folder, &files)?;
        }
    }
    Ok(())
}

/// The name of `recording` without the ending of a table, and with a number where `stems` has it already.
fn distinct_stem(recording: &Path, stems: &mut BTreeSet<String>) -> String {
    let name = recording.file_name().unwrap_or_default().to_string_lossy();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    let stem = name.strip_suffix(".csv").unwrap_or(name).to_owned();
    let numbered = (2..).map(|number| format!("{stem}-{number}"));
    let distinct = std::iter::once(stem.clone()).chain(numbered).find(|name| !stems.contains(name)).unwrap_or(stem);
    stems.insert(distinct.clone());
    distinct
}

/// Writes every figure of a report as SVG into `folder`, named after the recording and the figure.
fn write_figures(report: &Report, stem: &str, folder: &Path, files: &OutputFiles) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    for picture in reports::figure::pictures(report) {
        let file = folder.join(format!("{stem}-{}.svg", picture.name));
        files.write(&file, picture.svg.as_bytes())?;
    }
    Ok(())
}
