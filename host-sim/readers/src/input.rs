//! Bytes and lines as they are read, and their errors.

mod budget;
pub mod delimited_text;
mod file_bytes;
mod file_hash;
mod gzip_members;
mod input_error;
mod read_ahead;
mod read_monitor;
mod threads;
mod zstd_frames;

pub(crate) use budget::{Budget, Meter, Metered, too_deep};
pub(crate) use delimited_text::{Lines, is_utf16};
pub use file_bytes::{FileBytes, OpenBytes};
pub use file_hash::FileHash;
pub(crate) use gzip_members::{GZIP_MAGIC, GzipMembers};
pub use input_error::{InputError, Reason, StreamError};
pub(crate) use read_ahead::ReadAhead;
pub(crate) use read_monitor::Counted;
pub use read_monitor::{ReadMonitor, ReadPass};
pub use threads::{may_begin_threads, read_on_one_thread};
pub(crate) use zstd_frames::{ZSTD_MAGIC, ZstdFrames};
