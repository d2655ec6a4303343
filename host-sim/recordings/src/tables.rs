//! How a recording is read, and its columns as they are.

pub mod any_sensor;
pub(crate) mod whole_table;
