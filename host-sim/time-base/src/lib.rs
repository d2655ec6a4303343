#![doc = include_str!("../README.md")]

mod clock;
mod clock_rate;
mod indexed_clock;
mod irregular_stamps;
mod lateness_track;
mod stamp_alignment;
mod stamp_order;
mod stamp_quality;
mod stamp_tick;
mod stream_clock;
mod time_base_error;
mod time_range;

pub use clock::{Clock, Place, RowStamp};
pub use indexed_clock::ClockStep;
pub use lateness_track::{LostStretch, RateEstimate, quantile};
pub use stamp_order::{Order, ROWS_OF_FIRST, ROWS_OF_SET_CLOCK, StampOrder};
pub use stamp_quality::StampQuality;
pub use stream_clock::Placed;
pub use time_base_error::TimeBaseError;
pub use time_range::TimeRange;
