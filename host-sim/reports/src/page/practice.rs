//! What a channel's model is good for, on the page.

use crate::terminal::advice;
use crate::wording::{NONE, count, duration, interval, number, unit, verdict, words};
use maud::{Markup, html};
use noise_analysis::practice::Practice;

pub(super) fn practice(practice: &Practice) -> Markup {
    html! {
        @if !practice.coefficients.is_empty() { (coefficients(practice)) }
        @if !practice.drift.is_empty() { (drift(practice)) }
        ul.effects {
            @if let Some(found) = &practice.innovations {
                li { b { "Kalman filter of the model" } ", unseen half: " (verdict(found)) "."
                    span.parameter { (count(found.count as u64)) " innovations, " (number(found.normalised))
                        " of the expected variance (" (interval(found.low, found.high)) " for a true model), whiteness p = "
                        (number(found.whiteness_p)) }
                }
            }
            @if let Some(spectrum) = &practice.angle_random_walk_by_spectrum {
                li { b { "N by the spectrum" } ": " (number(spectrum.value)) " " (unit(&spectrum.unit))
                    " (" (interval(spectrum.low, spectrum.high)) ")" }
            }
            @if let Some(time) = &practice.markov_time_by_autocorrelation {
                li { b { "Markov time by the autocorrelation" } ": " (number(time.value)) " " (unit(&time.unit))
                    " (" (interval(time.low, time.high)) ")" }
            }
            @for record in &practice.record { li { (advice(record)) } }
        }
    }
}

fn coefficients(practice: &Practice) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th scope="col" { "coefficient" }
                        th scope="col" { "unit" }
                        th.number scope="col" { "continuous" }
                        th.number scope="col" { "discrete, of samples" }
                    }
                }
                tbody {
                    @for coefficient in &practice.coefficients {
                        tr {
                            th scope="row" { (words(&coefficient.kind)) }
                            td { (unit(&coefficient.value.unit)) }
                            @for discrete in [false, true] {
                                td.number {
                                    @if coefficient.discrete == discrete {
                                        (number(coefficient.value.value))
                                        span.under { (interval(coefficient.value.low, coefficient.value.high)) }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn drift(practice: &Practice) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th scope="col" { "error after" }
                        th scope="col" { "unit" }
                        th.number scope="col" { "predicted" }
                        th.number scope="col" { "unseen half" }
                    }
                }
                tbody {
                    @for drift in &practice.drift {
                        tr {
                            th scope="row" { (duration(drift.seconds)) }
                            td { (unit(&drift.unit)) }
                            td.number { (number(drift.predicted)) }
                            td.number {
                                @match &drift.observed {
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
