//! The report as one HTML file without requests, reproducible byte by byte.

mod tables;

use crate::coefficient_notes::coefficient_notes;
use crate::evidence;
use crate::explanation;
use crate::figure::{self, Plot};
use crate::finding_text::{self, SENSED, ShownEffect, channel_list, channel_name};
use crate::formatting::{
    capital, count, filter_consistency, interval, missing_samples, number, parameter_name, recording_advice, words,
    worst_deviations,
};
use crate::live::LiveView;
use crate::reading::ReadingRecord;
use crate::report_tables;
use crate::rounding::{bounded_quantity, p_value, unit};
use crate::summary;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use noise_analysis::report::assessment::Assessment;
use noise_analysis::report::{ChannelReport, Finding, Report};

pub const STYLE: &str = include_str!("page/style.css");
/// The script of the page, as it stands in its element.
pub const SCRIPT: &str = include_str!("page/script.js");
const DEFINITIONS: &str = include_str!("page/definitions.html");
/// Only the file itself; a figure saved as PNG is an image of its text.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:";

/// The report on the recording `source` as a page, with the record of the reading.
pub fn html(report: &Report, source: Option<&str>, reading: Option<&ReadingRecord>) -> String {
    render(report, source, reading, Extent::Whole).into_string()
}

pub fn first_screen(report: &Report, source: Option<&str>, reading: Option<&ReadingRecord>) -> String {
    render(report, source, reading, Extent::FirstScreen).into_string()
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Extent {
    Whole,
    FirstScreen,
}

/// A growing record as a part of a page: verdict, curves, findings and health, as on a terminal's screen.
pub fn live(view: &LiveView) -> String {
    let LiveView { headline, sentences, tables, curves, findings, unexplained, advice, health, status } = view;
    html! {
        h3 { (headline) }
        p { (sentences) }
        (tables::coefficients(tables, false))
        div.curves {
            @for plot in ["gyro_", "accl_"].iter().filter_map(|prefix| figure::live(curves, prefix)) {
                figure id=(plot.id) { figcaption { (plot.title) } (plot.key()) div.drawing { (plot.drawing()) } }
            }
        }
        @if !findings.is_empty() {
            h3 { "What was found" }
            ol { @for text in findings { li { b { (text.channels) } ": " (text.physics) } } }
        }
        @for text in unexplained.iter().chain(advice) { p { (text) } }
        p.faint { (health) }
        p.faint { (status) }
    }
    .into_string()
}

pub fn figure_styles() -> [String; 2] {
    figure::style()
}

fn render(report: &Report, source: Option<&str>, reading: Option<&ReadingRecord>, extent: Extent) -> Markup {
    let is_whole = extent == Extent::Whole;
    let [light, dark] = figure::style();
    let (title, headline) = {
        let headline = summary::headline(report, source);
        (format!("{} noise report", headline[0]), headline[1..].join(" · "))
    };
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) @if let Some(source) = source { " · " (source) } }
                style { (PreEscaped(STYLE)) }
                style id="figures" { (PreEscaped(light)) }
                style { "@media screen and (prefers-color-scheme: dark){" (PreEscaped(dark)) "}" }
            }
            body {
                @if is_whole { a.skip href="#findings" { "To the findings" } }
                header {
                    div { h1 { (title) } p.headline { (headline) } }
                    div id="save" {}
                }
                @if is_whole { (contents(report)) }
                main {
                    div.first {
                        (verdict(report, reading))
                        section.pictures aria-label="The two pictures that carry the answer" {
                            @if let Some(plot) = figure::story(report) { (drawing(&plot)) }
                            @if let Some(plot) = figure::strongest(report) { (drawing(&plot)) }
                        }
                    }
                    @if is_whole {
                        (findings(report))
                        (curves(report))
                        (channels(report))
                        (disagreements(report))
                        @if let Some(reading) = reading { (what_was_read(reading)) }
                        (PreEscaped(DEFINITIONS))
                    }
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    }
}

fn what_was_read(reading: &ReadingRecord) -> Markup {
    html! {
        section id="file" aria-label="What was read" {
            h2 { "What was read" }
            @for line in reading.lines() { p { (line) } }
        }
    }
}

fn in_reading_order(report: &Report) -> impl Iterator<Item = &ChannelReport> {
    let rank = |channel: &ChannelReport| {
        let known = SENSED.iter().position(|prefix| channel.name.starts_with(prefix));
        known.unwrap_or(SENSED.len())
    };
    let mut channels: Vec<&ChannelReport> = report.channels.iter().collect();
    channels.sort_by_key(|channel| rank(channel));
    channels.into_iter()
}

fn contents(report: &Report) -> Markup {
    html! {
        nav aria-label="Sections" {
            a href="#answer" { "Answer" }
            a href="#findings" { "Findings" }
            a href="#curves" { "Curves" }
            @for channel in in_reading_order(report) { a href={ "#" (channel.name) } { (channel_name(channel)) } }
            @if !summary::contradictions(report).is_empty() { a href="#disagreements" { "Model is off" } }
            a href="#reading" { "How to read this" }
        }
    }
}

fn verdict(report: &Report, reading: Option<&ReadingRecord>) -> Markup {
    let answer = summary::answer(report);
    html! {
        section.verdict id="answer" aria-label="Answer" {
            @if let Some(sentence) = reading.and_then(ReadingRecord::incomplete) { p.warning { strong { (sentence) } } }
            @if let Some((first, others)) = answer.split_first() {
                p { strong { (unparted(first)) } " " (unparted(&others.join(" "))) }
            }
            (tables::coefficients_of_all(report))
            (what_to_do(report))
            @let notes = [coefficient_notes(report), summary::record_in_detail(report), summary::part_notes(report)].concat();
            @let conditions = summary::conditions(report);
            @if !notes.is_empty() || !conditions.is_empty() {
                // Without a finding there is room for it.
                details open[report.findings.is_empty()] {
                    summary { "More about the record" }
                    @for text in notes { p { (unparted(&text)) } }
                    @if !conditions.is_empty() { p { "Conditions: " (conditions.join("; ")) "." } }
                }
            }
        }
    }
}

/// Keeps per cent signs beside their numbers.
fn unparted(text: &str) -> String {
    text.replace(" %", "\u{a0}%")
}

fn what_to_do(report: &Report) -> Markup {
    html! {
        @let (advice, for_filter) = (summary::advice(report), summary::for_filter(report));
        @if !advice.is_empty() || for_filter.is_some() {
            h3 { "What to do" }
            ul {
                @for (step, numbers) in advice { li {
                    (step.trim_end_matches('.')) " ("
                    @for (at, number) in numbers.iter().enumerate() {
                        @if at > 0 { ", " }
                        a href={ "#evidence-" (number) } { (number) }
                    }
                    ")."
                } }
                @if let Some(step) = for_filter { li { (step) } }
            }
        }
        @if let Some(text) = summary::unexplained_in_short(report) { p.warning { "Not explained: " (unparted(&text)) "." } }
        @if let Some(text) = summary::contradictions_in_short(report) {
            p.warning { a href="#disagreements" { "Model is off" } ": " (unparted(&text)) "." }
        }
    }
}

fn disagreements(report: &Report) -> Markup {
    let contradictions = summary::contradictions(report);
    html! {
        @if !contradictions.is_empty() {
            section id="disagreements" {
                h2 { "Where data and model disagree" }
                ul { @for text in &contradictions { li { (unparted(text)) "." } } }
            }
        }
    }
}

fn drawing(plot: &Plot) -> Markup {
    html! {
        figure id=(plot.id) tabindex="0" aria-label={ (plot.title) ". Arrow keys read the values." } {
            figcaption { (plot.title) }
            (plot.key())
            div.drawing { (plot.drawing()) }
            output aria-live="polite" { (plot.description) }
            script.values type="application/json" { (PreEscaped(plot.values())) }
        }
    }
}

fn findings(report: &Report) -> Markup {
    html! {
        section id="findings" {
            h2 { "What was found" }
            @if report.findings.is_empty() { p { (summary::nothing_found(report)) } }
            div.cards {
                @for (number, index) in (1..).zip(summary::finding_order(report)) { (finding_card(report, index, number)) }
            }
        }
    }
}

fn finding_card(report: &Report, index: usize, number: usize) -> Markup {
    let finding = &report.findings[index];
    let text = summary::finding_text(report, index);
    html! {
        article.finding id={ "evidence-" (number) } {
            h3 { (number) ". " (text.channels) ": " (words(finding.effect.name())) }
            p { (text.physics) }
            @if !text.weight.is_empty() { p { (capital(&text.weight)) "." } }
            p { (text.advice) }
            @if let Some(plot) = figure::evidence(report, index, number) { (drawing(&plot)) }
            details {
                summary { "Parameters and evidence" }
                (parameters(report, index))
                p { (capital(&evidence::of_finding(finding))) "." }
            }
        }
    }
}

fn parameters(report: &Report, index: usize) -> Markup {
    let shown = finding_text::shown_effects(report, index);
    html! {
        @for ShownEffect { channel, effect } in &shown {
            p.parameters {
                @if shown.len() > 1 { span { b { (channel_list([channel])) } } }
                @for (name, parameter) in &effect.parameters() {
                    span { (parameter_name(name)) " " b { (bounded_quantity(parameter)) } }
                }
            }
        }
    }
}

fn curves(report: &Report) -> Markup {
    let plots = figure::overviews(report);
    html! {
        section id="curves" {
            h2 { "Curves" }
            @if plots.is_empty() { p { "No gyro or accelerometer has a point of the curve." } }
            div.cards { @for plot in &plots { (drawing(plot)) } }
        }
    }
}

fn channels(report: &Report) -> Markup {
    html! {
        section.channels aria-label="Channels" {
            h2 { "Channels" }
            @for channel in in_reading_order(report) {
                details.channel {
                    summary {
                        strong { (channel_name(channel)) } " "
                        span.faint {
                            @if summary::is_sensed(channel) {
                                (summary::coefficients_in_short(report, &channel.name).into_iter()
                                    .filter(|text| text.contains(' ')).collect::<Vec<_>>().join(" · "))
                            } @else { (count(channel.samples)) " samples" }
                        }
                    }
                    div id=(channel.name) { (channel_section(report, channel)) }
                }
            }
        }
    }
}

/// A condition has its bias only.
fn channel_section(report: &Report, channel: &ChannelReport) -> Markup {
    let missing = missing_samples(&channel.missing);
    html! {
        p.faint { (unit(&channel.unit)) " · " (count(channel.samples)) " samples"
            @if !missing.is_empty() { " · missing: " (missing) } }
        @if !summary::is_sensed(channel) {
            @if let Some(plot) = figure::bias_plot(channel) { (drawing(&plot)) }
        } @else {
            @if channel.curve.is_empty() { p { "The record is too short for a point of the curve." } }
            div.cards { @for plot in figure::channel_plots(report, channel) { (drawing(&plot)) } }
            div.tables {
                div {
                    h3 { "Model, fitted to the whole record" }
                    (tables::laid_out(&report_tables::terms("term", &channel.refitted.terms)))
                }
                div {
                    h3 { "Error, before and after" }
                    (tables::laid_out(&report_tables::errors(channel)))
                    @let far = worst_deviations(channel);
                    @if !far.is_empty() { ul { @for text in &far { li.warning { (text) "." } } } }
                    @let own: Vec<(usize, &Finding)> = (1..).zip(summary::finding_order(report))
                        .map(|(number, index)| (number, &report.findings[index]))
                        .filter(|(_, finding)| finding.channels.contains(&channel.name)).collect();
                    @if own.is_empty() {
                        p.faint { "No finding concerns this channel." }
                    } @else {
                        p { "Findings: " @for (number, finding) in own {
                            a href={ "#evidence-" (number) } { (number) " " (words(finding.effect.name())) } " " } }
                    }
                }
            }
            @let course = explanation::course(channel);
            @if !course.is_empty() {
                h3 { "How the noise changes in the course of the record" }
                ul { @for text in &course { li { (text) } } }
            }
            h3 { "What the model is good for" }
            (assessment(&channel.assessment))
            h3 { "The curve in numbers" }
            (tables::laid_out(&report_tables::curve(channel)))
        }
    }
}

fn assessment(assessment: &Assessment) -> Markup {
    html! {
        @if !assessment.coefficients.is_empty() { (tables::laid_out(&report_tables::units(&assessment.coefficients))) }
        @if !assessment.drift.is_empty() { (tables::laid_out(&report_tables::drift(&assessment.drift))) }
        ul {
            @if let Some(innovations) = &assessment.innovations {
                li { b { "Kalman filter of the model" } ", unseen half: " (filter_consistency(innovations)) "."
                    span.parameter { (count(innovations.count as u64)) " innovations, " (number(innovations.normalised))
                        " of the expected variance (" (interval(innovations.low, innovations.high))
                        " for a true model), whiteness " (p_value(innovations.whiteness_p)) }
                }
            }
            @for record in &assessment.record { li { (unparted(&recording_advice(record))) } }
        }
    }
}
