//! Result of an alignment: period of each sample, losses, rate.

use crate::lateness_track::LostStretch;

/// Sample rate with its interval by the stamps' clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateEstimate {
    /// Least-squares slope, Hz.
    pub hz: f64,
    /// Lower end, Hz.
    pub low_hz: f64,
    /// Upper end, Hz.
    pub high_hz: f64,
}

pub(crate) struct AlignedStamps {
    /// From the first; grows by at least one.
    pub(crate) periods: Vec<u64>,
    /// A period or more behind the others.
    pub(crate) late: Vec<bool>,
    pub(crate) losses: Vec<LostStretch>,
    /// `None` without a time span.
    pub(crate) rate: Option<RateEstimate>,
    /// Common step of the stamps, s; `None` far below the period.
    pub(crate) tick_s: Option<f64>,
    /// Lateness of ordinary samples, periods.
    pub(crate) width: f64,
    /// True if single losses are told from rounding.
    pub(crate) resolved: bool,
    pub(crate) least_loss: u64,
    /// Beyond what a track follows; the interval is then the range.
    pub(crate) is_rate_changing: bool,
    pub(crate) is_of_loop: bool,
}
