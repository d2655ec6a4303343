//! Recordings of inertial sensors, and the time base of the samples: of an ADIS16405 as tables of register counts, SPI frame
//! logs and from the serial port; of [any sensor](any_sensor) in the formats that [`file_format`] recognises.
//!
//! Each format is checked where it is read: a [`Recording`](recording::Recording) holds only counts that fit their register
//! field and time stamps that do not decrease. Everything else is an [`InputError`] with the file, the line and the reason.
//! [`time_base::measurement`] turns a recording into the [`Measurement`](measurement::Measurement) that is analysed.

pub mod any_sensor;
mod ardupilot_log;
mod channel_health;
mod column_selection;
mod count_stream;
pub mod count_table;
pub mod count_table_writer;
mod delimited_text;
pub mod file_format;
pub mod frame_log;
mod gzip_members;
mod imu_message;
mod indexed_clock;
mod input_error;
mod lateness_track;
mod lower_envelope;
mod matlab;
mod mcap_file;
mod message_table;
mod named_arrays;
mod numpy;
pub mod numpy_matrix;
mod quantizer;
mod read_ahead;
mod read_monitor;
mod recorded_blocks;
pub mod recorded_file;
pub mod recording;
mod ros_bag;
mod sample_slots;
pub mod sample_stream;
mod sensor_measurement;
mod sensor_table;
mod sensor_table_writer;
pub mod serial;
pub mod spi_export;
mod stamp_alignment;
mod stamp_quality;
mod stamp_tick;
mod stream_clock;
mod text_table;
pub mod time_base;
mod time_base_error;
mod ulog;
mod unit;
mod value_stream;

pub use column_selection::{ColumnSelection, SelectionError};
pub use input_error::{InputError, Printable, Reason};
pub use read_monitor::{ReadMonitor, ReadPass};
