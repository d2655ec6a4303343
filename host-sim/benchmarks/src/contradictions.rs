//! Benchmark of the sentences on a model that is off, in reports of pure N, B and K in a constant environment.

use crate::arguments::{MOST_RECORDINGS, cores, jobs, positive};
use crate::parallel;
use crate::undeclared::{DrawnRecording, RecordingGroup, SEEDS_PER_GROUP, ScoreError};
use adis16405_driver::Channel;
use clap::{Args, value_parser};
use noise_analysis::analysis::analyze;
use recordings::time_base::measurement;
use serde::Serialize;
use virtual_sensor::SensorScenario;

/// Count the sentences on places where data and model disagree, in the reports of noise with nothing hidden.
#[derive(Debug, Clone, Copy, PartialEq, Args)]
pub struct ContradictionPlan {
    /// Records of six gyros and accelerometers each.
    #[arg(long, default_value_t = 200, value_parser = value_parser!(u64).range(1..=MOST_RECORDINGS))]
    pub records: u64,
    /// Length of a record, s.
    #[arg(long, default_value_t = 900.0, value_parser = positive)]
    pub seconds: f64,
    /// Seed of the first record.
    #[arg(long = "seed", default_value_t = 0, value_parser = value_parser!(u64).range(..SEEDS_PER_GROUP / 2))]
    pub first_seed: u64,
    /// Records that are examined at a time [default: one a core].
    #[arg(long, default_value_t = cores(), value_parser = jobs, hide_default_value = true)]
    pub jobs: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContradictedRecord {
    pub seed: u64,
    /// Every sentence on a place where data and model disagree.
    pub sentences: Vec<String>,
}

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
