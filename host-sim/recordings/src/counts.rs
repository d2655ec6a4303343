//! ADIS16405 recordings in register counts: tables, bus logs, serial port.

pub mod count_table_writer;
pub mod frame_log;
pub mod numpy_matrix;
pub mod recorded_file;
pub mod serial;
