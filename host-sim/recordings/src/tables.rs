//! Rows of any inertial sensor, in the units of the file or in SI units.

pub mod any_sensor;
mod channel_health;
pub(crate) mod quantizer;
pub(crate) mod sensor_measurement;
pub(crate) mod sensor_table;
mod sensor_table_writer;
pub(crate) mod whole_table;
