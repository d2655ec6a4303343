//! The part of a report that other programs need: sample rate, curves, final models; from JSON (schema 2) or memory.

use crate::coefficients::{KINDS, white_noise};
use noise_analysis::report::{CurvePoint, DataSheetReport, Parameter, Report, SCHEMA};
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;

/// Parameter: N below the corner of a process that replaces white noise.
const BELOW_CORNER: &str = "white_noise";

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct SavedReport {
    /// Hz.
    pub sample_rate_hz: f64,
    pub channels: Vec<SavedChannel>,
    /// Different rates, Hz, of joined reports.
    #[serde(skip)]
    pub other_rates_hz: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct SavedChannel {
    pub name: String,
    /// Unit of the deviations, such as `deg/s`.
    pub unit: String,
    /// The measured Allan deviation, octave by octave.
    pub curve: Vec<CurvePoint>,
    /// Fitted to the whole record.
    #[serde(rename = "final")]
    pub refitted: SavedModel,
    /// Deviance per point of the first half's model on the second, 1 for a true model; absent for short records.
    #[serde(default, rename = "after", deserialize_with = "unseen_error")]
    pub unseen_error: Option<f64>,
    pub data_sheet: Option<DataSheetReport>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct SavedModel {
    pub terms: Vec<SavedTerm>,
    /// The model's deviation in the channel's unit, at each point of the curve.
    pub adev: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct SavedTerm {
    pub kind: String,
    /// By name, as in [`noise_analysis::report::TermReport::parameters`].
    pub parameters: BTreeMap<String, Parameter>,
}

#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SavedReportError {
    #[error("no JSON report of this program: {0}")]
    NoReport(serde_json::Error),
    #[error("schema {0}, where this program reads schema {SCHEMA}")]
    Schema(u64),
    #[error("{path}: {reason}")]
    Field { path: String, reason: serde_json::Error },
    #[error("{0}: the report contradicts itself; make it anew with `analyze -o report.json`")]
    Contradiction(String),
    #[error("{0} is in both reports; those of one sensor's parts have different channels")]
    SameChannel(String),
}

/// Equal within the error of two clocks.
fn is_same_rate(one: f64, other: f64) -> bool {
    (one / other - 1.0).abs() < 0.01
}

fn unseen_error<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    let model = serde_json::Value::deserialize(deserializer)?;
    Ok(model.pointer("/unseen/deviance_per_point").and_then(serde_json::Value::as_f64))
}

impl SavedReport {
    /// The part of a report in memory, by its JSON.
    ///
    /// # Errors
    /// A number of the report is not finite.
    pub fn new(report: &Report) -> Result<Self, SavedReportError> {
        serde_json::to_value(report).and_then(serde_json::from_value).map_err(SavedReportError::NoReport)
    }

    /// Reads the JSON of `analyze -o report.json`.
    ///
    /// # Errors
    /// The text is no JSON, has another schema, or lacks a field; the error names the field.
    pub fn from_json(text: &str) -> Result<Self, SavedReportError> {
        #[derive(Deserialize)]
        struct Version {
            schema: u64,
        }
        let Version { schema } = serde_json::from_str(text).map_err(SavedReportError::NoReport)?;
        if schema != u64::from(SCHEMA) {
            return Err(SavedReportError::Schema(schema));
        }
        serde_path_to_error::deserialize(&mut serde_json::Deserializer::from_str(text)).map_err(|error| {
            let path = match error.path().to_string() {
                path if path == "." => "the report".to_owned(),
                path => path,
            };
            SavedReportError::Field { path, reason: error.into_inner() }
        })
    }

    /// Checks rate, names, and that coefficients are inside of their intervals.
    ///
    /// # Errors
    /// Names the first contradiction.
    pub fn check(&self) -> Result<(), SavedReportError> {
        let contradiction = |text: String| Err(SavedReportError::Contradiction(text));
        if !(self.sample_rate_hz.is_normal() && self.sample_rate_hz > 0.0) {
            return contradiction(format!("a sample rate of {} Hz", self.sample_rate_hz));
        }
        for (at, channel) in self.channels.iter().enumerate() {
            if self.channels[..at].iter().any(|other| other.name == channel.name) {
                return contradiction(format!("the channel {} is there twice", channel.name));
            }
            for term in &channel.refitted.terms {
                let Some(Parameter { value, low, high, .. }) = term.parameters.get("value") else { continue };
                let is_number = |of: &f64| *of == 0.0 || of.is_normal() || *of == f64::INFINITY;
                let are_numbers = [value, low, high].into_iter().all(is_number);
                // Rounding.
                let margin = 1e-6 * value.abs();
                if !are_numbers || *low > value + margin || *high < value - margin {
                    let (name, kind) = (&channel.name, &term.kind);
                    return contradiction(format!("{name}: {kind} of {value:e} in the interval {low:e} to {high:e}"));
                }
            }
        }
        Ok(())
    }

    /// Joins reports on parts of one sensor; the rate is the first one's.
    ///
    /// # Errors
    /// Two of them have a channel in common.
    pub fn joined(reports: impl IntoIterator<Item = Self>) -> Result<Option<Self>, SavedReportError> {
        let mut joined: Option<Self> = None;
        for report in reports {
            let Some(all) = &mut joined else {
                joined = Some(report);
                continue;
            };
            if let Some(same) = report.channels.iter().find(|channel| all.channel(&channel.name).is_some()) {
                return Err(SavedReportError::SameChannel(same.name.clone()));
            }
            all.other_rates_hz.extend(Some(report.sample_rate_hz).filter(|hz| !is_same_rate(*hz, all.sample_rate_hz)));
            all.channels.extend(report.channels);
        }
        Ok(joined)
    }

    pub fn channel(&self, name: &str) -> Option<&SavedChannel> {
        self.channels.iter().find(|channel| channel.name == name)
    }
}

impl SavedChannel {
    /// The coefficient of the term `kind`; N of all white noise, also below the corner of a process that replaces it.
    pub fn coefficient(&self, kind: &str) -> Option<Parameter> {
        let mut terms = self.refitted.terms.iter();
        if kind == KINDS[0] {
            return white_noise(terms.filter_map(SavedTerm::angle_random_walk).cloned());
        }
        terms.find(|term| term.kind == kind)?.parameters.get("value").cloned()
    }
}

impl SavedTerm {
    /// N of white noise, filtered or not.
    fn angle_random_walk(&self) -> Option<&Parameter> {
        let is_white = ["angle_random_walk", "filter_bandwidth", "low_pass"].contains(&self.kind.as_str());
        self.parameters.get(if is_white { "value" } else { BELOW_CORNER })
    }

    pub(crate) fn is_in_place_of_white_noise(&self) -> bool {
        self.parameters.contains_key(BELOW_CORNER)
    }
}

#[cfg(test)]
mod tests {
    use super::{SavedReport, SavedReportError};

    const POINT: &str = r#"{"n":1,"tau_s":0.01,"adev":0.4,"low":0.3,"high":null,"edf":9.0}"#;

    fn report(terms: &str) -> String {
        format!(
            r#"{{"schema":2,"sample_rate_hz":100.0,"channels":[{{"name":"gyro_x","unit":"deg/s","curve":[{POINT}],
            "final":{{"terms":[{terms}],"adev":[0.4]}}}}]}}"#
        )
    }

    /// 0.3 °/√s below the corner, 0.4 °/√s of white noise: N is the root sum of squares.
    #[test]
    fn n_has_the_process_that_stands_in_the_place_of_white_noise() {
        let parameter = |name: &str, value: f64, unit: &str| {
            format!(r#""{name}":{{"value":{value},"low":{value},"high":{value},"unit":"{unit}"}}"#)
        };
        let term = |kind: &str, parameters: [String; 3]| {
            let parameters = parameters.into_iter().filter(|of| !of.is_empty()).collect::<Vec<String>>().join(",");
            format!(r#"{{"kind":"{kind}","parameters":{{{parameters}}}}}"#)
        };
        let white = term("angle_random_walk", [parameter("value", 0.4, "deg/sqrt(s)"), String::new(), String::new()]);
        let process = |below_corner: String| {
            term("markov", [parameter("deviation", 1.0, "deg/s"), parameter("time_constant", 0.045, "s"), below_corner])
        };
        let n = |process: String| {
            let read = SavedReport::from_json(&report(&[white.clone(), process].join(","))).expect("complete");
            read.channels[0].coefficient("angle_random_walk").map(|n| n.value)
        };
        assert_eq!(n(process(parameter("white_noise", 0.3, "deg/sqrt(s)"))), Some(0.5));
        assert_eq!(n(process(String::new())), Some(0.4));
    }

    #[test]
    fn a_report_that_contradicts_itself_is_none() {
        let term = |value: &str, low: &str, high: &str| {
            format!(
                r#"{{"kind":"angle_random_walk","parameters":{{"value":{{"value":{value},"low":{low},"high":{high},"unit":"deg/sqrt(s)"}}}}}}"#
            )
        };
        let checked =
            |text: &str| SavedReport::from_json(text).expect("complete").check().map_err(|error| error.to_string());
        for (value, low, high, is_right) in [
            ("1.0", "0.9", "1.1", true),
            ("0.0", "0.0", "1.1", true),
            ("1.0", "0.0", "null", true),
            ("1e-6", "0.9", "1.1", false),
            ("1.0", "1.1", "0.9", false),
            ("1e-320", "1e-320", "1e-320", false),
        ] {
            assert_eq!(checked(&report(&term(value, low, high))).is_ok(), is_right, "{value} {low} {high}");
        }
        let sound = report(&term("1.0", "0.9", "1.1"));
        for rate in ["0.0", "-5.0", "1e-320"] {
            let error = checked(&sound.replace("100.0", rate)).expect_err(rate);
            assert!(error.contains("a sample rate of"), "{error}");
        }
        let mut twice = SavedReport::from_json(&sound).expect("complete");
        twice.channels.push(twice.channels[0].clone());
        assert!(twice.check().is_err());
        assert!(SavedReport::joined([twice.clone(), twice]).is_err());
    }

    #[test]
    fn what_is_missing_is_named_with_its_place() {
        let complete = r#"{"kind":"angle_random_walk","parameters":{"value":{"value":1.0,"low":0.9,"high":1.1,"unit":"deg/sqrt(s)"}}}"#;
        let read = SavedReport::from_json(&report(complete)).expect("complete");
        assert_eq!(read.channels[0].coefficient("angle_random_walk").map(|n| n.high), Some(1.1));
        assert_eq!(read.channels[0].curve[0].high, f64::INFINITY);
        let error = |text: &str| SavedReport::from_json(text).expect_err("incomplete").to_string();
        let without_low = complete.replace(r#""low":0.9,"#, "");
        assert!(
            error(&report(&without_low))
                .starts_with("channels[0].final.terms[0].parameters.value: missing field `low`")
        );
        assert!(
            error(&report("").replace("sample_rate_hz", "rate"))
                .starts_with("the report: missing field `sample_rate_hz`")
        );
        assert_eq!(error(r#"{"schema":1}"#), "schema 1, where this program reads schema 2");
        for text in ["", "{}", "sample,gyro_x_counts"] {
            assert!(matches!(SavedReport::from_json(text), Err(SavedReportError::NoReport(_))), "{text}");
        }
    }
}
