//! Noise analysis: from a recording to findings.

pub mod analysis;
pub mod detectors;
pub mod distributions;
pub mod explain;
pub mod findings;
pub mod innovation;
pub mod navigation;
pub mod practice;
pub mod record_length;
pub mod report;
pub mod series;
pub mod spectra;
pub mod time_course;
pub mod trace;
pub mod uniform_series;
pub mod units;

/// Octaves of every estimator of the analysis: averaging factors up to 2²³ samples. The device uses as many.
pub const OCTAVES: usize = 24;
/// Overlap of the second differences of every estimator of the analysis. The device uses the same.
pub const OVERLAP: usize = 8;
