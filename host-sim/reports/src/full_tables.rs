//! Every table of a report as text of at most 100 columns.

use crate::coefficient_notes::coefficient_notes;
use crate::coefficients::KINDS;
use crate::evidence;
use crate::explanation;
use crate::finding_text::FindingText;
use crate::formatting::{
    by_cause, count, duration, filter_consistency, interval, missing_samples, number, recording_advice, words,
    worst_deviations, wrap,
};
use crate::report_tables::{self, ReportTable};
use crate::rounding::{NONE, Scale, p_value, parameter_magnitude, quantity_digits, unit};
use crate::summary;
use comfy_table::{CellAlignment, ContentArrangement, Table, modifiers, presets};
use noise_analysis::report::assessment::Assessment;
use noise_analysis::report::assessment::navigation::CALIBRATION_S;
use noise_analysis::report::{
    ChannelEffect, ChannelReport, Parameter, Report, SlopeMethodReport, SlopeMethodValue, TermReport,
};
use std::io::{self, Write};

const WIDTH: u16 = 100;

pub fn write(report: &Report, source: Option<&str>, out: &mut impl Write) -> io::Result<()> {
    let title = format!("{} noise report", summary::part_name(report));
    writeln!(out, "{title}{}", source.map_or_else(String::new, |source| format!("   {source}")))?;
    writeln!(out, "{}", "═".repeat(title.chars().count()))?;
    writeln!(out, "sample rate  {}", quantity_digits(report.sample_rate_hz, "Hz", 4))?;
    let length = duration(report.samples as f64 / report.sample_rate_hz);
    writeln!(out, "samples      {} used, {length}", count(report.samples))?;
    for (title, counts) in [("dropped", &report.dropped), ("flagged", &report.flagged)] {
        let counts = Some(by_cause(counts)).filter(|counts| !counts.is_empty());
        writeln!(out, "{title}      {}", counts.unwrap_or_else(|| "none".to_owned()))?;
    }
    verdict(report, out)?;
    for channel in &report.channels {
        section(channel, out)?;
    }
    let together = explanation::all_channels(report);
    if !together.is_empty() {
        writeln!(out, "\nAll channels")?;
    }
    for text in together {
        writeln!(out, "{}", wrap(&format!("• {text}"), WIDTH.into()))?;
    }
    let any = |is_so: fn(&ChannelReport) -> bool| report.channels.iter().any(is_so);
    let error_after =
        format!("error after t: rms of the integral over t when the bias is the mean of the {CALIBRATION_S} s before.");
    let notes = [
        (true, NOTES),
        (any(summary::is_fitted_to_later_quarter), LATER_QUARTER),
        (true, "by PSD: σ(τ) by equation (5), from the measured spectrum instead of differences of means."),
        (any(|channel| channel.after.unseen_excluding.is_some()), EXCLUDING),
        (true, error_after.as_str()),
    ];
    writeln!(out)?;
    notes.iter().filter(|(is_told, _)| *is_told).try_for_each(|(_, note)| writeln!(out, "{note}"))
}

const NOTES: &str = "\
Intervals are of 95 %. The models are fitted to the first half of the samples; the second
half is unseen. deviance: mean edf·(ln(m/v) + v/m − 1), about 1 for a true model;
rms: 100·√(mean (½ ln(v/m))²) %; v measured, m modelled Allan variance, n ≤ M/8.
worst σ: largest deviation of a point over all τ; beyond ±4 it is told in words.
first half's curve: the measured curve taken for a model; what the second half does not repeat.";
const LATER_QUARTER: &str =
    "later quarter: the model is fitted to the later quarter of the first half, as the noise changes.";
const EXCLUDING: &str = "\
excluding: without what the first half's rules for spikes and knocks find in the unseen half; the
models after foretell these in the unseen half as recorded, at the rate of the first half.";

fn verdict(report: &Report, out: &mut impl Write) -> io::Result<()> {
    let paragraph = |out: &mut dyn Write, text: &str| writeln!(out, "{}", wrap(text, WIDTH.into()));
    writeln!(out)?;
    let notes = summary::part_notes(report).into_iter().chain(coefficient_notes(report));
    for sentence in summary::record_sentences(report).into_iter().chain(notes) {
        paragraph(out, &sentence)?;
    }
    let conditions = summary::conditions(report);
    if !conditions.is_empty() {
        paragraph(out, &format!("Conditions: {}.", conditions.join("; ")))?;
    }
    let (found, _) = summary::findings(report);
    writeln!(out, "\nWhat was found")?;
    for (index, finding) in found.iter().enumerate() {
        let FindingText { channels, advice, .. } = finding;
        paragraph(out, &format!("{}. {channels}: {} {advice}", index + 1, finding.sentences()))?;
    }
    for text in summary::unexplained(report) {
        paragraph(out, &format!("Not explained: {text}."))?;
    }
    if found.is_empty() {
        writeln!(out, "No cause beyond N, B and K.")?;
    }
    let contradictions = summary::contradictions(report);
    if !contradictions.is_empty() {
        writeln!(out, "\nWhere data and model disagree")?;
        contradictions.iter().try_for_each(|text| paragraph(out, &format!("{text}.")))?;
    }
    Ok(())
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

    writeln!(out, "{}", framed(coefficients(channel)))?;
    let same = channel.after == channel.before;
    if !same {
        writeln!(out, "{}", framed(report_tables::terms("with the effects", &channel.after.terms)))?;
    }
    writeln!(out, "{}", framed(report_tables::errors(channel)))?;
    if channel.after.unseen.rms_percent.is_some() {
        writeln!(out, "{}", wrap(&explanation::model(channel), WIDTH.into()))?;
    }
    for text in worst_deviations(channel) {
        writeln!(out, "{}", wrap(&format!("! {text}."), WIDTH.into()))?;
    }
    for ChannelEffect { effect, .. } in &channel.effects {
        let evidence = evidence::of_effect(effect);
        writeln!(out, "{}", wrap(&format!("• {}: {evidence}", words(effect.name())), WIDTH.into()))?;
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
    writeln!(out, "{}", framed(report_tables::curve(channel)))
}

fn framed(ReportTable { headings, rows, text_columns }: ReportTable) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::UTF8_FULL_CONDENSED).apply_modifier(modifiers::UTF8_ROUND_CORNERS);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH);
    table.set_header(headings).add_rows(rows);
    for column in table.column_iter_mut().skip(text_columns) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// N, B and K by the slope method and by the fit.
fn coefficients(channel: &ChannelReport) -> ReportTable {
    let SlopeMethodReport { angle_random_walk, bias_instability, rate_random_walk } = &channel.read_off;
    let terms = &channel.before.terms;
    let classical = KINDS.into_iter().zip([angle_random_walk, bias_instability, rate_random_walk]);
    let classical = classical.map(|(kind, slope)| {
        let fit = terms.iter().find(|term| term.kind() == kind).map(TermReport::coefficient);
        (kind, slope.as_ref(), "no such slope", fit)
    });
    let others = terms.iter().filter(|term| !KINDS.contains(&term.kind()));
    let others =
        others.flat_map(|term| term.parameters().into_values().map(move |of| (term.kind(), None, NONE, Some(of))));
    let row = |(kind, slope, absent, fit): (&str, Option<&SlopeMethodValue>, &str, Option<Parameter>)| {
        let unit = slope.map(|of| &of.unit).or(fit.as_ref().map(|of| &of.unit)).map_or("", String::as_str);
        let shown = slope.map(|of| of.value).into_iter().chain(fit.as_ref().map(parameter_magnitude));
        let scale = Scale::new(shown, unit);
        let [by_slope, found] = slope.map_or_else(
            || [NONE, absent].map(str::to_owned),
            |of| [scale.number(of.value, 3), interval(of.from_s, of.to_s)],
        );
        let fit = fit.map_or_else(|| NONE.to_owned(), |fit| scale.estimate(&fit));
        vec![words(kind), scale.unit, by_slope, found, fit]
    };
    let headings = ["coefficient", "unit", "by slope", "slope found, s", "fit, 95 % interval"];
    ReportTable::new(&headings, 2, classical.chain(others).map(row))
}

fn write_assessment(assessment: &Assessment, out: &mut impl Write) -> io::Result<()> {
    if !assessment.coefficients.is_empty() {
        writeln!(out, "{}", framed(report_tables::units(&assessment.coefficients)))?;
    }
    if !assessment.drift.is_empty() {
        writeln!(out, "{}", framed(report_tables::drift(&assessment.drift)))?;
    }
    if let Some(innovations) = &assessment.innovations {
        let text = format!(
            "• Kalman filter of the model on the unseen half: {} innovations, {} of the expected variance ({} for a true \
             model), whiteness {}: {}.",
            innovations.count,
            number(innovations.normalised),
            interval(innovations.low, innovations.high),
            p_value(innovations.whiteness_p),
            filter_consistency(innovations)
        );
        writeln!(out, "{}", wrap(&text, WIDTH.into()))?;
    }
    assessment.record.iter().try_for_each(|record| writeln!(out, "• {}.", recording_advice(record)))
}
