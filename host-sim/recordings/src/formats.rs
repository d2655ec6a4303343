//! Files of any sensor, by format.

mod ardupilot_log;
pub mod file_format;
mod imu_message;
mod matlab;
mod mcap_file;
mod message_table;
mod named_arrays;
pub(crate) mod numpy;
mod ros_bag;
pub(crate) mod text_table;
mod ulog;
