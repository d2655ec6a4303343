//! The contents of a recording as HTML: the table of `imunoise inspect`, and for each sensor a form with the proposal.

use crate::analysis::Recorded;
use anyhow::Result;
use maud::{Markup, html};
use measurement::profile_file;
use recordings::file_format::{RecordedFormat, TopicDescription};
use recordings::inspection::{ColumnGuess, InspectedColumn, InspectedTable, Proposal};
use recordings::time_base::TimeRange;
use reports::rounding::{compact, plain};
use reports::summary::time_options;

/// Most columns of a table, and most topics, that are shown.
const MOST_COLUMNS: usize = 64;
const MOST_TOPICS: usize = 32;
/// Number of columns of a table above which constant columns are not shown.
const WIDE: usize = 16;

/// Makes a table for each topic, and a form for each sensor.
pub(crate) fn html(recorded: &Recorded<'_>) -> Result<String> {
    let input = recorded.open()?;
    let is_bus_log = matches!(input.format(), RecordedFormat::FrameLog | RecordedFormat::SpiExport);
    let tables = if is_bus_log { Vec::new() } else { input.inspect(None, &recorded.selection()?)? };
    let is_read = |name: &str| tables.iter().any(|table| table.topic == name);
    let others = if is_bus_log || is_read("") { Vec::new() } else { input.contents()? };
    let others: Vec<TopicDescription> = others.into_iter().filter(|of| !is_read(&of.name)).collect();
    let several = if is_bus_log { Vec::new() } else { input.sensors()? };
    // Register counts in the program's own format need no options.
    let is_known =
        matches!(input.format(), RecordedFormat::CountTable | RecordedFormat::FrameLog | RecordedFormat::SpiExport);
    let proposals: Vec<&Proposal> = tables.iter().flat_map(|table| &table.proposals).filter(|_| !is_known).collect();
    // If the file has one sensor that the format identifies, the form needs no topic.
    let needs_topic = |proposal: &Proposal| proposals.len() != 1 || !several.is_empty() || !proposal.is_found;
    let nothing = Proposal { is_found: is_known, ..Proposal::default() };
    let unknown = Some(&nothing).filter(|_| proposals.is_empty());
    let markup = html! {
        p.faint { (input.format().name()) }
        @for table in &tables { (columns(table)) }
        @if !others.is_empty() {
            p.faint { "Other topics: " @for of in others.iter().take(MOST_TOPICS) { (of.name) " (" (of.kind) ") " }
                @if others.len() > MOST_TOPICS { "and " (others.len() - MOST_TOPICS) " more" } }
        }
        @if unknown.is_some() && !is_known {
            p.warning { "No column is known to be one of an inertial sensor: name the columns and their units." }
        }
        @for proposal in proposals.iter().copied().chain(unknown) { (form(proposal, needs_topic(proposal))) }
    };
    Ok(markup.into_string())
}

/// Rows, rate and gaps of a table, and a row for each column.
fn columns(table: &InspectedTable) -> Markup {
    let InspectedTable { topic, kind, rows, is_cut, columns, rate, stated_rate_hz, duration_s, missing, gaps, .. } =
        table;
    // A wide table usually has messages with covariances, which are constant.
    let is_constant = |column: &InspectedColumn| {
        columns.len() > WIDE && column.noise == 0.0 && column.guess.is_none() && !column.mean.is_nan()
    };
    let shown: Vec<&InspectedColumn> = columns.iter().filter(|column| !is_constant(column)).collect();
    html! {
        @if !topic.is_empty() || !kind.is_empty() { h3 { (topic) " " small { (kind) } } }
        p {
            @if *is_cut { "the first " } (rows) " rows"
            @if let Some(rate) = rate { " at " (plain(rate.hz, 7)) " Hz" }
            @if let Some(hz) = stated_rate_hz { ", " (hz) " Hz by the file" }
            @if let Some(duration) = duration_s { " in " (format!("{duration:.2}")) " s" }
            @if table.has("time") || table.has("sample") {
                @if *missing == 0 { "; no sample missing" } @else { "; " (missing) " samples missing in " (gaps) " gaps" }
            } @else { "; no time stamps" }
            "." (steady(table))
        }
        div.scroll {
            table {
                thead { tr { @for name in ["column", "taken for", "unit", "first values", "mean", "noise", "step"] {
                    th scope="col" { (name) } } } }
                tbody { @for column in shown.iter().take(MOST_COLUMNS) { (row(column)) } }
            }
        }
        @if shown.len() > MOST_COLUMNS { p.faint { "… and " (shown.len() - MOST_COLUMNS) " columns more" } }
        @if shown.len() < columns.len() { p.faint { (columns.len() - shown.len()) " columns never change" } }
        @for note in &table.notes { p.faint { (note.to_string()) "." } }
    }
}

fn steady(table: &InspectedTable) -> String {
    let Some(steady) = &table.steady else { return String::new() };
    let what = if steady.is_rest { "at rest" } else { "steady" };
    match (steady.rows.len(), table.steady_s) {
        (0, _) => format!(" Never {what}."),
        (length, _) if length == table.rows => {
            format!(" {} all the time.", if steady.is_rest { "At rest" } else { "Steady" })
        }
        (_, Some(TimeRange { from_s, to_s })) => format!(" Longest part {what}: {}, in s.", time_options(from_s, to_s)),
        (_, None) => format!(" Longest part {what}: rows {} to {}.", steady.rows.start + 1, steady.rows.end),
    }
}

fn row(column: &InspectedColumn) -> Markup {
    let InspectedColumn { name, unit, first, mean, noise, step, guess } = column;
    let is_number = !mean.is_nan();
    html! {
        tr {
            th scope="row" { (name) }
            td { @if let Some(ColumnGuess { channel, unit, reason }) = guess {
                (channel) @if let Some(unit) = unit { " in " (unit) }
                @if !reason.is_empty() { span.under { (reason) } }
            } }
            td { (unit.unwrap_or("")) }
            td { @if is_number { @for value in first { (compact(*value, 6)) " " } } @else { "no numbers" } }
            td.number { @if is_number { (compact(*mean, 6)) } }
            td.number { @if is_number { (compact(*noise, 3)) } }
            td.number { @if let Some(step) = step { (compact(*step, 6)) } }
        }
    }
}

/// A form with the options for a sensor, to be confirmed or changed.
fn form(proposal: &Proposal, needs_topic: bool) -> Markup {
    let Proposal { topic, columns, units, part, lacks_rate, is_guessed, sensor, doubts, .. } = proposal;
    let part = part.map(TimeRange::whole_tenths);
    let time = |of: fn(TimeRange) -> f64| part.map(|part| of(part).to_string());
    let input = |name: &str, label: &str, value: Option<String>, hint: &str| {
        html! { label { (label) input name=(name) value=[value] placeholder=(hint) autocomplete="off" spellcheck="false"; } }
    };
    html! {
        form.proposal {
            @for doubt in doubts { p.warning { "In doubt: " (doubt) "." } }
            @if *lacks_rate { p.warning { "The file has no rate: state it." } }
            @if *is_guessed { p { "The file does not say all of this; please confirm it." } }
            details open[*is_guessed || *lacks_rate || columns.is_empty() && proposal.topic.is_none() && !proposal.is_found] {
                summary { "How it is read" }
                div.fields {
                    (input("topic", "topic", topic.clone().filter(|_| needs_topic), "of a file with several"))
                    (input("columns", "columns", Some(columns.join(",")), "gyro_x=wx,time=t"))
                    (input("units", "units", Some(units.join(",")), "deg/s,g,us"))
                    (input("rate", "rate, Hz", None, "by the time stamps"))
                    (input("from", "from, s", time(|part| part.from_s), "the beginning"))
                    (input("to", "to, s", time(|part| part.to_s), "the end"))
                    label { "sensor" select name="sensor" {
                        option value="" { "by the file" }
                        @for name in profile_file::sensor_names() { option selected[*sensor == Some(name)] { (name) } }
                    } }
                    label { "range of an ADIS16405, °/s" select name="range" {
                        @for (value, text) in [("", "300"), ("150", "150"), ("75", "75")] { option value=(value) { (text) } }
                    } }
                }
            }
            button.main type="submit" { "Analyse" @if needs_topic { @if let Some(topic) = topic { " " (topic) } } }
        }
    }
}
