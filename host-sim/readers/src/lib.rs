//! Readers of recordings of inertial sensors: text, NumPy, MATLAB, HDF5, ROS bags, MCAP, flight logs.
//!
//! [`InputFile`] recognises a format by content; every format becomes batches of columns ([`FileRows`]) as the file or
//! the user ([`RowOptions`]) says.

mod columns;
mod formats;
mod input;
pub mod inspection;
mod rows;

pub use columns::column_selection::{ColumnSelection, RowOptions, SelectionError, is_output_register};
pub use columns::printable::Printable;
pub use columns::sensor::{SensorChannel, SensorChannels};
pub use columns::{ACCELEROMETER, GYROSCOPE, MAGNETOMETER};
pub use formats::file_format::{FileFormat, HEAD_BYTES, InputFile, TopicDescription, files_of_bag};
pub use formats::memory_table::{MemoryArray, MemoryColumn, MemoryTable};
pub use input::delimited_text;
pub use input::file_bytes::{FileBytes, OpenBytes};
pub use input::file_hash::FileHash;
pub use input::input_error::{InputError, Reason, StreamError};
pub use input::read_monitor::{ReadMonitor, ReadPass};
pub use input::threads::{may_begin_threads, read_on_one_thread};
pub use rows::batch::{Batch, Number, RegisterField, RowBefore, ValueColumn};
pub use rows::padding::{PaddingFinder, Unpadded};
pub use rows::quantizer::ColumnQuantizer;
pub use rows::row_source::{BATCH, FileRows, PartFilter, RowsRead, WantedRows};
pub use rows::whole_table::MAX_SAMPLES;
