//! What was read for a report, and what was not: in the JSON, on the screen and on the page.

use crate::formatting::count;
use crate::formatting::words;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What was read of a recording.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ReadingRecord {
    /// Name of the file, without its folder.
    pub file: String,
    /// Of its bytes, in hexadecimal digits; absent where it could not be made.
    pub sha256: Option<String>,
    /// The program that read it, and its version.
    pub program: String,
    /// See `program`.
    pub version: String,
    /// The options that say how it was read.
    pub options: Vec<String>,
    /// Rows that were read.
    pub rows: u64,
    /// Rows that are no samples, by cause.
    pub left_out: BTreeMap<String, u64>,
    /// Whether it was read to its end.
    pub complete: bool,
    /// Why it was not, where it is damaged.
    pub damage: Option<String>,
    /// What a reader of the report should know of the file, one sentence each.
    pub notes: Vec<String>,
}

impl ReadingRecord {
    /// A sentence for the screen, where the recording was not read to its end.
    #[must_use]
    pub fn incomplete(&self) -> Option<String> {
        let why = self.damage.clone().unwrap_or_else(|| "the reading was stopped".to_owned());
        (!self.complete).then(|| format!("Not read to its end: {why}."))
    }

    /// Lines on what was read.
    #[must_use]
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
        let left_out: Vec<String> =
            self.left_out.iter().map(|(cause, rows)| format!("{} {}", count(*rows), words(cause))).collect();
        if !left_out.is_empty() {
            lines.push(format!("Rows that are no samples: {}.", left_out.join(", ")));
        }
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
