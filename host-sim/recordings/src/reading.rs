//! From a file to the samples that are analysed: rows, batches of columns, their time base, and counts.

pub(crate) mod batch;
pub(crate) mod column_survey;
pub(crate) mod full_scale;
pub(crate) mod padding;
pub(crate) mod quantizer;
pub(crate) mod row_source;
pub mod row_writer;
pub mod sample_stream;
