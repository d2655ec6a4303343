//! `explain`: tables, and on demand figures, of what the analysis finds in recordings of hours.

use crate::cli::{ExplainArguments, OutputArguments};
use crate::output::print;
use anyhow::{Context, Result, bail};
use noise_analysis::nonstationarity::{Explanation, explain};
use recordings::count_table;
use recordings::time_base::measurement;
use std::fs;
use std::io::Write;
use std::path::Path;

/// Explains every recording that is named, or is in a folder that is named.
pub(crate) fn run(arguments: &ExplainArguments, output: &OutputArguments) -> Result<()> {
    if output.page.is_some() || output.json.is_some() || output.kalibr.is_some() {
        bail!("explain writes tables only: leave out --page, --json and --kalibr");
    }
    for path in &arguments.recordings {
        for file in count_table::tables_in(path)? {
            let recording = count_table::read(&file, arguments.range.into())?;
            let measurement = measurement(&recording, arguments.rate).with_context(|| file.display().to_string())?;
            let explanation = explain(&measurement);
            print(|out| {
                writeln!(out, "\n══ {}", file.display())?;
                reports::explanation::write(&explanation, out)
            })?;
            if let Some(folder) = &arguments.pictures {
                write_figures(&explanation, &file, folder)?;
            }
        }
    }
    Ok(())
}

/// Writes one SVG a channel into `folder`, named after the recording and the channel.
fn write_figures(explanation: &Explanation, recording: &Path, folder: &Path) -> Result<()> {
    let name = recording.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.split('.').next().unwrap_or_default();
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    for channel in &explanation.channels {
        let file = folder.join(format!("{stem}-{}.svg", channel.channel.name));
        fs::write(&file, reports::figure::explained_channel(channel)?).with_context(|| file.display().to_string())?;
    }
    Ok(())
}
