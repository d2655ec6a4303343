//! Benchmark of the sentences under "Contradicted" in reports of pure N, B and K in a constant environment.

use crate::parallel;
use crate::undeclared::{DrawnRecording, RecordingGroup, ScoreError};
use adis16405_driver::Channel;
use noise_analysis::analysis::analyze;
use recordings::time_base::measurement;
use serde::Serialize;
use virtual_sensor::SensorScenario;

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
