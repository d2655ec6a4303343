//! `-o [FORMAT=]FILE`: the format of an output file, by its ending or by the name before it.

use crate::output_files::is_standard_stream;
use crate::tip::similar_name;
use clap::ValueEnum;
use reports::export::ExportFormat;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The format of an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OutputFormat {
    /// The whole report.
    Json,
    /// A web page.
    Page,
    /// Every figure as SVG, each in a file of its own.
    Figures,
    /// The noise alone, for another program.
    Noise(ExportFormat),
}

/// Endings, with the formats that they select.
const ENDINGS: [(&str, OutputFormat); 9] = [
    ("json", OutputFormat::Json),
    ("html", OutputFormat::Page),
    ("svg", OutputFormat::Figures),
    ("yaml", OutputFormat::Noise(ExportFormat::Kalibr)),
    ("yml", OutputFormat::Noise(ExportFormat::Kalibr)),
    ("csv", OutputFormat::Noise(ExportFormat::Csv)),
    ("m", OutputFormat::Noise(ExportFormat::Matlab)),
    ("py", OutputFormat::Noise(ExportFormat::Gtsam)),
    ("sdf", OutputFormat::Noise(ExportFormat::Gazebo)),
];

/// A file to write; `-` is standard output.
#[derive(Debug, Clone)]
pub(crate) struct OutputFile {
    pub(crate) format: OutputFormat,
    pub(crate) file: PathBuf,
}

/// The formats that can be named before the file.
fn named_formats() -> impl Iterator<Item = (String, OutputFormat)> {
    let of_noise = |format: &ExportFormat| Some((format.to_possible_value()?.get_name().to_owned(), *format));
    let noise = ExportFormat::value_variants().iter().filter_map(of_noise);
    let of_report = ENDINGS[..3].iter().map(|(name, format)| ((*name).to_owned(), *format));
    of_report.chain(noise.map(|(name, format)| (name, OutputFormat::Noise(format))))
}

/// Parses an output: `report.html`, `kalibr=imu.yaml`, or `-` for JSON on standard output.
pub(crate) fn output_file(text: OsString) -> Result<OutputFile, String> {
    let file = PathBuf::from(&text);
    if is_standard_stream(&file) {
        return Ok(OutputFile { format: OutputFormat::Json, file });
    }
    let words = text.to_string_lossy();
    let is_name = |name: &str| name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '-');
    let output = match words.split_once('=').filter(|(name, _)| is_name(name)) {
        Some((name, file)) => OutputFile { format: named_format(name)?, file: file.into() },
        None => OutputFile { format: format_by_ending(&file)?, file },
    };
    match (output.file.as_os_str().is_empty(), output.format) {
        (true, _) => Err("no file after the format".to_owned()),
        (_, OutputFormat::Figures) if is_standard_stream(&output.file) => Err("figures are several files".to_owned()),
        _ => Ok(output),
    }
}

fn named_format(name: &str) -> Result<OutputFormat, String> {
    let known: Vec<(String, OutputFormat)> = named_formats().collect();
    let format = known.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, format)| *format);
    format.ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|(name, _)| name.as_str()).collect();
        let tip = similar_name(name, &names).map_or(String::new(), |similar| format!("; did you mean {similar}?"));
        format!("`{name}` is none of {}{tip}", names.join(", "))
    })
}

fn format_by_ending(file: &Path) -> Result<OutputFormat, String> {
    let ending = file.extension().unwrap_or_default();
    let format = ENDINGS.iter().find(|(known, _)| ending.eq_ignore_ascii_case(known)).map(|(_, format)| *format);
    format.ok_or_else(|| {
        let endings = ENDINGS.map(|(known, _)| format!(".{known}")).join(", ");
        let names: Vec<String> = named_formats().map(|(name, _)| name).collect();
        format!("its ending is none of {endings}; FORMAT=FILE has any, with FORMAT one of {}", names.join(", "))
    })
}

/// Parses an output of `export`, which is the noise alone.
pub(crate) fn noise_file(text: OsString) -> Result<OutputFile, String> {
    output_file(text).and_then(|output| match output.format {
        OutputFormat::Noise(_) => Ok(output),
        _ => {
            Err("the whole report: `analyze` writes it; `export` writes the noise, as imu.yaml or kalibr=-".to_owned())
        }
    })
}

/// Parses an output of `compare`, which is JSON.
pub(crate) fn json_file(text: OsString) -> Result<OutputFile, String> {
    output_file(text).and_then(|output| match output.format {
        OutputFormat::Json => Ok(output),
        _ => Err("a comparison is written as JSON alone".to_owned()),
    })
}
