//! From a file to the samples that are analysed, and to what is written anew: batches of columns, their time base, and counts.

pub(crate) mod column_survey;
pub mod count_table;
pub(crate) mod full_scale;
pub mod row_writer;
pub mod sample_stream;
