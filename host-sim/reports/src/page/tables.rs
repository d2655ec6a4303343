//! The tables of the page.

use crate::coefficients::LETTERS;
use crate::curve_numbers::curve_numbers;
use crate::formatting::{duration, number, optional, parameter_name, percent, words};
use crate::rounding::{NONE, Scale, parameter_magnitude};
use crate::summary::{self, CoefficientTable};
use maud::{Markup, html};
use noise_analysis::report::assessment::{Coefficient, NavigationDrift};
use noise_analysis::report::{ChannelReport, ModelErrorReport, ModelReport, Report};

/// Heading, and whether the column has numbers.
type Heading = (Markup, bool);

fn text(heading: &str) -> Heading {
    (html! { (heading) }, false)
}

fn numbers(heading: &str) -> Heading {
    (html! { (heading) }, true)
}

fn cells(headings: &[Heading]) -> Markup {
    html! {
        @for (heading, numeric) in headings { th class=[numeric.then_some("number")] scope="col" { (heading) } }
    }
}

/// `rows` are `tr` elements.
fn table(class: &str, headings: &[Heading], rows: &Markup) -> Markup {
    html! {
        div.scroll {
            table class=[(!class.is_empty()).then_some(class)] {
                thead { tr { (cells(headings)) } }
                tbody { (rows) }
            }
        }
    }
}

/// In users' units, with data sheet and errors.
pub(super) fn coefficients_of_all(report: &Report) -> Markup {
    coefficients(&summary::coefficient_tables(report), true)
}

/// For groups of channels, each a link to its section where it has one.
pub(super) fn coefficients(groups: &[CoefficientTable], has_sections: bool) -> Markup {
    // An accelerometer's random walks have other names.
    let headings = |group: &CoefficientTable| {
        let columns = group.names.iter().zip(LETTERS).zip(&group.units);
        let columns = columns.map(|((name, letter), unit)| {
            (html! { span.letter { (letter) } ", " (unit) " " span.under { (name) } }, true)
        });
        let error = (html! { "σ off by " span.under { "unseen half" } }, true);
        [text(group.title)].into_iter().chain(columns).chain([error]).collect::<Vec<Heading>>()
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
                        (row.error.replace(' ', "\u{a0}")) @if row.is_high { "\u{a0}!" }
                    }
                }
            }
        }
    };
    html! { @if let Some(first) = groups.first() { (table("", &headings(first), &rows)) } }
}

/// Breaks only before the interval: `2.424 ± 0.005`.
fn broken_before_interval(value: &str) -> String {
    value.replacen(' ', "\n", 1).replace(' ', "\u{a0}")
}

pub(super) fn terms(model: &ModelReport) -> Markup {
    let rows = html! {
        @for term in &model.terms {
            @for (name, parameter) in &term.parameters() {
                @let scale = Scale::new([parameter_magnitude(parameter)], &parameter.unit);
                tr {
                    th scope="row" { (words(term.kind())) span.under { (parameter_name(name)) } }
                    td { (scale.unit) }
                    td.number { (scale.estimate(parameter)) }
                }
            }
        }
    };
    table("", &[text("term"), text("unit"), numbers("fit")], &rows)
}

pub(super) fn errors(channel: &ChannelReport) -> Markup {
    let cell = |error: &ModelErrorReport| {
        html! { td.number { (percent(error.rms_percent)) span.under { (optional(error.deviance_per_point)) }
        @if let Some(sigma) = error.worst_sigma { span.under { (number(sigma)) " σ" } } } }
    };
    let after =
        if summary::is_fitted_to_later_quarter(channel) { "after, fitted to the later quarter" } else { "after" };
    let rows = html! {
        @for (name, model) in [("before", &channel.before), (after, &channel.after)] {
            tr {
                th scope="row" { (name)
                    span.under { "rms, deviance a point, largest deviation" } }
                (cell(&model.fitted))
                (cell(&model.unseen))
            }
            @if let Some(error) = &model.unseen_excluding {
                tr {
                    th scope="row" { (name) ", excluding"
                        span.under { "without what the first half's rules for spikes and knocks find" } }
                    td {}
                    (cell(error))
                }
            }
        }
        tr {
            th scope="row" { "the first half's own curve"
                span.under { "taken for a model: what the second half does not repeat" } }
            td {}
            (cell(&channel.first_half_curve))
        }
    };
    table("", &[text("model"), numbers("fitted half"), numbers("unseen half")], &rows)
}

pub(super) fn units(coefficients: &[Coefficient]) -> Markup {
    let rows = html! {
        @for coefficient in coefficients {
            @let scale = Scale::new([parameter_magnitude(&coefficient.value)], &coefficient.value.unit);
            tr {
                th scope="row" { (words(&coefficient.kind)) }
                td { (scale.unit) }
                @for discrete in [false, true] {
                    td.number { @if coefficient.discrete == discrete { (scale.estimate(&coefficient.value)) } }
                }
            }
        }
    };
    table("", &[text("coefficient"), text("unit"), numbers("continuous"), numbers("discrete, of samples")], &rows)
}

pub(super) fn drift(drifts: &[NavigationDrift]) -> Markup {
    let rows = html! {
        @for drift in drifts {
            @let observed = drift.observed.as_ref();
            @let scale = Scale::new([drift.predicted].into_iter().chain(observed.map(parameter_magnitude)), &drift.unit);
            tr {
                th scope="row" { (duration(drift.seconds)) }
                td { (scale.unit) }
                td.number { (scale.number(drift.predicted, 3)) }
                td.number { (observed.map_or_else(|| NONE.to_owned(), |observed| scale.estimate(observed))) }
            }
        }
    };
    table("", &[text("error after"), text("unit"), numbers("predicted"), numbers("unseen half")], &rows)
}

pub(super) fn curve(channel: &ChannelReport) -> Markup {
    let (headings, rows) = curve_numbers(channel);
    let headings: Vec<Heading> = headings.iter().map(|heading| numbers(heading)).collect();
    let rows = html! {
        @for row in &rows { tr { @for value in row { td.number { (value) } } } }
    };
    table("curve", &headings, &rows)
}
