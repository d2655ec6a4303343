//! Formats of files.

mod ardupilot_log;
mod array_topics;
mod calendar;
mod fields;
pub(crate) mod file_format;
mod foreign_format;
#[cfg(feature = "hdf5")]
mod hdf5;
mod labelled_row;
pub(crate) mod matlab;
mod mcap_bag;
mod mcap_file;
pub(crate) mod memory_table;
mod message_layout;
mod nmea;
pub(crate) mod numpy;
pub(crate) mod numpy_header;
mod records;
mod ros_bag;
mod ros_definition;
mod ros_message;
mod row_kinds;
pub(crate) mod split_bag;
#[cfg(feature = "sqlite")]
mod sqlite_bag;
mod table_head;
pub(crate) mod text_table;
mod topics;
mod ulog;
