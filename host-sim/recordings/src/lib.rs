//! Recordings of inertial sensors, and the time base of the samples: of an ADIS16405 as tables of register counts, SPI frame
//! logs and from the serial port; of any sensor in the formats that [`readers`] knows.
//!
//! [`sample_stream`] places the rows in time and turns them into counts. A row that cannot be used is an [`InputError`] with the file, the
//! line and the reason, or is left out and counted. [`time_base::measurement`] does the same with a
//! [`Recording`](recording::Recording) in memory.

mod batch_source;
mod counts;
pub mod file_format;
mod reading;
pub mod recording;
pub mod time_base;

pub use counts::{count_table_writer, frame_log, numpy_matrix, recorded_file, serial, spi_export};
pub use readers::{
    ColumnSelection, FileBytes, FileHash, InputError, MemoryArray, MemoryColumn, MemoryTable, Number, Printable,
    ReadMonitor, ReadOptions, ReadPass, Reason, SelectionError, inspection, read_on_one_thread,
};
pub use reading::{count_table, row_writer, sample_stream};
