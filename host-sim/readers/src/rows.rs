//! The result of every format: rows, batches of columns, and all columns of a file as they are.

pub(crate) mod any_sensor;
pub(crate) mod batch;
pub(crate) mod padding;
pub(crate) mod quantizer;
pub(crate) mod row_source;
pub(crate) mod whole_table;
