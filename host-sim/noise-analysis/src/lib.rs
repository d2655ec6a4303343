//! Noise analysis: from a recording to findings.

pub mod analysis;
pub mod distributions;
pub mod explain;
pub mod findings;
pub mod grid;
pub mod innovation;
pub mod navigation;
pub mod practice;
pub mod record_length;
pub mod report;
pub mod series;
pub mod spectrum;
pub mod time_course;
pub mod trace;
pub mod units;
