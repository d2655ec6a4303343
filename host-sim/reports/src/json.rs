//! The JSON of a report, schema 2: effects and findings with names of kinds and parameters; the rest as in [`Report`].

use crate::finding_text::shown_effects;
use crate::reading::ReadingRecord;
use noise_analysis::effects::Effect;
use noise_analysis::report::assessment::Assessment;
use noise_analysis::report::{
    ChannelEffect, ChannelReport, CommonModeRegression, CurvePoint, FigureData, Finding, MissingSamples,
    ModelErrorReport, ModelReport, Nonstationarity, Parameter, PartReport, Report, SlopeMethodReport, Stretch,
    Validation,
};
use serde::Serialize;
use std::collections::BTreeMap;

/// A report as JSON has it.
#[derive(Debug, Serialize)]
pub struct ReportJson<'a> {
    schema: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    reading: Option<&'a ReadingRecord>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    quick: bool,
    sample_rate_hz: f64,
    samples: u64,
    dropped: &'a BTreeMap<String, u64>,
    flagged: &'a BTreeMap<String, u64>,
    part: &'a PartReport,
    findings: Vec<FindingJson<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    common_mode: Option<&'a CommonModeRegression>,
    channels: Vec<ChannelJson<'a>>,
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

#[derive(Debug, Serialize)]
struct ChannelJson<'a> {
    name: &'a str,
    unit: &'a str,
    samples: u64,
    #[serde(flatten)]
    missing: &'a MissingSamples,
    curve: &'a [CurvePoint],
    unseen_adev: &'a [f64],
    read_off: &'a SlopeMethodReport,
    before: &'a ModelReport,
    effects: Vec<EffectJson<'a>>,
    after: &'a ModelReport,
    first_half_curve: &'a ModelErrorReport,
    #[serde(rename = "final")]
    refitted: &'a ModelReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    nonstationarity: Option<&'a Nonstationarity>,
    at_rest: &'a [Stretch],
    practice: &'a Assessment,
    #[serde(flatten)]
    figure_data: &'a FigureData,
}

#[derive(Debug, Serialize)]
struct EffectJson<'a> {
    kind: &'static str,
    parameters: BTreeMap<&'static str, Parameter>,
    evidence: &'a Effect,
    finding: usize,
}

impl<'a> ReportJson<'a> {
    /// Adds the record of the reading.
    #[must_use]
    pub fn with_reading(self, reading: Option<&'a ReadingRecord>) -> Self {
        Self { reading, ..self }
    }
}

impl<'a> From<&'a Report> for ReportJson<'a> {
    fn from(report: &'a Report) -> Self {
        let Report {
            schema,
            quick,
            sample_rate_hz,
            samples,
            dropped,
            flagged,
            part,
            findings,
            common_mode,
            longest_at_rest: _,
            channels,
        } = report;
        Self {
            schema: *schema,
            reading: None,
            quick: *quick,
            sample_rate_hz: *sample_rate_hz,
            samples: *samples,
            dropped,
            flagged,
            part,
            findings: (0..findings.len()).map(|index| FindingJson::new(report, index)).collect(),
            common_mode: common_mode.as_ref(),
            channels: channels.iter().map(ChannelJson::from).collect(),
        }
    }
}

impl<'a> FindingJson<'a> {
    fn new(report: &'a Report, index: usize) -> Self {
        let finding = &report.findings[index];
        let Finding { effect, channels, clearest, validated, share_percent, minute_percent } = finding;
        let shown = shown_effects(report, index).into_iter();
        Self {
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
    }
}

impl<'a> From<&'a ChannelReport> for ChannelJson<'a> {
    fn from(channel: &'a ChannelReport) -> Self {
        let ChannelReport {
            name,
            unit,
            samples,
            missing,
            curve,
            unseen_adev,
            read_off,
            before,
            effects,
            after,
            first_half_curve,
            refitted,
            nonstationarity,
            at_rest,
            assessment,
            figure_data,
        } = channel;
        Self {
            name,
            unit,
            samples: *samples,
            missing,
            curve,
            unseen_adev,
            read_off,
            before,
            effects: effects.iter().map(EffectJson::from).collect(),
            after,
            first_half_curve,
            refitted,
            nonstationarity: nonstationarity.as_ref(),
            at_rest,
            practice: assessment,
            figure_data,
        }
    }
}

impl<'a> From<&'a ChannelEffect> for EffectJson<'a> {
    fn from(ChannelEffect { effect, finding }: &'a ChannelEffect) -> Self {
        Self { kind: effect.name(), parameters: effect.parameters(), evidence: effect, finding: *finding }
    }
}
