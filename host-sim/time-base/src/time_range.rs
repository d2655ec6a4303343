//! A part of a recording by time.

/// A part of a recording, s from its first sample: what comes at `from_s` or later and before `to_s`; by the time stamps, without by the
/// number of the sample and the stated rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeRange {
    /// Its beginning.
    pub from_s: f64,
    /// Its end, which may be infinite.
    pub to_s: f64,
}
