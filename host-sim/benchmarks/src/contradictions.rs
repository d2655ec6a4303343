//! Benchmark of the sentences under "Contradicted" in reports of pure N, B and K in a constant environment.

use crate::parallel;
use crate::undeclared::{DrawnRecording, RecordingGroup, ScoreError};
use adis16405_driver::Channel;
use noise_analysis::analysis::analyze;
use recordings::time_base::measurement;
use serde::Serialize;
use std::io::{self, Write};
use virtual_sensor::SensorScenario;

/// A text that only one sentence contains, with the sentence's row in the table.
const SENTENCES: [(&str, &str); 2] = [
    ("standard errors", "… at τ = …: σ is … the model (… standard errors)"),
    ("smaller error than it has", "a Kalman filter with the models of … would claim a smaller error than it has"),
];

/// Records to examine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContradictionPlan {
    /// Records of six gyros and accelerometers each.
    pub records: u64,
    /// Length of a record, s.
    pub seconds: f64,
    pub first_seed: u64,
    pub jobs: usize,
}

/// The report of one record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContradictedRecord {
    pub seed: u64,
    /// Every sentence under "Contradicted".
    pub sentences: Vec<String>,
}

/// The records, in the order of their seeds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContradictionTable {
    pub records: Vec<ContradictedRecord>,
}

impl ContradictionPlan {
    /// Generates and analyses every record; `progress` gets the numbers of finished and of all records.
    ///
    /// # Errors
    /// The error of the first record without a time base.
    pub fn run(&self, progress: impl Fn(usize, usize) + Sync) -> Result<ContradictionTable, ScoreError> {
        let seeds: Vec<u64> = (self.first_seed..self.first_seed + self.records).collect();
        let work = |&seed: &u64| {
            let mut drawn = DrawnRecording::from_group(RecordingGroup::Nothing, self.seconds, seed);
            drawn.simulation.scenario = SensorScenario::default();
            let mut recording = drawn.simulation.record();
            recording.channels.retain(|channel| Channel::INERTIAL.contains(channel));
            let samples = measurement(&recording, None).map_err(|reason| ScoreError::Timeline { seed, reason })?;
            let sentences = reports::summary::contradictions(&analyze(&samples));
            Ok(ContradictedRecord { seed, sentences })
        };
        Ok(ContradictionTable { records: parallel::map(&seeds, self.jobs, work, progress)? })
    }
}

impl ContradictionTable {
    /// Writes the share of records with each sentence, and its count; an unknown sentence is written in full.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let all = self.records.len();
        writeln!(out, "Sentences under \"Contradicted\", nothing hidden, {all} records\n")?;
        writeln!(out, "{:<64}{:>10}{:>12}{:>12}", "", "records", "", "sentences")?;
        let mut row = |title: &str, is_it: &dyn Fn(&str) -> bool| {
            let of = |record: &ContradictedRecord| record.sentences.iter().filter(|sentence| is_it(sentence)).count();
            let records = self.records.iter().filter(|record| of(record) > 0).count();
            let sentences: usize = self.records.iter().map(of).sum();
            let percent = format!("{:.1} %", 100.0 * records as f64 / all.max(1) as f64);
            writeln!(out, "{title:<64}{:>10}{percent:>12}{sentences:>12}", format!("{records}/{all}"))
        };
        for (part, title) in SENTENCES {
            row(title, &|sentence| sentence.contains(part))?;
        }
        row("any", &|_| true)?;
        let is_unknown = |sentence: &&String| SENTENCES.iter().all(|(part, _)| !sentence.contains(part));
        for sentence in self.records.iter().flat_map(|record| &record.sentences).filter(is_unknown) {
            writeln!(out, "  not in the table: {sentence}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sentence_is_counted_once_and_an_unknown_one_is_printed() {
        let sentences = |of: &[&str]| of.iter().map(|sentence| (*sentence).to_owned()).collect();
        let records = vec![
            ContradictedRecord { seed: 1, sentences: Vec::new() },
            ContradictedRecord {
                seed: 2,
                sentences: sentences(&[
                    "gyro z at τ = 80 s: σ is 9.0 % above the model (4.0 standard errors)",
                    "gyro x at τ = 8 s: σ is 2.0 times the model (50 standard errors)",
                    "a new sentence",
                ]),
            },
        ];
        let mut text = Vec::new();
        ContradictionTable { records }.write(&mut text).expect("text");
        let text = String::from_utf8(text).expect("text");
        let row = |title: &str| {
            let line = text.lines().find(|line| line.contains(title)).unwrap_or_else(|| panic!("{title}: {text}"));
            line.split_whitespace().rev().take(4).map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(row("standard errors"), ["2", "%", "50.0", "1/2"]);
        assert_eq!(row("smaller error"), ["0", "%", "0.0", "0/2"]);
        assert!(text.contains("not in the table: a new sentence"), "{text}");
    }
}
