//! The report as one HTML file that needs nothing else: styles and pictures are inside. The same report gives the
//! same bytes.

mod practice;
mod sections;

use crate::plot::{self, PlotError};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use noise_analysis::report::Report;
use std::path::{Path, PathBuf};

const STYLE: &str = include_str!("page/style.css");

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// The folder or the file cannot be written.
    #[error("cannot write the page {}: {reason}", path.display())]
    Write {
        /// What was to be written.
        path: PathBuf,
        /// What the system said.
        reason: std::io::Error,
    },
    /// A picture could not be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
}

/// Writes `index.html` into `dir`, which is made if it is missing, and returns its path.
pub fn write(report: &Report, dir: &Path) -> Result<PathBuf, PageError> {
    let page = render(report)?.into_string();
    let path = dir.join("index.html");
    std::fs::create_dir_all(dir)
        .and_then(|()| std::fs::write(&path, page))
        .map_err(|reason| PageError::Write { path: path.clone(), reason })?;
    Ok(path)
}

fn render(report: &Report) -> Result<Markup, PlotError> {
    let channels = report
        .channels
        .iter()
        .map(|channel| Ok((channel, plot::allan(channel)?)))
        .collect::<Result<Vec<_>, PlotError>>()?;
    Ok(html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "ADIS16405 noise report" }
                style { (PreEscaped(STYLE)) (PreEscaped(dark_pictures())) }
            }
            body {
                header {
                    h1 { "ADIS16405 noise report" }
                    p { "Allan deviation of each channel, the coefficients read off its slopes beside the fit, \
                         and how well the model predicts data it has not seen." }
                }
                main {
                    (sections::summary(report))
                    @if !channels.is_empty() { (sections::overview(report)) }
                    @for (channel, picture) in &channels { (sections::channel(channel, picture)) }
                    (sections::definitions())
                }
            }
        }
    })
}

/// On a dark ground every colour of the pictures is replaced by its bright counterpart.
fn dark_pictures() -> String {
    let rules: String = plot::DARK
        .iter()
        .map(|(light, dark)| format!("svg [fill=\"{light}\"]{{fill:{dark}}}svg [stroke=\"{light}\"]{{stroke:{dark}}}"))
        .collect();
    format!("@media (prefers-color-scheme: dark) {{{rules}}}")
}
