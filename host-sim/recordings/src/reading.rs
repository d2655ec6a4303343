//! From a file to samples on a time base.

pub(crate) mod column_survey;
pub mod count_table;
pub(crate) mod full_scale;
pub mod row_writer;
pub mod sample_stream;
