//! Reasons against a time base.

use std::collections::BTreeMap;

/// One octave: two windows of one sample per half.
pub(crate) const MIN_SAMPLES: u64 = 4;

/// Why a recording has no time base.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TimeBaseError {
    #[error("no sample rate: give --rate HZ, or a recording with a time_s column")]
    NoRate,
    #[error("a sample rate of {0} Hz: it must be positive and finite")]
    InvalidRate(f64),
    #[error("the time stamps show no sample period: give --rate HZ")]
    NoPeriod,
    #[error("--rate {stated_hz} contradicts the time stamps: by them it is {measured_hz:.4} Hz")]
    RateContradictsStamps {
        /// As given, Hz.
        stated_hz: f64,
        /// By the time stamps, Hz.
        measured_hz: f64,
    },
    /// Many rows whose stamps need all of them.
    #[error("the time stamps are too irregular for a recording of this length ({0}): give it in parts")]
    Irregular(String),
    #[error("no two neighbouring samples: a step of the column sample is at least {0}")]
    NoNeighbours(u64),
    #[error(
        "{samples} samples in {periods} sample periods: the gaps are longer than this analysis holds; give each stretch its \
         own file"
    )]
    TooSparse {
        samples: u64,
        /// Sample periods from the first to the last.
        periods: u64,
    },
    #[error("no sample from {} to {} s (--from, --to): the recording has {recording_s:.3} s", short(*.from_s), short(*.to_s))]
    EmptyTimeRange {
        /// Its beginning, s from the first sample.
        from_s: f64,
        /// Its end, s from the first sample.
        to_s: f64,
        /// From the first sample to the last, s.
        recording_s: f64,
    },
    #[error("record too short: {used} usable samples, one octave needs {MIN_SAMPLES}{}", list(.dropped))]
    TooShort {
        /// Samples without a fault for which they are left out.
        used: u64,
        /// Samples that were left out, by cause.
        dropped: BTreeMap<&'static str, u64>,
    },
}

/// As the end of a sentence.
fn list(dropped: &BTreeMap<&'static str, u64>) -> String {
    let causes: Vec<String> = dropped.iter().map(|(cause, count)| format!("{cause} {count}")).collect();
    if causes.is_empty() { String::new() } else { format!("; left out: {}", causes.join(", ")) }
}

/// Many digits as a power of ten.
fn short(time: f64) -> String {
    if time.abs() < 1e15 || time.is_infinite() { time.to_string() } else { format!("{time:e}") }
}
