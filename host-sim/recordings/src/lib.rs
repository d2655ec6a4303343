//! Recordings of inertial sensors, and the time base of the samples: of an ADIS16405 as tables of register counts, SPI frame
//! logs and from the serial port; of [any sensor](any_sensor) in the formats that [`file_format`] recognises.
//!
//! Every format becomes batches of columns, which [`sample_stream`] places in time and turns into counts. A row that cannot be used is an
//! [`InputError`] with the file, the line and the reason, or is left out and counted. [`time_base::measurement`] does the same with a
//! [`Recording`](recording::Recording) in memory.

mod columns;
mod counts;
mod formats;
mod input;
pub mod inspection;
mod reading;
mod rows;
pub mod time_base;

pub use columns::column_selection::{ColumnSelection, SelectionError};
pub use counts::{count_table_writer, frame_log, numpy_matrix, recorded_file, serial, spi_export};
pub use formats::file_format;
pub use input::file_bytes::FileBytes;
pub use input::file_hash::FileHash;
pub use input::input_error::{InputError, Printable, Reason};
pub use input::read_monitor::{ReadMonitor, ReadPass};
pub use reading::{count_table, row_writer, sample_stream};
pub use rows::{any_sensor, recording};
