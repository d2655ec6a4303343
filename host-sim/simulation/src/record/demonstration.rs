//! What the virtual sensor hides unless told not to: something for its report to find.

use virtual_sensor::effect::surroundings::{SupplyCourse, TemperatureCourse};
use virtual_sensor::{Effect, Hidden, OutputRegister, Surroundings};

/// A line on gyro z, as of a motor nearby, and a gyro x that follows the temperature while the part warms up.
pub(super) fn hidden() -> Hidden {
    Hidden {
        surroundings: Surroundings {
            temperature: TemperatureCourse { rise_c: 8.0, time_constant_s: 900.0, cycle_c: 1.0, period_s: 700.0 },
            supply: SupplyCourse { load_v: 0.05, cycle_v: 0.02, ..SupplyCourse::default() },
            ..Surroundings::default()
        },
        effects: vec![
            Effect::Sinusoid { channel: OutputRegister::GyroZ, frequency_hz: 20.5, amplitude: 0.2, phase_rad: 0.0 },
            Effect::Temperature { channel: OutputRegister::GyroX, sensitivity: 0.05 },
        ],
    }
}
