//! The sensors of the emulated boards.

use serde::{Deserialize, Serialize};
use virtual_sensor::{
    Environment, InjectedEffect, NoiseModel, OutputRegister, SensorScenario, TemperatureProfile, VirtualAdis16405,
};

/// The sensor of a run.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub enum Sensor {
    /// A part with the noise of the published characterisation and this seed.
    Published(u64),
    /// The part [`warming_part`] without an effect.
    Warming,
    /// The part [`warming_part`] with [`four_effects`].
    WarmingWithFourEffects,
}

impl Sensor {
    /// The virtual part of this sensor.
    pub fn part(self) -> VirtualAdis16405 {
        match self {
            Self::Published(seed) => VirtualAdis16405::new(NoiseModel::paper(), seed),
            Self::Warming => warming_part(vec![]),
            Self::WarmingWithFourEffects => warming_part(four_effects()),
        }
    }
}

pub const EPOCH_S: f64 = 60.0;
pub const RATE_HZ: f64 = 204.8;
/// Sensitivity of gyro x to temperature, deg/s/°C.
pub const SENSITIVITY: f64 = 0.05;
/// Size of the steps of accelerometer x, g.
pub const STEP_G: f64 = 0.05;
/// Frequency of the line on gyro z, Hz.
pub const LINE_HZ: f64 = 20.5;

/// A part with `effects` that warms up by 8 °C in a room whose temperature cycles with a period of 20 s, so that an epoch has three cycles.
/// A sensitivity of [`SENSITIVITY`] is then as significant as 7.6 standard deviations, and 4.5 are required (derived in
/// `simulation/tests/epochs.rs`, and found in 40 of 40 epochs there).
pub fn warming_part(effects: Vec<InjectedEffect>) -> VirtualAdis16405 {
    let temperature = TemperatureProfile { rise_c: 8.0, time_constant_s: 60.0, cycle_c: 3.0, period_s: 20.0 };
    let environment = Environment { temperature, ..Environment::default() };
    let scenario = SensorScenario { environment, effects };
    VirtualAdis16405::with_scenario(&scenario, NoiseModel::paper(), 1)
}

/// A temperature effect on gyro x, a Gauss-Markov process on gyro y, a line on gyro z, and a step in each of two epochs on accelerometer x.
///
/// A process with the time constant T and the deviation s has an Allan deviation of at most 0.62·s, at 1.9·T (IEEE Std
/// 952: 0.437·q·√T, with q = s·√(2/T)). This is 0.25 deg/s at 0.38 s, four times the white noise there. It is named in
/// 40 of 40 epochs (`simulation/tests/epochs.rs`).
pub fn four_effects() -> Vec<InjectedEffect> {
    let step = |time_s| InjectedEffect::BiasStep { channel: OutputRegister::AcclX, time_s, size: STEP_G };
    vec![
        InjectedEffect::Temperature { channel: OutputRegister::GyroX, sensitivity: SENSITIVITY },
        InjectedEffect::Markov { channel: OutputRegister::GyroY, time_constant_s: 0.2, deviation: 0.4 },
        InjectedEffect::Sinusoid {
            channel: OutputRegister::GyroZ,
            frequency_hz: LINE_HZ,
            amplitude: 0.4,
            phase_rad: 0.0,
        },
        step(0.5 * EPOCH_S),
        step(1.5 * EPOCH_S),
    ]
}
