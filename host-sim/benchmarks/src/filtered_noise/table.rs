//! Bias and coverage of N, B and K behind each filter.

use serde::Serialize;

/// An estimate with 95 % bounds; the value and the lower bound are 0 if it is not significant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FilteredCoefficient {
    pub truth: f64,
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

/// One channel of a report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilteredChannel {
    pub seed: u64,
    pub channel: &'static str,
    /// Taps and decimation in the model.
    pub filter: Option<[f64; 2]>,
    /// N, B and K with their truth, if the model has them.
    pub coefficients: [Option<FilteredCoefficient>; 3],
    /// Named effects other than the filter itself.
    pub named: Vec<String>,
}

/// The channels of one filter and decimation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilterCell {
    /// Taps of each of the two averages.
    pub taps: usize,
    /// Decimation: 1 if every value is read.
    pub every: usize,
    pub channels: Vec<FilteredChannel>,
}

/// The result of the benchmark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilteredNoiseTable {
    pub cells: Vec<FilterCell>,
}
