//! Which effects explain what a channel shows, and which findings of several channels are one cause.

pub(crate) mod causes;
pub(crate) mod motion;
pub(crate) mod naming;
pub(crate) mod slow_drift;
pub(crate) mod unexplained;
pub(crate) mod unexplained_signals;
