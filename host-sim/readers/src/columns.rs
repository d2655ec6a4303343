//! Columns of a recording: names, choice, units.

pub(crate) mod column_selection;
pub(crate) mod printable;
pub(crate) mod sensor;
pub(crate) mod unit;

/// Those of a gyroscope.
pub const GYROSCOPE: [&str; 3] = ["gyro_x", "gyro_y", "gyro_z"];
/// Those of an accelerometer.
pub const ACCELEROMETER: [&str; 3] = ["accl_x", "accl_y", "accl_z"];
/// Those of a magnetometer.
pub const MAGNETOMETER: [&str; 3] = ["magn_x", "magn_y", "magn_z"];
