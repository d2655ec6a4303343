//! Time base of a recording: its sample rate, and the sample period in which each sample was taken.
//!
//! A sample that was read late is not a lost sample, and stamps that are coarser than the sample period are no losses:
//! a loss is counted only where nothing else explains the stamps. [`StampQuality`] has the limits.
//!
//! [`StampOrder`] takes stamps as a file has them, of counters that wrap and clocks that are set; [`Clock`] finds the sample period of
//! each row by its stamp and its index.

mod aligned_stamps;
mod clock;
mod clock_rate;
mod indexed_clock;
mod irregular_stamps;
mod lateness_track;
mod lower_envelope;
mod stamp_alignment;
mod stamp_order;
mod stamp_quality;
mod stamp_tick;
mod stream_clock;
mod time_base_error;
mod time_range;

pub use aligned_stamps::RateEstimate;
pub use clock::{Clock, Place, RowStamp};
pub use indexed_clock::ClockStep;
pub use lateness_track::{LostStretch, quantile};
pub use stamp_order::{Order, ROWS_OF_FIRST, ROWS_OF_SET_CLOCK, StampOrder};
pub use stamp_quality::StampQuality;
pub use stream_clock::Placed;
pub use time_base_error::TimeBaseError;
pub use time_range::TimeRange;
