//! Channels of a sensor, as far as their reading needs them.

use crate::columns::{ACCELEROMETER, GYROSCOPE, MAGNETOMETER};

/// Units of angular rates and specific forces.
pub(crate) const INERTIAL: [&str; 2] = ["deg/s", "g"];

#[derive(Debug, Clone, PartialEq)]
pub struct SensorChannels {
    pub name: &'static str,
    /// In the order of their reading.
    pub channels: Vec<SensorChannel>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorChannel {
    /// Such as `gyro_x`.
    pub name: &'static str,
    /// Unit in which it is read: deg/s, g, gauss, degC or V.
    pub unit: &'static str,
    /// Size of one count, in `unit`; `None` if unknown.
    pub lsb: Option<f64>,
}

impl SensorChannel {
    pub(crate) fn is_inertial(self) -> bool {
        INERTIAL.contains(&self.unit)
    }
}

impl SensorChannels {
    /// Any inertial sensor: three gyroscopes, accelerometers and magnetometers, temperature, supply and ADC.
    #[must_use]
    pub fn generic() -> Self {
        let axes = [(GYROSCOPE, "deg/s"), (ACCELEROMETER, "g"), (MAGNETOMETER, "gauss")];
        let axes = axes.into_iter().flat_map(|(names, unit)| names.map(|name| (name, unit)));
        let channels = axes.chain([("temp", "degC"), ("supply", "V"), ("aux_adc", "V")]);
        let channels = channels.map(|(name, unit)| SensorChannel { name, unit, lsb: None });
        Self { name: "generic", channels: channels.collect() }
    }

    #[must_use]
    pub fn channel(&self, name: &str) -> Option<SensorChannel> {
        self.channels.iter().copied().find(|channel| channel.name == name)
    }
}
