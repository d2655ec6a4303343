//! Time base of a recording: its sample rate, and the sample period in which each sample was taken.
//!
//! A sample that was read late is not a lost sample, and stamps that are coarser than the sample period are no losses:
//! a loss is counted only where nothing else explains the stamps. What they cannot tell is said in [`StampQuality`].

mod aligned_stamps;
pub(crate) mod clock;
mod clock_rate;
mod indexed_clock;
mod irregular_stamps;
pub(crate) mod lateness_track;
mod lower_envelope;
mod stamp_alignment;
pub(crate) mod stamp_order;
pub(crate) mod stamp_quality;
mod stamp_tick;
pub(crate) mod stream_clock;
pub(crate) mod time_base_error;
pub(crate) mod time_range;

pub use crate::reading::sample_stream::{EstimatedTimeBase, measurement, time_base};
pub use crate::time_base::aligned_stamps::RateEstimate;
pub use crate::time_base::indexed_clock::ClockStep;
pub use crate::time_base::lateness_track::LostStretch;
pub use crate::time_base::stamp_quality::StampQuality;
pub use crate::time_base::time_base_error::TimeBaseError;
pub use crate::time_base::time_range::TimeRange;
