//! The JSON of a report, schema 2: findings with names of kinds and parameters; the rest as in [`Report`].

use crate::finding_text::shown_effects;
use crate::reading::ReadingRecord;
use noise_analysis::effects::Effect;
use noise_analysis::report::{Finding, Parameter, Report, Validation};
use serde::Serialize;
use std::collections::BTreeMap;

#[derive(Debug, Serialize)]
pub struct ReportJson<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    reading: Option<&'a ReadingRecord>,
    findings: Vec<FindingJson<'a>>,
    #[serde(flatten)]
    report: &'a Report,
}

#[derive(Debug, Serialize)]
struct FindingJson<'a> {
    kind: &'static str,
    channels: &'a [String],
    clearest: Option<&'a String>,
    parameters: BTreeMap<&'static str, Parameter>,
    in_channels: BTreeMap<&'a str, BTreeMap<&'static str, Parameter>>,
    evidence: &'a Effect,
    validated: Validation,
    share_percent: &'a BTreeMap<String, f64>,
    minute_percent: &'a BTreeMap<String, f64>,
}

impl<'a> ReportJson<'a> {
    pub fn new(report: &'a Report, reading: Option<&'a ReadingRecord>) -> Self {
        let finding = |(index, finding): (usize, &'a Finding)| {
            let Finding { effect, channels, clearest, validated, share_percent, minute_percent } = finding;
            let shown = shown_effects(report, index).into_iter();
            FindingJson {
                kind: effect.name(),
                channels,
                clearest: channels.get(*clearest),
                parameters: effect.parameters(),
                in_channels: shown.map(|shown| (shown.channel, shown.effect.parameters())).collect(),
                evidence: effect,
                validated: *validated,
                share_percent,
                minute_percent,
            }
        };
        Self { reading, findings: report.findings.iter().enumerate().map(finding).collect(), report }
    }
}
