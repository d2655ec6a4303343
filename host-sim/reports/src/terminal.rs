//! The report as text: at most 100 columns, the same in a terminal and in a file.

mod practice;

pub(crate) use practice::advice;

use crate::coefficients::{self, Row};
use crate::wording::{NONE, count, duration, interval, number, optional, parameter_name, percent, unit, words};
use comfy_table::{CellAlignment, ContentArrangement, Table, modifiers, presets};
use noise_analysis::navigation::CALIBRATION_S;
use noise_analysis::report::{ChannelReport, Parameter, Report, Term};
use std::collections::BTreeMap;
use std::io::{self, Write};

/// Widest line, columns.
pub const WIDTH: u16 = 100;

/// The whole report.
pub fn write(report: &Report, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "ADIS16405 noise report")?;
    writeln!(out, "══════════════════════")?;
    writeln!(out, "sample rate  {} Hz", number(report.sample_rate_hz))?;
    let length = duration(report.samples as f64 / report.sample_rate_hz);
    writeln!(out, "samples      {} used, {length}", count(report.samples))?;
    writeln!(out, "dropped      {}", by_cause(&report.dropped))?;
    writeln!(out, "flagged      {}", by_cause(&report.flagged))?;
    for channel in &report.channels {
        section(channel, out)?;
    }
    writeln!(out)?;
    writeln!(out, "Intervals are of 95 %. The models are fitted to the first half of the samples; the second")?;
    writeln!(out, "half is unseen. deviance: mean edf·(ln(m/v) + v/m − 1), about 1 for a true model;")?;
    writeln!(out, "rms: 100·√(mean (½ ln(v/m))²) %; v measured, m modelled Allan variance, n ≤ M/8.")?;
    writeln!(
        out,
        "error after t: rms of the integral over t when the bias is the mean of the {CALIBRATION_S} s before."
    )
}

/// By cause, on one line unless there are very many.
fn by_cause(counts: &BTreeMap<String, u64>) -> String {
    if counts.values().all(|&samples| samples == 0) {
        return "none".to_owned();
    }
    let causes = counts.iter().filter(|(_, samples)| **samples > 0);
    let told: Vec<String> = causes.map(|(cause, samples)| format!("{} {}", words(cause), count(*samples))).collect();
    told.join(", ")
}

fn section(channel: &ChannelReport, out: &mut impl Write) -> io::Result<()> {
    let name = format!("{} · {}", channel.name, unit(&channel.unit));
    let samples = format!("{} samples", count(channel.samples));
    let used = name.chars().count() + samples.chars().count() + 6;
    let rule = "─".repeat(usize::from(WIDTH).saturating_sub(used));
    writeln!(out, "\n── {name} {rule} {samples}\n")?;

    writeln!(out, "{}", coefficient_table(channel))?;
    let same = channel.after == channel.before;
    if !same {
        writeln!(out, "{}", term_table(&channel.after.terms))?;
    }
    writeln!(out, "{}", error_table(channel))?;
    for effect in &channel.effects {
        writeln!(out, "{}", wrapped(&format!("• {}: {}", words(&effect.kind), effect.evidence)))?;
    }
    if same && channel.effects.is_empty() {
        writeln!(out, "No effect was added to the declared model: after equals before.")?;
    }
    practice::write(&channel.practice, out)?;
    if channel.curve.is_empty() {
        return writeln!(out, "The record is too short for a point of the curve.");
    }
    writeln!(out, "{}", curve_table(channel))
}

/// `text` broken between words before the last column; longer words stay whole.
fn wrapped(text: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let full = lines.last().is_some_and(|line| {
            let length = line.chars().count() + 1 + word.chars().count();
            length > usize::from(WIDTH) && !line.trim().is_empty()
        });
        if full {
            lines.push(" ".to_owned());
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines.join("\n")
}

/// A table whose first `left` columns are words and the rest numbers.
fn table(header: &[&str], left: usize, rows: Vec<Vec<String>>) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::UTF8_FULL_CONDENSED)
        .apply_modifier(modifiers::UTF8_ROUND_CORNERS)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_width(WIDTH)
        .set_header(header.iter().copied())
        .add_rows(rows);
    for column in table.column_iter_mut().skip(left) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn coefficient_table(channel: &ChannelReport) -> Table {
    let header = ["coefficient", "unit", "read off", "slope found, s", "fit", "95 % interval"];
    let row = |row: Row<'_>| {
        let (read_off, found) = match (row.read_off, row.rule) {
            (Some(value), _) => (number(value.value), interval(value.from_s, value.to_s)),
            (None, "") => (NONE.to_owned(), NONE.to_owned()),
            (None, _) => (NONE.to_owned(), "no such slope".to_owned()),
        };
        let [fit, bounds] = fitted(row.fit);
        vec![words(row.kind), unit(row.unit), read_off, found, fit, bounds]
    };
    table(&header, 2, coefficients::rows(channel).into_iter().map(row).collect())
}

/// Estimate and interval.
fn fitted(parameter: Option<&Parameter>) -> [String; 2] {
    match parameter {
        Some(p) => [number(p.value), interval(p.low, p.high)],
        None => [NONE.to_owned(), NONE.to_owned()],
    }
}

fn term_table(terms: &[Term]) -> Table {
    let rows = terms.iter().flat_map(|term| {
        term.parameters.iter().map(|(name, parameter)| {
            let [fit, bounds] = fitted(Some(parameter));
            vec![words(&term.kind), parameter_name(name), unit(&parameter.unit), fit, bounds]
        })
    });
    let header = ["with the effects", "parameter", "unit", "fit", "95 % interval"];
    table(&header, 3, rows.collect())
}

fn error_table(channel: &ChannelReport) -> Table {
    let rows = [("before", &channel.before), ("after", &channel.after)].map(|(name, model)| {
        vec![
            name.to_owned(),
            percent(model.fitted.rms_percent),
            percent(model.unseen.rms_percent),
            optional(model.fitted.deviance_per_point),
            optional(model.unseen.deviance_per_point),
        ]
    });
    let header = ["model error", "rms, fitted", "rms, unseen", "deviance, fitted", "deviance, unseen"];
    table(&header, 1, rows.to_vec())
}

fn curve_table(channel: &ChannelReport) -> Table {
    let same = channel.after == channel.before;
    let mut header = vec!["n", "τ, s", "σ(τ)", "low", "high", "edf", "accuracy, %"];
    header.extend(if same { &["model"][..] } else { &["before", "after"] });
    let rows = channel.curve.iter().enumerate().map(|(index, point)| {
        let mut row = vec![
            count(point.n),
            number(point.tau_s),
            number(point.adev),
            number(point.low),
            number(point.high),
            number(point.edf),
            number(point.accuracy_percent),
            optional(channel.before.adev.get(index).copied()),
        ];
        if !same {
            row.push(optional(channel.after.adev.get(index).copied()));
        }
        row
    });
    table(&header, 0, rows.collect())
}

#[cfg(test)]
mod tests {
    use super::wrapped;

    #[test]
    fn evidence_is_broken_between_words() {
        let text = "• sinusoid: ".to_owned() + &"word ".repeat(60);
        let broken = wrapped(&text);
        assert!(broken.lines().count() > 2);
        assert!(broken.lines().all(|line| line.chars().count() <= 100));
        assert_eq!(broken.split_whitespace().count(), text.split_whitespace().count());
    }

    #[test]
    fn a_short_sentence_stays_as_it_is() {
        assert_eq!(wrapped("• step: at 3 s"), "• step: at 3 s");
    }
}
