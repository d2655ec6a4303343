//! Which effects explain what a channel shows, and which findings of several channels are one cause.
//!
//! ```text
//! proposals (terms, lines, covariates), signals, motion, unexplained ─► table: what stands ─► causes: one finding a cause
//! ```

mod cause;
pub(crate) mod causes;
pub(crate) mod channel_lines;
pub(crate) mod motion;
pub(crate) mod proposal;
pub(crate) mod proposals;
pub(crate) mod shown_by_samples;
pub(crate) mod signals;
pub(crate) mod slow_drift;
pub mod table;
pub(crate) mod unexplained;
