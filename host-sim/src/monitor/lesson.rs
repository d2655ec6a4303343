//! What an epoch taught, and what it said to what was learnt before it, in words.

use super::wording::name;
use link::{Bounded, Checked, Effect, Learnt, ModelError, Term};

/// What a term's coefficient is called.
pub(super) fn symbol(term: Term) -> &'static str {
    match term {
        Term::AngleRandomWalk => "N",
        Term::BiasInstability => "B",
        Term::RateRandomWalk => "K",
        Term::Quantization => "Q",
        Term::RateRamp => "R",
        Term::Filtered => "N behind a filter",
        Term::Markov => "Markov noise",
        Term::Resonance => "resonance",
        Term::Sinusoid => "line",
    }
}

/// Names and units of the parameters of a term's shape.
fn shape(term: Term) -> [(&'static str, &'static str); 2] {
    match term {
        Term::Filtered => [("taps", ""), ("decimation", "")],
        Term::Markov => [("time constant", " s"), ("", "")],
        Term::Resonance => [("at", " Hz"), ("bandwidth", " Hz")],
        Term::Sinusoid => [("at", " Hz"), ("", "")],
        _ => [("", ""); 2],
    }
}

pub(super) fn learnt(learnt: &Learnt) -> Vec<String> {
    let name = name(learnt.channel);
    let epoch = learnt.epoch;
    let mut lines: Vec<String> = learnt.causes.iter().map(|cause| {
        let (value, low, high) = (cause.value, cause.low, cause.high);
        let (of, reference) = (self::name(cause.covariate), cause.reference);
        format!("   {name}, epoch {epoch}: follows {of}: {value:.3e} ({low:.3e} to {high:.3e}), subtracted from {reference:.3}")
    }).collect();
    if lines.is_empty() {
        lines.push(format!("   {name}, epoch {epoch}: follows nothing beyond doubt, nothing is subtracted"));
    }
    if learnt.effects.is_empty() {
        lines.push(format!("   {name}, epoch {epoch}: N, B and K are enough, p = {:.3}", learnt.p_before));
    }
    lines.extend(learnt.effects.iter().map(|found| format!("   {name}, epoch {epoch}: lacks {}", effect(found))));
    lines
}

fn effect(effect: &Effect) -> String {
    let coefficient = &effect.coefficient;
    let (value, low, high) = (coefficient.value, coefficient.low, coefficient.high);
    let mut text = format!("{} {value:.3e} ({low:.3e} to {high:.3e})", symbol(coefficient.term));
    for ((name, unit), Bounded { value, low, high }) in shape(coefficient.term).into_iter().zip(&effect.shape) {
        text += &format!(", {name} {value:.4}{unit} ({low:.4} to {high:.4})");
    }
    let (percent, sigmas, n) = (100.0 * effect.excess, effect.sigmas, effect.n);
    text + &format!("; {percent:+.1} % at n = {n} ({sigmas:.0} sigma), score {:.0}", effect.score)
}

pub(super) fn checked(checked: &Checked, sample_rate_hz: Option<f64>) -> String {
    let mut text = format!("   {}, epoch {}, unseen:", name(checked.channel), checked.epoch);
    let points = |error: Option<ModelError>| {
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
