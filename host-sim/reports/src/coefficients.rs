//! The rows in which the coefficients of the declared model are shown: read off the slopes, beside the fit.

use noise_analysis::report::{ChannelReport, Parameter, ReadOffValue};

/// Where a coefficient is read off, after IEEE Std 952 annex C.
pub const RULES: [(&str, &str, &str); 3] = [
    ("angle_random_walk", "N", "slope −½, at 1 s"),
    ("bias_instability", "B", "flat minimum / 0.664"),
    ("rate_random_walk", "K", "slope +½, at 3 s"),
];

/// One coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row<'a> {
    /// Name in the JSON schema.
    pub kind: &'a str,
    /// Letter in formulas; empty for a term that is not of the declared three.
    pub symbol: &'static str,
    /// How it is read off; empty for a term that cannot be.
    pub rule: &'static str,
    /// Of the read-off value and of the fit; empty where there is neither.
    pub unit: &'a str,
    /// Absent where the slope does not occur.
    pub read_off: Option<&'a ReadOffValue>,
    /// Absent where the model lacks the term.
    pub fit: Option<&'a Parameter>,
}

/// The declared three in order, then whatever else the model of `channel` holds.
pub fn rows(channel: &ChannelReport) -> Vec<Row<'_>> {
    let read_off = &channel.read_off;
    let values =
        [read_off.angle_random_walk.as_ref(), read_off.bias_instability.as_ref(), read_off.rate_random_walk.as_ref()];
    let declared = RULES.iter().zip(values).map(|(&(kind, symbol, rule), read_off)| {
        let fit =
            channel.before.terms.iter().find(|term| term.kind == kind).and_then(|term| term.parameters.get("value"));
        let unit = read_off.map(|value| value.unit.as_str()).or(fit.map(|parameter| parameter.unit.as_str()));
        Row { kind, symbol, rule, unit: unit.unwrap_or(""), read_off, fit }
    });
    let others =
        channel.before.terms.iter().filter(|term| RULES.iter().all(|(kind, ..)| term.kind != *kind)).flat_map(|term| {
            term.parameters.values().map(|parameter| Row {
                kind: &term.kind,
                symbol: "",
                rule: "",
                unit: &parameter.unit,
                read_off: None,
                fit: Some(parameter),
            })
        });
    declared.chain(others).collect()
}
