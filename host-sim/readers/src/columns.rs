//! Columns of a recording: names, choice, units.

pub(crate) mod axes;
pub(crate) mod column_selection;
pub(crate) mod unit;
