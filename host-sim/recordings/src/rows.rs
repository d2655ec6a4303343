//! What every format becomes: rows, batches of columns, and all columns of a file as they are.

pub mod any_sensor;
pub(crate) mod batch;
pub(crate) mod padding;
pub(crate) mod quantizer;
pub mod recording;
pub(crate) mod row_source;
pub(crate) mod whole_table;
