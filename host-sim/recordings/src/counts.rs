//! Recordings of an ADIS16405 in register counts: tables, logs of the SPI bus, and the serial port.

pub mod count_table_writer;
pub mod frame_log;
pub mod numpy_matrix;
pub mod recorded_file;
pub mod serial;
pub mod spi_export;
