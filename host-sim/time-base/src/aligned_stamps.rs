//! Facts from time stamps: the period of each sample, the losses and the rate.

use crate::lateness_track::LostStretch;

/// A sample rate with the interval that the time stamps leave it, by the clock that stamped them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateEstimate {
    /// Least-squares slope of the sample periods over the time stamps, Hz.
    pub hz: f64,
    /// Lower end, Hz.
    pub low_hz: f64,
    /// Upper end, Hz.
    pub high_hz: f64,
}

/// Time stamps on sample periods.
pub(crate) struct AlignedStamps {
    /// Period of each sample, counted from the first; grows by at least one a sample.
    pub(crate) periods: Vec<u64>,
    /// Samples that were read a period or more after the others.
    pub(crate) late: Vec<bool>,
    /// The losses, in their order.
    pub(crate) losses: Vec<LostStretch>,
    /// The rate; `None` if the samples span no time.
    pub(crate) rate: Option<RateEstimate>,
    /// Smallest step of the stamps that all of them are multiples of, s; `None` where it is far below the period.
    pub(crate) tick_s: Option<f64>,
    /// Width of the lateness of ordinary samples, periods.
    pub(crate) width: f64,
    /// True if single losses are told from the rounding of the stamps.
    pub(crate) resolved: bool,
    /// The shortest loss that is told from late delivery, samples.
    pub(crate) least_loss: u64,
    /// True if the rate changes by more than a track follows; its interval is then the range that it takes.
    pub(crate) is_rate_changing: bool,
    /// True if a loop wrote them that asks for samples when it has time.
    pub(crate) is_of_loop: bool,
}
