//! The record of the reading: rows read and rows left out.

use crate::formatting::{count, of_each_cause};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ReadingRecord {
    pub file: String,
    /// Hexadecimal; absent if unknown.
    pub sha256: Option<String>,
    pub program: String,
    pub version: String,
    pub options: Vec<String>,
    pub rows: u64,
    pub left_out: BTreeMap<String, u64>,
    /// False for a part of the file.
    pub complete: bool,
    /// Reason, if the file is damaged.
    pub damage: Option<String>,
    /// Remarks on the file, one sentence each.
    pub notes: Vec<String>,
}

/// Rows that are no samples, by cause: `dropped`, outside of the part, and padding.
pub fn rows_left_out(dropped: &BTreeMap<&'static str, u64>, outside_part: u64, padding: u64) -> BTreeMap<String, u64> {
    let dropped = dropped.iter().filter(|(cause, _)| **cause != "gap").map(|(cause, rows)| (*cause, *rows));
    let causes = dropped.chain([("outside_part", outside_part), ("padding", padding)]);
    causes.filter(|(_, rows)| *rows > 0).map(|(cause, rows)| (cause.to_owned(), rows)).collect()
}

#[derive(Debug, Clone, Copy, Default)]
pub struct ReadingOptions<'a> {
    pub topic: Option<&'a str>,
    /// Each as in `gyro_x=wx`.
    pub columns: &'a [String],
    /// One per quantity, as in `deg/s`.
    pub units: &'a [String],
    /// Sample rate, Hz.
    pub rate: Option<f64>,
    /// Name of a sensor, or its profile file.
    pub sensor: Option<&'a str>,
    /// Full scale of the gyros of an ADIS16405, °/s.
    pub range: Option<u32>,
    /// Beginning of the part that is read, s from the first sample.
    pub from_s: Option<f64>,
    /// Its end, s from the first sample.
    pub to_s: Option<f64>,
}

impl ReadingOptions<'_> {
    pub fn words(&self) -> Vec<String> {
        let list = |texts: &[String]| Some(texts.join(",")).filter(|text| !text.is_empty());
        let number = |number: Option<f64>| number.map(|number| number.to_string());
        let options = [
            ("--topic", self.topic.map(str::to_owned)),
            ("--columns", list(self.columns)),
            ("--units", list(self.units)),
            ("--rate", number(self.rate)),
            ("--sensor", self.sensor.map(str::to_owned)),
            ("--range", self.range.map(|range| range.to_string())),
            ("--from", number(self.from_s)),
            ("--to", number(self.to_s)),
        ];
        options.into_iter().filter_map(|(name, value)| Some([name.to_owned(), value?])).flatten().collect()
    }
}

impl ReadingRecord {
    /// A sentence if the reading ended early.
    pub fn incomplete(&self) -> Option<String> {
        let why = self.damage.clone().unwrap_or_else(|| "the reading was stopped".to_owned());
        (!self.complete).then(|| format!("Not read to its end: {why}."))
    }

    pub fn lines(&self) -> Vec<String> {
        let options =
            if self.options.is_empty() { String::new() } else { format!(", with {}", self.options.join(" ")) };
        let mut lines = vec![format!(
            "{} rows of {} were read by {} {}{options}.",
            count(self.rows),
            self.file,
            self.program,
            self.version
        )];
        let left_out = of_each_cause(&self.left_out);
        lines.extend((!left_out.is_empty()).then(|| format!("Rows that are no samples: {left_out}.")));
        lines.extend(self.incomplete());
        lines.extend(self.notes.iter().map(|note| format!("{note}.")));
        lines.extend(self.sha256.iter().map(|sha256| format!("SHA-256 {sha256}")));
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::ReadingRecord;

    #[test]
    fn a_reading_says_what_is_missing_and_why() {
        let record = ReadingRecord {
            file: "cut.ulg".to_owned(),
            program: "imunoise".to_owned(),
            version: "1.2".to_owned(),
            options: vec!["--rate".to_owned(), "100".to_owned()],
            rows: 9189,
            left_out: [("time_backwards".to_owned(), 3)].into(),
            damage: Some("truncated ULog: the data end early".to_owned()),
            ..ReadingRecord::default()
        };
        assert_eq!(record.incomplete().as_deref(), Some("Not read to its end: truncated ULog: the data end early."));
        assert_eq!(record.lines()[0], "9,189 rows of cut.ulg were read by imunoise 1.2, with --rate 100.");
        assert_eq!(record.lines()[1], "Rows that are no samples: 3 time backwards.");
        let whole = ReadingRecord { complete: true, damage: None, ..record };
        assert_eq!(whole.incomplete(), None);
    }
}
