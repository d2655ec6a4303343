//! The driver, or the whole firmware, on the virtual sensor or on a replayed recording.

mod channels;
pub mod device;
pub mod record;
pub mod replay;

pub use channels::{channel, output_register};
