//! The parts of the page.

use super::practice::practice;
use crate::coefficients::{self, Row};
use crate::wording::{NONE, count, duration, interval, number, optional, parameter_name, percent, unit, words};
use maud::{Markup, PreEscaped, html};
use noise_analysis::report::{ChannelReport, ModelError, ModelReport, Parameter, Report};

/// The record in four numbers, and what was dropped.
pub(super) fn summary(report: &Report) -> Markup {
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

fn card(title: &str, figure: &str, note: &str) -> Markup {
    html! {
        div.card {
            h2 { (title) }
            p.figure { (figure) }
            @if !note.is_empty() { p.note { (note) } }
        }
    }
}

/// One row a channel: the fitted coefficients and the error on unseen data.
pub(super) fn overview(report: &Report) -> Markup {
    html! {
        section {
            h2 { "Overview" }
            div.scroll {
                table {
                    thead {
                        tr {
                            th scope="col" { "channel" }
                            @for (kind, symbol, _) in coefficients::RULES {
                                th.number scope="col" { (words(kind)) " " i { (symbol) } }
                            }
                            th.number scope="col" { "rms error, unseen half" }
                            th scope="col" { "effects traced" }
                        }
                    }
                    tbody {
                        @for channel in &report.channels {
                            tr {
                                th scope="row" { a href={ "#" (channel.name) } { (channel.name) } }
                                @for row in coefficients::rows(channel).iter().take(3) {
                                    td.number { (quantity(row.fit)) }
                                }
                                td.number { (percent(channel.after.unseen.rms_percent)) }
                                td { (effect_names(channel)) }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn effect_names(channel: &ChannelReport) -> String {
    if channel.effects.is_empty() {
        return "none".to_owned();
    }
    let names: Vec<String> = channel.effects.iter().map(|effect| words(&effect.kind)).collect();
    names.join(", ")
}

fn quantity(parameter: Option<&Parameter>) -> Markup {
    html! {
        @match parameter {
            Some(p) => { (number(p.value)) " " span.unit { (unit(&p.unit)) } }
            None => { (NONE) }
        }
    }
}

/// One channel with its picture and tables.
pub(super) fn channel(channel: &ChannelReport, picture: &str) -> Markup {
    let same = channel.after == channel.before;
    html! {
        section.channel id=(channel.name) {
            h2 { (channel.name) " " small { (unit(&channel.unit)) " · " (count(channel.samples)) " samples" } }
            figure role="img" aria-label={ "Allan deviation of " (channel.name) } { (PreEscaped(picture)) }
            div.tables {
                div {
                    h3 { "Coefficients" }
                    (coefficient_table(channel))
                    @if !same {
                        h3 { "Model with the traced effects" }
                        (term_table(&channel.after))
                    }
                }
                div {
                    h3 { "Model error" }
                    (error_table(channel))
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
                (practice(&channel.practice))
            }
            details {
                summary { "The curve in numbers (" (count(channel.curve.len() as u64)) " points)" }
                (curve_table(channel))
            }
        }
    }
}

fn coefficient_table(channel: &ChannelReport) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th scope="col" { "coefficient" }
                        th scope="col" { "unit" }
                        th.number.read-off scope="col" { "read off" }
                        th.number.fit scope="col" { "fit" }
                    }
                }
                tbody {
                    @for row in coefficients::rows(channel) {
                        tr {
                            th scope="row" {
                                (words(row.kind)) " " i { (row.symbol) }
                                @if !row.rule.is_empty() { span.under { (row.rule) } }
                            }
                            td { (unit(row.unit)) }
                            (read_off_cell(&row))
                            td.number {
                                @match row.fit {
                                    Some(p) => { (number(p.value)) span.under { (interval(p.low, p.high)) } }
                                    None => { (NONE) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn read_off_cell(row: &Row<'_>) -> Markup {
    html! {
        td.number {
            @match (row.read_off, row.rule) {
                (Some(value), _) => {
                    (number(value.value))
                    span.under { "found in " (interval(value.from_s, value.to_s)) " s" }
                }
                (None, "") => { (NONE) }
                (None, _) => { span.absent { "no such slope" } }
            }
        }
    }
}

fn term_table(model: &ModelReport) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th scope="col" { "term" }
                        th scope="col" { "unit" }
                        th.number.fit scope="col" { "fit" }
                    }
                }
                tbody {
                    @for term in &model.terms {
                        @for (name, p) in &term.parameters {
                            tr {
                                th scope="row" { (words(&term.kind)) span.under { (parameter_name(name)) } }
                                td { (unit(&p.unit)) }
                                td.number { (number(p.value)) span.under { (interval(p.low, p.high)) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn error_table(channel: &ChannelReport) -> Markup {
    let same = channel.after == channel.before;
    let models = [("before", &channel.before), ("after", &channel.after)];
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th scope="col" { "model" }
                        th.number scope="col" { "fitted half" }
                        th.number scope="col" { "unseen half" }
                    }
                }
                tbody {
                    @for (name, model) in models {
                        tr {
                            th scope="row" { span class={ "key " (if same { "before" } else { name }) } {} (name)
                                span.under { "rms, and deviance a point" } }
                            (error_cell(&model.fitted))
                            (error_cell(&model.unseen))
                        }
                    }
                }
            }
        }
    }
}

fn error_cell(error: &ModelError) -> Markup {
    html! { td.number { (percent(error.rms_percent)) span.under { (optional(error.deviance_per_point)) } } }
}

fn curve_table(channel: &ChannelReport) -> Markup {
    let same = channel.after == channel.before;
    html! {
        div.scroll {
            table.curve {
                thead {
                    tr {
                        @for name in ["n", "τ, s", "σ(τ)", "95 % low", "95 % high", "edf", "accuracy, %"] {
                            th.number scope="col" { (name) }
                        }
                        th.number scope="col" { @if same { "model" } @else { "before" } }
                        @if !same { th.number scope="col" { "after" } }
                    }
                }
                tbody {
                    @for (index, point) in channel.curve.iter().enumerate() {
                        tr {
                            td.number { (count(point.n)) }
                            @for value in [point.tau_s, point.adev, point.low, point.high, point.edf,
                                           point.accuracy_percent] {
                                td.number { (number(value)) }
                            }
                            td.number { (optional(channel.before.adev.get(index).copied())) }
                            @if !same {
                                td.number { (optional(channel.after.adev.get(index).copied())) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// What the words and numbers of the page mean.
pub(super) fn definitions() -> Markup {
    html! {
        section.definitions {
            h2 { "How to read this" }
            dl {
                dt { "Intervals" }
                dd { "have a confidence of 95 %, from the equivalent degrees of freedom (edf) of each point." }
                dt { "Before and after" }
                dd { "Before is the declared model: angle random walk " i { "N" } ", bias instability " i { "B" }
                     ", rate random walk " i { "K" } ". After adds the effects that were traced." }
                dt { "Model error" }
                dd { "Models are fitted to the first half of the samples and checked on the second, unseen half. "
                     "With " i { "v" } " the measured and " i { "m" } " the modelled Allan variance, over the "
                     "octaves with " i { "n" } " ≤ " i { "M" } "/8: rms is 100·√(mean (½ ln(" i { "v/m" }
                     "))²) %, deviance a point is mean edf·(ln(" i { "m/v" } ") + " i { "v/m" }
                     " − 1), which is about 1 for a true model." }
                dt { "Error after a time" }
                dd { "is the root mean square of the integral over that time, of a vehicle that took the mean of the 60 s "
                     "before as its bias: an angle of a gyro, a velocity of an accelerometer." }
                dt { "Innovations" }
                dd { "are what a Kalman filter of the model does not predict of quarter seconds of the unseen half. Of a true "
                     "model they are white and of the expected variance." }
                dt { "Continuous and discrete" }
                dd { "coefficients belong to the process and to its samples at this rate: they are different numbers." }
                dt { "Read off" }
                dd { i { "N" } " is the −½ slope at 1 s, " i { "B" } " the flat minimum divided by √(2 ln 2/π) = "
                     "0.664, " i { "K" } " the +½ slope at 3 s. Accuracy is 100/√(2(" i { "N/n" } " − 1)) %, with "
                     i { "N" } " samples in all." }
            }
        }
    }
}
