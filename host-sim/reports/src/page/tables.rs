//! The tables of the page.

use crate::coefficients::LETTERS;
use crate::report_tables::ReportTable;
use crate::summary::{self, CoefficientTable};
use maud::{Markup, html};
use noise_analysis::report::Report;

/// Heading, and whether the column has numbers.
type Heading = (Markup, bool);

fn cells(headings: &[Heading]) -> Markup {
    html! {
        @for (heading, numeric) in headings { th class=[numeric.then_some("number")] scope="col" { (heading) } }
    }
}

fn table(headings: &[Heading], rows: &Markup) -> Markup {
    html! {
        div.scroll {
            table {
                thead { tr { (cells(headings)) } }
                tbody { (rows) }
            }
        }
    }
}

/// Each row begins with its heading if it begins with text.
pub(super) fn laid_out(ReportTable { headings, rows, text_columns }: &ReportTable) -> Markup {
    let is_number = |column: usize| column >= *text_columns;
    let headings = headings.iter().enumerate().map(|(column, heading)| (html! { (heading) }, is_number(column)));
    let rows = html! {
        @for row in rows { tr { @for (column, value) in row.iter().enumerate() {
            @if column == 0 && *text_columns > 0 { th scope="row" { (value) } }
            @else { td class=[is_number(column).then_some("number")] { (value) } }
        } } }
    };
    table(&headings.collect::<Vec<Heading>>(), &rows)
}

pub(super) fn coefficients_of_all(report: &Report) -> Markup {
    coefficients(&summary::coefficient_tables(report), true)
}

/// N, B and K of groups of channels, each with a link to its section if it has one.
pub(super) fn coefficients(groups: &[CoefficientTable], has_sections: bool) -> Markup {
    // An accelerometer's random walks have other names.
    let headings = |group: &CoefficientTable| {
        let columns = group.names.iter().zip(LETTERS).zip(&group.units);
        let columns = columns.map(|((name, letter), unit)| {
            (html! { span.letter { (letter) } ", " (unit) " " span.under { (name) } }, true)
        });
        let error = (html! { "σ off by " span.under { "unseen half" } }, true);
        [(html! { (group.title) }, false)].into_iter().chain(columns).chain([error]).collect::<Vec<Heading>>()
    };
    let rows = html! {
        @for (number, group) in groups.iter().enumerate() {
            @if number > 0 { tr.group { (cells(&headings(group))) } }
            @for row in &group.rows {
                tr class=[row.channel.is_empty().then_some("sheet")] {
                    th scope="row" {
                        @if row.channel.is_empty() { "sheet" }
                        @else if has_sections { a href={ "#" (row.channel) } { (row.label) } }
                        @else { (row.label) }
                    }
                    @for value in &row.coefficients { td.number { (broken_before_interval(value)) } }
                    td class={ "number" @if row.is_high { " warning" } } {
                        (row.error.replace(' ', "\u{a0}").replace("\u{a0}→", " →")) @if row.is_high { "\u{a0}!" }
                    }
                }
            }
        }
    };
    html! { @if let Some(first) = groups.first() { (table(&headings(first), &rows)) } }
}

/// Breaks only before the interval and before its upper bound: `2.424 ± 0.005`.
fn broken_before_interval(value: &str) -> String {
    value.replacen(' ', "\n", 1).replace(' ', "\u{a0}").replace("…\u{a0}", "… ")
}
