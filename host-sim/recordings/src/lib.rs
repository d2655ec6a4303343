//! Recordings of a sensor: tables of counts, SPI frame logs and the serial line, and the time base of their samples.
//!
//! A file is checked where it is read. What a reader returns holds only counts that fit their field and clocks that do
//! not run backwards; everything else is an [`InputError`] that names the file and the line.

pub mod csv;
pub mod folder;
pub mod frame_log;
mod input_error;
mod open;
pub mod recording;
pub mod serial;
mod table;
pub mod timeline;

pub use input_error::{InputError, Reason};
pub use open::{Input, is_frame_log, open};
