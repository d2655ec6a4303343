//! Where samples come from: files of counts and logs of bus transactions, plain or gzip.
//!
//! This is the border at which a file is checked. What a reader returns holds only counts that fit their field and
//! clocks that do not run backwards; everything else is an [`InputError`] that names the place.

pub mod csv;
pub mod folder;
pub mod frame_log;
mod input_error;
mod open;
mod table;

pub use input_error::{InputError, Reason};
pub use open::{Input, is_frame_log, open};
