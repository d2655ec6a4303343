//! What an epoch taught, and what it said to what was learnt before it, in words.

use super::wording::name;
use link::{LearnedMessage, ReportedAddedTerm, ReportedModelError, ReportedParameter, ReportedTerm, ValidationMessage};

/// What a term's coefficient is called.
pub(super) fn symbol(term: ReportedTerm) -> &'static str {
    match term {
        ReportedTerm::AngleRandomWalk => "N",
        ReportedTerm::BiasInstability => "B",
        ReportedTerm::RateRandomWalk => "K",
        ReportedTerm::Quantization => "Q",
        ReportedTerm::RateRamp => "R",
        ReportedTerm::Filtered => "N behind a filter",
        ReportedTerm::Markov => "Markov noise",
        ReportedTerm::Resonance => "resonance",
        ReportedTerm::Sinusoid => "line",
    }
}

/// Names and units of the parameters of a term's shape.
fn shape(term: ReportedTerm) -> [(&'static str, &'static str); 2] {
    match term {
        ReportedTerm::Filtered => [("taps", ""), ("decimation", "")],
        ReportedTerm::Markov => [("time constant", " s"), ("", "")],
        ReportedTerm::Resonance => [("at", " Hz"), ("bandwidth", " Hz")],
        ReportedTerm::Sinusoid => [("at", " Hz"), ("", "")],
        _ => [("", ""); 2],
    }
}

pub(super) fn learnt(learnt: &LearnedMessage) -> Vec<String> {
    let name = name(learnt.channel);
    let epoch = learnt.epoch;
    let mut lines: Vec<String> = learnt.regressors.iter().map(|cause| {
        let (value, low, high) = (cause.value, cause.low, cause.high);
        let (of, reference) = (self::name(cause.covariate), cause.reference);
        format!("   {name}, epoch {epoch}: follows {of}: {value:.3e} ({low:.3e} to {high:.3e}), subtracted from {reference:.3}")
    }).collect();
    if lines.is_empty() {
        lines.push(format!("   {name}, epoch {epoch}: follows nothing beyond doubt, nothing is subtracted"));
    }
    if learnt.added_terms.is_empty() {
        lines.push(format!("   {name}, epoch {epoch}: N, B and K are enough, p = {:.3}", learnt.p_before));
    }
    lines.extend(learnt.added_terms.iter().map(|found| format!("   {name}, epoch {epoch}: lacks {}", effect(found))));
    lines
}

fn effect(effect: &ReportedAddedTerm) -> String {
    let coefficient = &effect.coefficient;
    let (value, low, high) = (coefficient.value, coefficient.low, coefficient.high);
    let mut text = format!("{} {value:.3e} ({low:.3e} to {high:.3e})", symbol(coefficient.term));
    for ((name, unit), ReportedParameter { value, low, high }) in shape(coefficient.term).into_iter().zip(&effect.shape)
    {
        text += &format!(", {name} {value:.4}{unit} ({low:.4} to {high:.4})");
    }
    let (percent, sigmas, n) = (100.0 * effect.excess, effect.sigmas, effect.n);
    text + &format!("; {percent:+.1} % at n = {n} ({sigmas:.0} sigma), score {:.0}", effect.score)
}

pub(super) fn checked(checked: &ValidationMessage, sample_rate_hz: Option<f64>) -> String {
    let mut text = format!("   {}, epoch {}, unseen:", name(checked.channel), checked.epoch);
    let points = |error: Option<ReportedModelError>| {
        error.map_or_else(|| "unknown".to_owned(), |error| format!("{:.2}", error.deviance_per_point))
    };
    text += &format!(" deviance per point {} -> {}", points(checked.before), points(checked.after));
    if let Some(shift) = checked.shift {
        text += &format!(", mean moved by {:.3e} -> {:.3e}", shift.raw, shift.compensated);
    }
    for drift in &checked.drift {
        let at =
            sample_rate_hz.map_or_else(|| format!("{} samples", drift.n), |hz| format!("{:.1} s", drift.n as f64 / hz));
        text += &format!(", deviation at {at} {:.3e} -> {:.3e}", drift.raw, drift.compensated);
    }
    text
}
