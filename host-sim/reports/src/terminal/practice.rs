//! What a channel's model is good for, as text.

use super::{table, wrapped};
use crate::wording::{duration, interval, number, unit, verdict, words};
use comfy_table::Table;
use noise_analysis::practice::{Coefficient, Practice, Record};
use std::io::{self, Write};

pub(super) fn write(practice: &Practice, out: &mut impl Write) -> io::Result<()> {
    if !practice.coefficients.is_empty() {
        writeln!(out, "{}", coefficient_table(&practice.coefficients))?;
    }
    if !practice.drift.is_empty() {
        writeln!(out, "{}", drift_table(practice))?;
    }
    if let Some(found) = &practice.innovations {
        let text = format!(
            "• Kalman filter of the model on the unseen half: {} innovations, {} of the expected variance ({} for a true \
             model), whiteness p = {}: {}.",
            found.count,
            number(found.normalised),
            interval(found.low, found.high),
            number(found.whiteness_p),
            verdict(found)
        );
        writeln!(out, "{}", wrapped(&text))?;
    }
    if let Some(by_spectrum) = &practice.angle_random_walk_by_spectrum {
        let value = format!("{} {}", number(by_spectrum.value), unit(&by_spectrum.unit));
        writeln!(out, "• N by the spectrum: {value} ({}).", interval(by_spectrum.low, by_spectrum.high))?;
    }
    if let Some(time) = &practice.markov_time_by_autocorrelation {
        let value = format!("{} {}", number(time.value), unit(&time.unit));
        writeln!(out, "• Markov time by the autocorrelation: {value} ({}).", interval(time.low, time.high))?;
    }
    practice.record.iter().try_for_each(|record| writeln!(out, "• {}.", advice(record)))
}

/// How long to record for a coefficient.
pub(crate) fn advice(record: &Record) -> String {
    let kind = words(&record.kind);
    match record.more_hours {
        Some(0.0) => format!("{kind}: known to ±20 % and better"),
        Some(hours) => format!("{kind} to ±20 %: record {} more", duration(3600.0 * hours)),
        None => format!("{kind}: not shown by this record, or a month would not tell it to ±20 %"),
    }
}

fn coefficient_table(coefficients: &[Coefficient]) -> Table {
    let row = |coefficient: &Coefficient| {
        let value = &coefficient.value;
        let sense = if coefficient.discrete { "discrete, of samples" } else { "continuous" };
        let kind = words(&coefficient.kind);
        vec![kind, sense.to_owned(), unit(&value.unit), number(value.value), interval(value.low, value.high)]
    };
    let header = ["in other units", "", "unit", "value", "95 % interval"];
    table(&header, 3, coefficients.iter().map(row).collect())
}

fn drift_table(practice: &Practice) -> Table {
    let row = |drift: &noise_analysis::practice::Drift| {
        let observed = drift.observed.as_ref();
        vec![
            duration(drift.seconds),
            unit(&drift.unit),
            number(drift.predicted),
            observed.map_or_else(|| "too short".to_owned(), |observed| number(observed.value)),
            observed.map_or_else(String::new, |observed| interval(observed.low, observed.high)),
        ]
    };
    let header = ["error after", "unit", "predicted", "unseen half", "95 % interval"];
    table(&header, 1, practice.drift.iter().map(row).collect())
}
