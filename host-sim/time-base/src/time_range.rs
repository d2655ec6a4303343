//! A part of a recording by time.

/// From `from_s` to before `to_s`, s from the first sample; by stamps, else by number and stated rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeRange {
    pub from_s: f64,
    pub to_s: f64,
}

impl TimeRange {
    /// Between two stated times; `None` where neither is.
    #[must_use]
    pub fn between(from_s: Option<f64>, to_s: Option<f64>) -> Option<Self> {
        let is_part = from_s.is_some() || to_s.is_some();
        is_part.then(|| Self { from_s: from_s.unwrap_or(0.0), to_s: to_s.unwrap_or(f64::INFINITY) })
    }

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
