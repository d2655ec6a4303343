//! Columns of a recording: names, choice, units.

mod column_selection;
mod printable;
mod reading_note;
mod sensor;
mod unit;

pub(crate) use column_selection::{AvailableColumn, ChosenColumn, Role, as_they_are, known_by_name};
pub use column_selection::{ColumnSelection, RowOptions, SelectionError, is_output_register};
pub use printable::Printable;
pub use reading_note::ReadingNote;
pub(crate) use sensor::INERTIAL;
pub use sensor::{SensorChannel, SensorChannels};
pub(crate) use unit::{COUNT, SECOND, Unit};

pub const GYROSCOPE: [&str; 3] = ["gyro_x", "gyro_y", "gyro_z"];
pub const ACCELEROMETER: [&str; 3] = ["accl_x", "accl_y", "accl_z"];
pub const MAGNETOMETER: [&str; 3] = ["magn_x", "magn_y", "magn_z"];
