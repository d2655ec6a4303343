//! Rows, batches, and whole columns.

pub(crate) mod batch;
pub(crate) mod padding;
pub(crate) mod quantizer;
pub(crate) mod row_source;
pub(crate) mod whole_table;
