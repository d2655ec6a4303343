//! Recordings of inertial sensors, and the time base of the samples: of an ADIS16405 as tables of register counts, SPI frame
//! logs and from the serial port; of [any sensor](any_sensor) in the formats that [`file_format`] recognises.
//!
//! Each format is checked where it is read: a [`Recording`](recording::Recording) holds only counts that fit their register
//! field and time stamps that do not decrease. Everything else is an [`InputError`] with the file, the line and the reason.
//! [`time_base::measurement`] turns a recording into the [`Measurement`](measurement::Measurement) that is analysed.

mod columns;
mod counts;
mod formats;
mod input;
pub mod inspection;
mod reading;
mod tables;
pub mod time_base;

pub use columns::column_selection::{ColumnSelection, SelectionError};
pub use counts::{
    count_table, count_table_writer, frame_log, numpy_matrix, recorded_file, recording, serial, spi_export,
};
pub use formats::file_format;
pub use input::input_error::{InputError, Printable, Reason};
pub use input::read_monitor::{ReadMonitor, ReadPass};
pub use reading::{row_writer, sample_stream};
pub use tables::any_sensor;
