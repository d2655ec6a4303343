//! Recordings that are read in blocks.

mod count_stream;
mod recorded_blocks;
pub mod sample_stream;
mod value_stream;
