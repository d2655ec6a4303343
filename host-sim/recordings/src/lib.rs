//! Recordings of an ADIS16405: tables of register counts, SPI frame logs, the serial port, and the time base of the samples.
//!
//! Each format is checked where it is read: a [`Recording`](recording::Recording) holds only counts that fit their register
//! field and time stamps that do not decrease. Everything else is an [`InputError`] with the file, the line and the reason.
//! [`time_base::measurement`] turns a recording into the [`Measurement`](measurement::Measurement) that is analysed.

pub mod count_table;
mod delimited_text;
pub mod frame_log;
mod gzip_members;
mod indexed_clock;
mod input_error;
mod lateness_track;
mod lower_envelope;
pub mod recorded_file;
pub mod recording;
pub mod serial;
mod stamp_alignment;
mod stamp_tick;
pub mod time_base;

pub use input_error::{InputError, Printable, Reason};
