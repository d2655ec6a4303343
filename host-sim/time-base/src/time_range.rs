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
    /// The part between two times that are stated; `None` for all of a recording, where neither is.
    #[must_use]
    pub fn between(from_s: Option<f64>, to_s: Option<f64>) -> Option<Self> {
        let is_part = from_s.is_some() || to_s.is_some();
        is_part.then(|| Self { from_s: from_s.unwrap_or(0.0), to_s: to_s.unwrap_or(f64::INFINITY) })
    }

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
