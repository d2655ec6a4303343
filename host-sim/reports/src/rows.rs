//! A report as rows of a flat table: the recording, coefficients by channel, and parameters by finding and channel.

use crate::coefficients::KINDS;
use crate::finding_text::shown_effects;
use crate::reading::ReadingRecord;
use crate::summary::coefficient;
use noise_analysis::report::{Finding, Parameter, Report, Validation};
use serde::{Deserialize, Serialize};

/// Absent fields do not apply.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ReportRow {
    pub recording: String,
    pub sha256: Option<String>,
    pub version: Option<String>,
    /// `complete`, `incomplete` (ended early) or `failed` (no report).
    pub status: String,
    pub reason: Option<String>,
    /// Remarks, one sentence a line.
    pub notes: Option<String>,
    /// Name of the sensor's profile.
    pub sensor: Option<String>,
    /// Hz.
    pub rate_hz: Option<f64>,
    pub hours: Option<f64>,
    /// `recording`, `coefficient` or `finding`.
    pub row: String,
    pub channel: Option<String>,
    /// Such as `angle_random_walk` or `sinusoid`.
    pub kind: Option<String>,
    /// Such as `frequency`.
    pub parameter: Option<String>,
    pub value: Option<f64>,
    /// Lower 95 % bound.
    pub low: Option<f64>,
    /// Upper 95 % bound, if there is one.
    pub high: Option<f64>,
    /// Such as `deg/sqrt(s)`.
    pub unit: Option<String>,
    /// Test of a finding on the second half: `yes`, `no` or `untestable`.
    pub validated: Option<String>,
    /// Number of the finding in the report, from 0.
    pub finding: Option<u64>,
}

impl ReportRow {
    /// The only row of a recording without a report.
    pub fn failed(recording: &str, reason: &str, version: &str) -> Self {
        Self {
            recording: recording.to_owned(),
            version: Some(version.to_owned()),
            status: "failed".to_owned(),
            reason: Some(reason.to_owned()),
            row: "recording".to_owned(),
            ..Self::default()
        }
    }

    fn with_value(self, Parameter { value, low, high, unit }: Parameter) -> Self {
        let finite = |number: f64| Some(number).filter(|number| number.is_finite());
        Self { value: finite(value), low: finite(low), high: finite(high), unit: Some(unit), ..self }
    }
}

/// The rows of a report on `recording`.
pub fn rows(report: &Report, recording: &str, reading: Option<&ReadingRecord>) -> Vec<ReportRow> {
    let is_complete = reading.is_none_or(|reading| reading.complete);
    let lines = |sentences: &[String]| Some(sentences.join("\n")).filter(|text| !text.is_empty());
    let of_recording = ReportRow {
        recording: recording.to_owned(),
        sha256: reading.and_then(|reading| reading.sha256.clone()),
        version: reading.map(|reading| reading.version.clone()),
        status: (if is_complete { "complete" } else { "incomplete" }).to_owned(),
        reason: reading.and_then(ReadingRecord::incomplete),
        notes: reading.and_then(|reading| lines(&reading.notes)),
        sensor: Some(report.part.name.clone()),
        rate_hz: Some(report.sample_rate_hz),
        hours: Some(report.samples as f64 / report.sample_rate_hz / 3600.0),
        row: "recording".to_owned(),
        ..ReportRow::default()
    };
    let mut rows = vec![of_recording.clone()];
    for channel in &report.channels {
        for kind in KINDS.into_iter().chain(["quantization", "rate_ramp"]) {
            let Some(of) = coefficient(channel, kind) else { continue };
            let row = ReportRow {
                row: "coefficient".to_owned(),
                channel: Some(channel.name.clone()),
                kind: Some(kind.to_owned()),
                ..of_recording.clone()
            };
            rows.push(row.with_value(of));
        }
    }
    for (index, Finding { effect, channels, validated, .. }) in report.findings.iter().enumerate() {
        let row = |channel: &str| ReportRow {
            row: "finding".to_owned(),
            channel: Some(channel.to_owned()),
            kind: Some(effect.name().to_owned()),
            validated: Some(
                match validated {
                    Validation::Yes => "yes",
                    Validation::No => "no",
                    Validation::Untestable => "untestable",
                }
                .to_owned(),
            ),
            finding: Some(index as u64),
            ..of_recording.clone()
        };
        let shown = shown_effects(report, index);
        for channel in channels {
            let own = shown.iter().find(|shown| shown.channel == channel).map_or(effect, |shown| shown.effect);
            let parameters = own.parameters();
            if parameters.is_empty() {
                rows.push(row(channel));
            }
            for (name, parameter) in parameters {
                rows.push(ReportRow { parameter: Some(name.to_owned()), ..row(channel) }.with_value(parameter));
            }
        }
    }
    rows
}
