//! Recordings of inertial sensors on their time base: the ADIS16405 as tables, SPI logs and from the serial port,
//! others in the formats of [`readers`].
//!
//! [`sample_stream`] reads files, [`time_base::measurement`] a [`Recording`](recording::Recording) in memory.

mod batch_source;
mod counts;
pub mod file_format;
mod reading;
pub mod recording;
pub mod time_base;

pub use counts::{count_table_writer, frame_log, numpy_matrix, recorded_file, serial};
pub use file_format::ReadOptions;
pub use readers::{
    ColumnSelection, FileBytes, FileHash, InputError, MemoryArray, MemoryColumn, MemoryTable, Number, Printable,
    ReadMonitor, ReadPass, ReadingNote, Reason, SelectionError, inspection, read_on_one_thread,
};
pub use reading::{count_table, row_writer, sample_stream};
