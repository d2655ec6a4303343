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

impl TimeRange {
    /// The part between tenths of a second inside of it.
    #[must_use]
    pub fn whole_tenths(self) -> Self {
        // A tenth is none in binary; what rounds up to 0 from below is −0, which the sum is not.
        const ROUNDING: f64 = 1e-6;
        Self {
            from_s: (10.0 * self.from_s - ROUNDING).ceil() / 10.0 + 0.0,
            to_s: (10.0 * self.to_s + ROUNDING).floor() / 10.0,
        }
    }
}
