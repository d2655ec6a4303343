//! Rows, batches, and whole columns.

mod batch;
mod padding;
mod quantizer;
mod row_source;
mod whole_table;

pub use batch::{Batch, Number, RegisterField, RowBefore, ValueColumn};
pub(crate) use batch::{BatchBuilder, HELD_ROWS, RowFault, usual_unit};
pub use padding::{PaddingFinder, Unpadded};
pub use quantizer::ColumnQuantizer;
pub(crate) use quantizer::{MEDIAN_OF_NORMAL, difference_noise, noise_at_lag, step};
pub use row_source::{BATCH, FileRows, PartFilter, RowsRead, WantedRows};
pub(crate) use row_source::{EachRow, Ending, Refusal, RowSource};
pub use whole_table::MAX_SAMPLES;
pub(crate) use whole_table::{TopicSensor, WholeColumn, WholeTable};
