//! Columns of a recording of any sensor: how the user names and chooses them, and their units.

pub(crate) mod axes;
pub(crate) mod column_selection;
pub(crate) mod unit;
