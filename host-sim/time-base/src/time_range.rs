//! A part of a recording by time.

/// From `from_s` to before `to_s`, s from the first sample; by stamps, else by number and stated rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeRange {
    pub from_s: f64,
    pub to_s: f64,
}

impl TimeRange {
    /// Tenths of a second inside of it.
    #[must_use]
    pub fn whole_tenths(self) -> Self {
        // A tenth is not exact in binary; −0 becomes 0.
        const ROUNDING: f64 = 1e-6;
        Self {
            from_s: (10.0 * self.from_s - ROUNDING).ceil() / 10.0 + 0.0,
            to_s: (10.0 * self.to_s + ROUNDING).floor() / 10.0,
        }
    }
}
