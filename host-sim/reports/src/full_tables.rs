//! Every table of a report as text: at most 100 columns, the same in a terminal and in a file.

use crate::coefficients::{self, CoefficientRow};
use crate::explanation;
use crate::finding_text::{FindingText, printed_evidence};
use crate::formatting::{
    NONE, TextTable, capital, count, duration, filter_consistency, interval, missing_samples, number, optional,
    parameter_name, percent, recording_advice, unit, words, worst_deviations, wrap,
};
use crate::summary;
use noise_analysis::assessment::navigation::CALIBRATION_S;
use noise_analysis::assessment::{Assessment, Coefficient, NavigationDrift};
use noise_analysis::report::{ChannelReport, Parameter, Report, TermReport};
use std::collections::BTreeMap;
use std::io::{self, Write};

/// Columns of the longest line.
const WIDTH: u16 = 100;

/// Writes the whole report, with the name of the recording if it has one.
///
/// # Errors
/// `out` cannot be written.
pub fn write(report: &Report, source: Option<&str>, out: &mut impl Write) -> io::Result<()> {
    let part = if report.part.name.is_empty() { "Sensor" } else { &report.part.name };
    let title = format!("{part} noise report");
    match source {
        Some(source) => writeln!(out, "{title}   {source}")?,
        None => writeln!(out, "{title}")?,
    }
    writeln!(out, "{}", "═".repeat(title.chars().count()))?;
    writeln!(out, "sample rate  {} Hz", number(report.sample_rate_hz))?;
    let length = duration(report.samples as f64 / report.sample_rate_hz);
    writeln!(out, "samples      {} used, {length}", count(report.samples))?;
    writeln!(out, "dropped      {}", by_cause(&report.dropped))?;
    writeln!(out, "flagged      {}", by_cause(&report.flagged))?;
    verdict(report, out)?;
    for channel in &report.channels {
        section(channel, out)?;
    }
    writeln!(out)?;
    writeln!(out, "Intervals are of 95 %. The models are fitted to the first half of the samples; the second")?;
    writeln!(out, "half is unseen. deviance: mean edf·(ln(m/v) + v/m − 1), about 1 for a true model;")?;
    writeln!(out, "rms: 100·√(mean (½ ln(v/m))²) %; v measured, m modelled Allan variance, n ≤ M/8.")?;
    writeln!(out, "worst σ: largest deviation of a point over all τ; beyond ±4 it is told in words.")?;
    writeln!(out, "first half's curve: the measured curve taken for a model; what the second half does not repeat.")?;
    if report.channels.iter().any(summary::is_fitted_to_later_quarter) {
        writeln!(
            out,
            "later quarter: the model is fitted to the later quarter of the first half, as the noise changes."
        )?;
    }
    writeln!(out, "by PSD: σ(τ) by equation (5), from the measured spectrum instead of differences of means.")?;
    if report.channels.iter().any(|channel| channel.after.unseen_excluding.is_some()) {
        writeln!(out, "excluding: without what the first half's rules for spikes and knocks find in the unseen half.")?;
    }
    writeln!(
        out,
        "error after t: rms of the integral over t when the bias is the mean of the {CALIBRATION_S} s before."
    )
}

/// Everything that the one screen tells, without its limits.
fn verdict(report: &Report, out: &mut impl Write) -> io::Result<()> {
    let paragraph = |out: &mut dyn Write, text: &str| writeln!(out, "{}", wrap(text, WIDTH.into()));
    writeln!(out)?;
    for sentence in summary::record_sentences(report).into_iter().chain(summary::part_note(report)) {
        paragraph(out, &sentence)?;
    }
    let (found, _) = summary::findings(report);
    writeln!(out, "\nWhat was found")?;
    for (index, finding) in found.iter().enumerate() {
        let FindingText { channels, physics, advice, weight, .. } = finding;
        let weight = if weight.is_empty() { String::new() } else { format!(" {}.", capital(weight)) };
        paragraph(out, &format!("{}. {channels}: {physics}{weight} {advice}", index + 1))?;
    }
    if let Some(text) = summary::unexplained(report) {
        paragraph(out, &format!("Not explained: {text}."))?;
    }
    if found.is_empty() {
        writeln!(out, "No cause beyond N, B and K.")?;
    }
    let contradictions = summary::contradictions(report);
    if !contradictions.is_empty() {
        writeln!(out, "\nWhat the data contradicts")?;
        contradictions.iter().try_for_each(|text| paragraph(out, &format!("{text}.")))?;
    }
    Ok(())
}

/// Numbers of samples by cause, as a list.
fn by_cause(counts: &BTreeMap<String, u64>) -> String {
    if counts.values().all(|&samples| samples == 0) {
        return "none".to_owned();
    }
    let causes = counts.iter().filter(|(_, samples)| **samples > 0);
    let listed: Vec<String> = causes.map(|(cause, samples)| format!("{} {}", words(cause), count(*samples))).collect();
    listed.join(", ")
}

fn section(channel: &ChannelReport, out: &mut impl Write) -> io::Result<()> {
    let name = format!("{} · {}", channel.name, unit(&channel.unit));
    let samples = format!("{} samples", count(channel.samples));
    let used = name.chars().count() + samples.chars().count() + 6;
    let rule = "─".repeat(usize::from(WIDTH).saturating_sub(used));
    writeln!(out, "\n── {name} {rule} {samples}\n")?;
    let missing = missing_samples(&channel.missing);
    if !missing.is_empty() {
        writeln!(out, "{}\n", wrap(&format!("Missing: {missing}."), WIDTH.into()))?;
    }

    writeln!(out, "{}", coefficient_table(channel))?;
    let same = channel.after == channel.before;
    if !same {
        writeln!(out, "{}", term_table(&channel.after.terms))?;
    }
    writeln!(out, "{}", error_table(channel))?;
    for text in worst_deviations(channel) {
        writeln!(out, "{}", wrap(&format!("! {text}."), WIDTH.into()))?;
    }
    for effect in &channel.effects {
        writeln!(
            out,
            "{}",
            wrap(&format!("• {}: {}", words(&effect.kind), printed_evidence(&effect.evidence)), WIDTH.into())
        )?;
    }
    for text in explanation::course(channel) {
        writeln!(out, "{}", wrap(&format!("• {text}"), WIDTH.into()))?;
    }
    if same && channel.effects.is_empty() {
        writeln!(out, "No effect was added to the baseline model: after equals before.")?;
    }
    write_assessment(&channel.assessment, out)?;
    if channel.curve.is_empty() {
        return writeln!(out, "The record is too short for a point of the curve.");
    }
    writeln!(out, "{}", curve_table(channel))
}

/// A table whose first `left` columns are text and the others numbers.
fn table(header: &[&str], left: usize, rows: impl IntoIterator<Item = Vec<String>>) -> TextTable {
    TextTable::new(header.iter().copied(), left, rows).within(WIDTH)
}

fn coefficient_table(channel: &ChannelReport) -> TextTable {
    let header = ["coefficient", "unit", "by slope", "slope found, s", "fit", "95 % interval"];
    let row = |row: CoefficientRow<'_>| {
        let (by_slope, found) = match (row.slope_value, row.slope) {
            (Some(value), _) => (number(value.value), interval(value.from_s, value.to_s)),
            (None, "") => (NONE.to_owned(), NONE.to_owned()),
            (None, _) => (NONE.to_owned(), "no such slope".to_owned()),
        };
        let [fit, bounds] = fitted(row.fit);
        vec![words(row.kind), unit(row.unit), by_slope, found, fit, bounds]
    };
    table(&header, 2, coefficients::rows(channel).into_iter().map(row))
}

/// Estimate and interval.
fn fitted(parameter: Option<&Parameter>) -> [String; 2] {
    match parameter {
        Some(p) => [number(p.value), interval(p.low, p.high)],
        None => [NONE.to_owned(), NONE.to_owned()],
    }
}

fn term_table(terms: &[TermReport]) -> TextTable {
    let rows = terms.iter().flat_map(|term| {
        term.parameters.iter().map(|(name, parameter)| {
            let [fit, bounds] = fitted(Some(parameter));
            vec![words(&term.kind), parameter_name(name), unit(&parameter.unit), fit, bounds]
        })
    });
    let header = ["with the effects", "parameter", "unit", "fit", "95 % interval"];
    table(&header, 3, rows)
}

fn error_table(channel: &ChannelReport) -> TextTable {
    let after = if summary::is_fitted_to_later_quarter(channel) { "after, later quarter" } else { "after" };
    let models = [("before", &channel.before), (after, &channel.after)].into_iter().flat_map(|(name, model)| {
        let all = vec![
            name.to_owned(),
            percent(model.fitted.rms_percent),
            percent(model.unseen.rms_percent),
            optional(model.fitted.deviance_per_point),
            optional(model.unseen.deviance_per_point),
            optional(model.fitted.worst_sigma),
            optional(model.unseen.worst_sigma),
        ];
        let excluding = model.unseen_excluding.as_ref().map(|error| {
            vec![
                format!("{name}, excluding"),
                String::new(),
                percent(error.rms_percent),
                String::new(),
                optional(error.deviance_per_point),
                String::new(),
                optional(error.worst_sigma),
            ]
        });
        [Some(all), excluding].into_iter().flatten()
    });
    let own = &channel.first_half_curve;
    let own_curve = vec![
        "first half's curve".to_owned(),
        String::new(),
        percent(own.rms_percent),
        String::new(),
        optional(own.deviance_per_point),
        String::new(),
        optional(own.worst_sigma),
    ];
    let rows = models.chain([own_curve]);
    let header = ["model error", "rms fitted", "unseen", "deviance fitted", "unseen", "worst σ fitted", "unseen"];
    table(&header, 1, rows)
}

fn curve_table(channel: &ChannelReport) -> TextTable {
    let same = channel.after == channel.before;
    let mut header = vec!["n", "τ, s", "σ(τ)", "low", "high", "edf", "accuracy, %", "by PSD"];
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
            optional(point.adev_by_spectrum),
            optional(channel.before.adev.get(index).copied()),
        ];
        if !same {
            row.push(optional(channel.after.adev.get(index).copied()));
        }
        row
    });
    table(&header, 0, rows)
}

/// What the model is good for: other units, drift, a filter's innovations, longer records.
fn write_assessment(assessment: &Assessment, out: &mut impl Write) -> io::Result<()> {
    if !assessment.coefficients.is_empty() {
        writeln!(out, "{}", unit_table(&assessment.coefficients))?;
    }
    if !assessment.drift.is_empty() {
        writeln!(out, "{}", drift_table(&assessment.drift))?;
    }
    if let Some(innovations) = &assessment.innovations {
        let text = format!(
            "• Kalman filter of the model on the unseen half: {} innovations, {} of the expected variance ({} for a true \
             model), whiteness p = {}: {}.",
            innovations.count,
            number(innovations.normalised),
            interval(innovations.low, innovations.high),
            number(innovations.whiteness_p),
            filter_consistency(innovations)
        );
        writeln!(out, "{}", wrap(&text, WIDTH.into()))?;
    }
    let by_spectrum = assessment
        .angle_random_walk_by_spectrum
        .as_ref()
        .map(|n| format!("{} {} ({})", number(n.value), unit(&n.unit), interval(n.low, n.high)));
    let told = match (by_spectrum, &assessment.angle_random_walk_by_spectrum_note) {
        (Some(value), Some(note)) => Some(format!("{value}; {note}")),
        (Some(value), None) => Some(value),
        (None, Some(note)) => Some(format!("none, {note}")),
        (None, None) => None,
    };
    if let Some(told) = told {
        writeln!(out, "{}", wrap(&format!("• N by the spectrum: {told}."), WIDTH.into()))?;
    }
    if let Some(time) = &assessment.markov_time_by_autocorrelation {
        let value = format!("{} {}", number(time.value), unit(&time.unit));
        writeln!(out, "• Markov time by the autocorrelation: {value} ({}).", interval(time.low, time.high))?;
    }
    assessment.record.iter().try_for_each(|record| writeln!(out, "• {}.", recording_advice(record)))
}

fn unit_table(coefficients: &[Coefficient]) -> TextTable {
    let row = |coefficient: &Coefficient| {
        let value = &coefficient.value;
        let sense = if coefficient.discrete { "discrete, of samples" } else { "continuous" };
        let kind = words(&coefficient.kind);
        vec![kind, sense.to_owned(), unit(&value.unit), number(value.value), interval(value.low, value.high)]
    };
    let header = ["in other units", "", "unit", "value", "95 % interval"];
    table(&header, 3, coefficients.iter().map(row))
}

fn drift_table(drifts: &[NavigationDrift]) -> TextTable {
    let row = |drift: &NavigationDrift| {
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
    table(&header, 1, drifts.iter().map(row))
}
