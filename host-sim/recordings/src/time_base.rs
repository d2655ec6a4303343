//! Samples on their time base.

pub use crate::reading::sample_stream::{EstimatedTimeBase, measurement, time_base};
pub use ::time_base::{ClockStep, LostStretch, RateEstimate, StampQuality, TimeBaseError, TimeRange};
