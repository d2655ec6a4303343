//! The report as one HTML file that needs no other: style and figures are inside. The same report gives the same bytes.

mod tables;

use crate::figure::{self, FigureError};
use crate::formatting::{
    count, duration, filter_consistency, interval, missing_samples, number, parameter_name, recording_advice, unit,
    words, worst_deviations,
};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use noise_analysis::assessment::Assessment;
use noise_analysis::report::{ChannelReport, Report};
use std::path::{Path, PathBuf};

const STYLE: &str = include_str!("page/style.css");

/// The page could not be written.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// The folder or the file cannot be written.
    #[error("cannot write the page {}: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        reason: std::io::Error,
    },
    /// A figure could not be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
}

/// Writes `index.html` into `dir`, which is made if it is missing, and returns its path.
///
/// # Errors
/// A figure cannot be drawn, or the file cannot be written.
pub fn write(report: &Report, dir: &Path) -> Result<PathBuf, PageError> {
    let page = render(report)?.into_string();
    let path = dir.join("index.html");
    std::fs::create_dir_all(dir)
        .and_then(|()| std::fs::write(&path, page))
        .map_err(|reason| PageError::Write { path: path.clone(), reason })?;
    Ok(path)
}

fn render(report: &Report) -> Result<Markup, FigureError> {
    let channels = report
        .channels
        .iter()
        .map(|channel| Ok((channel, figure::allan_deviation(channel)?)))
        .collect::<Result<Vec<_>, FigureError>>()?;
    Ok(html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "ADIS16405 noise report" }
                style { (PreEscaped(STYLE)) (PreEscaped(dark_figures())) }
            }
            body {
                header {
                    h1 { "ADIS16405 noise report" }
                    p { "Allan deviation of each channel, the coefficients by the slope method beside the fit, \
                         and how well the model predicts data it has not seen." }
                }
                main {
                    (summary(report))
                    @if !channels.is_empty() {
                        section { h2 { "Overview" } (tables::overview(report)) }
                    }
                    @for (channel, figure) in &channels { (channel_section(channel, figure)) }
                    (definitions())
                }
            }
        }
    })
}

/// The rules that replace every colour of the figures on a dark page.
fn dark_figures() -> String {
    let rules: String = figure::DARK_COLOURS
        .iter()
        .map(|(light, dark)| format!("svg [fill=\"{light}\"]{{fill:{dark}}}svg [stroke=\"{light}\"]{{stroke:{dark}}}"))
        .collect();
    format!("@media (prefers-color-scheme: dark) {{{rules}}}")
}

/// Sample rate, numbers of samples and channels, and the samples dropped by cause.
fn summary(report: &Report) -> Markup {
    let lost: u64 = report.dropped.values().fold(0, |sum, &samples| sum.saturating_add(samples));
    let length = duration(report.samples as f64 / report.sample_rate_hz);
    let names: Vec<&str> = report.channels.iter().map(|channel| channel.name.as_str()).collect();
    html! {
        section.cards aria-label="The record" {
            (card("Sample rate", &format!("{} Hz", number(report.sample_rate_hz)), ""))
            (card("Samples used", &count(report.samples), &length))
            (card("Channels", &count(report.channels.len() as u64), &names.join(", ")))
            div.card {
                h2 { "Samples dropped" }
                p.figure { (count(lost)) }
                @if report.dropped.is_empty() {
                    p.note { "none" }
                } @else {
                    ul.causes {
                        @for (cause, samples) in &report.dropped {
                            li { span { (words(cause)) } " " b { (count(*samples)) } }
                        }
                        @for (cause, samples) in &report.flagged {
                            li { span { (words(cause)) ", used" } " " b { (count(*samples)) } }
                        }
                    }
                }
            }
        }
    }
}

fn card(title: &str, value: &str, note: &str) -> Markup {
    html! {
        div.card {
            h2 { (title) }
            p.figure { (value) }
            @if !note.is_empty() { p.note { (note) } }
        }
    }
}

/// One channel with its figure and tables.
fn channel_section(channel: &ChannelReport, figure: &str) -> Markup {
    let same = channel.after == channel.before;
    html! {
        section.channel id=(channel.name) {
            h2 { (channel.name) " " small { (unit(&channel.unit)) " · " (count(channel.samples)) " samples" } }
            @let missing = missing_samples(&channel.missing);
            @if !missing.is_empty() { p.note { "Missing: " (missing) "." } }
            figure role="img" aria-label={ "Allan deviation of " (channel.name) } { (PreEscaped(figure)) }
            div.tables {
                div {
                    h3 { "Coefficients" }
                    (tables::coefficients(channel))
                    @if !same {
                        h3 { "Model with the traced effects" }
                        (tables::terms(&channel.after))
                    }
                }
                div {
                    h3 { "Model error" }
                    (tables::errors(channel))
                    @let far = worst_deviations(channel);
                    @if !far.is_empty() { ul.effects { @for text in &far { li { (text) "." } } } }
                    @if channel.effects.is_empty() {
                        p.note { "No effect was traced"
                            @if same { ": after equals before" } "." }
                    } @else {
                        h3 { "Effects traced" }
                        ul.effects {
                            @for effect in &channel.effects {
                                li { b { (words(&effect.kind)) } ": " (effect.evidence)
                                    @for (name, p) in &effect.parameters {
                                        span.parameter { (parameter_name(name)) " " (number(p.value))
                                            " " (unit(&p.unit)) " (" (interval(p.low, p.high)) ")" }
                                    }
                                }
                            }
                        }
                    }
                }
            }
            details {
                summary { "What the model is good for: other units, drift, a filter's innovations, longer records" }
                (assessment(&channel.assessment))
            }
            details {
                summary { "The curve in numbers (" (count(channel.curve.len() as u64)) " points)" }
                (tables::curve(channel))
            }
        }
    }
}

/// What the model of a channel is good for.
fn assessment(assessment: &Assessment) -> Markup {
    html! {
        @if !assessment.coefficients.is_empty() { (tables::units(&assessment.coefficients)) }
        @if !assessment.drift.is_empty() { (tables::drift(&assessment.drift)) }
        ul.effects {
            @if let Some(innovations) = &assessment.innovations {
                li { b { "Kalman filter of the model" } ", unseen half: " (filter_consistency(innovations)) "."
                    span.parameter { (count(innovations.count as u64)) " innovations, " (number(innovations.normalised))
                        " of the expected variance (" (interval(innovations.low, innovations.high))
                        " for a true model), whiteness p = " (number(innovations.whiteness_p)) }
                }
            }
            @if let Some(spectrum) = &assessment.angle_random_walk_by_spectrum {
                li { b { "N by the spectrum" } ": " (number(spectrum.value)) " " (unit(&spectrum.unit))
                    " (" (interval(spectrum.low, spectrum.high)) ")"
                    @if let Some(note) = &assessment.angle_random_walk_by_spectrum_note { span.parameter { (note) } } }
            } @else if let Some(note) = &assessment.angle_random_walk_by_spectrum_note {
                li { b { "N by the spectrum" } ": none, " (note) "." }
            }
            @if let Some(time) = &assessment.markov_time_by_autocorrelation {
                li { b { "Markov time by the autocorrelation" } ": " (number(time.value)) " " (unit(&time.unit))
                    " (" (interval(time.low, time.high)) ")" }
            }
            @for record in &assessment.record { li { (recording_advice(record)) } }
        }
    }
}

/// What the words and numbers of the page mean.
fn definitions() -> Markup {
    html! {
        section.definitions {
            h2 { "How to read this" }
            dl {
                dt { "Intervals" }
                dd { "have a confidence of 95 %, from the equivalent degrees of freedom (edf) of each point." }
                dt { "Before and after" }
                dd { "Before is the baseline model: angle random walk " i { "N" } ", bias instability " i { "B" }
                     ", rate random walk " i { "K" } ". After adds the effects that were traced." }
                dt { "Model error" }
                dd { "Models are fitted to the first half of the samples and checked on the second, unseen half. "
                     "With " i { "v" } " the measured and " i { "m" } " the modelled Allan variance, over the "
                     "octaves with " i { "n" } " ≤ " i { "M" } "/8: rms is 100·√(mean (½ ln(" i { "v/m" }
                     "))²) %, deviance a point is mean edf·(ln(" i { "m/v" } ") + " i { "v/m" }
                     " − 1), which is about 1 for a true model. Beneath is the largest deviation of a point over all "
                     "averaging times, in standard deviations σ; beyond ±4 σ it is told in words." }
                dt { "By PSD" }
                dd { "is the deviation by equation (5), σ²(τ) = 4·∫ S(f)·sin⁴(πfτ)/(πfτ)² df, from the measured "
                     "spectrum instead of differences of means." }
                dt { "Error after a time" }
                dd { "is the root mean square of the integral over that time, of a vehicle that took the mean of the 60 s "
                     "before as its bias: an angle of a gyro, a velocity of an accelerometer." }
                dt { "Innovations" }
                dd { "are what a Kalman filter of the model does not predict of quarter seconds of the unseen half. Of a true "
                     "model they are white and of the expected variance." }
                dt { "Continuous and discrete" }
                dd { "coefficients belong to the process and to its samples at this rate: they are different numbers." }
                dt { "Slope method" }
                dd { i { "N" } " is the −½ slope at 1 s, " i { "B" } " the flat minimum divided by √(2 ln 2/π) = "
                     "0.664, " i { "K" } " the +½ slope at 3 s. Accuracy is 100/√(2(" i { "N/n" } " − 1)) %, with "
                     i { "N" } " samples in all." }
            }
        }
    }
}
