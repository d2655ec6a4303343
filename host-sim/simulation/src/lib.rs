//! The driver, or the whole firmware, on the virtual sensor or on a replayed recording.

pub mod device;
pub mod record;
pub mod replay;
