#![doc = include_str!("../README.md")]

mod columns;
mod formats;
mod input;
pub mod inspection;
mod rows;

pub use columns::{
    ACCELEROMETER, ColumnSelection, GYROSCOPE, MAGNETOMETER, Printable, ReadingNote, RowOptions, SelectionError,
    SensorChannel, SensorChannels, is_output_register,
};
pub use formats::file_format::{FileFormat, HEAD_BYTES, InputFile, TopicDescription, files_of_bag};
pub use formats::memory_table::{MemoryArray, MemoryColumn, MemoryTable};
pub use input::{
    FileBytes, FileHash, InputError, OpenBytes, ReadMonitor, ReadPass, Reason, StreamError, delimited_text,
    may_begin_threads, read_on_one_thread,
};
pub use rows::{
    BATCH, Batch, ColumnQuantizer, FileRows, MAX_SAMPLES, Number, PaddingFinder, PartFilter, RegisterField, RowBefore,
    RowsRead, Unpadded, ValueColumn, WantedRows,
};
