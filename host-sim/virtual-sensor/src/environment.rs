//! The environment of the part: temperature, supply voltage and motion. Each is a profile over time that the part's own
//! outputs show.

use crate::noise::{GaussMarkovProcess, TelegraphProcess};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// Temperature, supply voltage and specific force over time, as deviations from the constant values of the noise model.
/// All are constant by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Environment {
    /// Temperature of the part.
    pub temperature: TemperatureProfile,
    /// Supply voltage of the part.
    pub supply: SupplyProfile,
    /// Specific force along x, y and z.
    pub motion: Motion,
}

/// Warm-up after power-on, `rise_c·(1 − exp(−t/time_constant_s))`, and the cycle of a heated room,
/// `cycle_c·sin(2πt/period_s)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TemperatureProfile {
    /// Final rise of the warm-up, °C.
    pub rise_c: f64,
    /// Time constant of the warm-up, s.
    pub time_constant_s: f64,
    /// Amplitude of the cycle, °C.
    pub cycle_c: f64,
    /// Period of the cycle, s.
    pub period_s: f64,
}

impl Default for TemperatureProfile {
    /// A constant temperature.
    fn default() -> Self {
        Self { rise_c: 0.0, time_constant_s: 600.0, cycle_c: 0.0, period_s: 900.0 }
    }
}

/// A load that is switched at random times, and a cycle `cycle_v·sin(2πt/period_s)` of the source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupplyProfile {
    /// Difference of the voltage with and without the load, V.
    pub load_v: f64,
    /// Correlation time of the load, s; half of the mean time between its switches.
    pub load_time_s: f64,
    /// Amplitude of the cycle, V.
    pub cycle_v: f64,
    /// Period of the cycle, s.
    pub period_s: f64,
}

impl Default for SupplyProfile {
    /// A constant voltage.
    fn default() -> Self {
        Self { load_v: 0.0, load_time_s: 30.0, cycle_v: 0.0, period_s: 400.0 }
    }
}

/// Linear motion without rotation: Gauss-Markov specific force, independent along the three axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Standard deviation along each axis, g.
    pub deviation_g: f64,
    /// Correlation time, s.
    pub time_constant_s: f64,
}

impl Default for Motion {
    /// The part is at rest.
    fn default() -> Self {
        Self { deviation_g: 0.0, time_constant_s: 5.0 }
    }
}

/// The environment at one instant, as deviations from the constant values of the noise model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EnvironmentState {
    pub(crate) temperature_c: f64,
    pub(crate) supply_v: f64,
    /// Specific force along x, y and z, g.
    pub(crate) force_g: [f64; 3],
}

/// Generates the states of an environment, sample by sample.
#[derive(Clone, Debug)]
pub(crate) struct EnvironmentSource {
    environment: Environment,
    load: TelegraphProcess,
    force: [GaussMarkovProcess; 3],
    random: ChaCha8Rng,
}

impl EnvironmentSource {
    pub(crate) fn new(environment: Environment, random: ChaCha8Rng) -> Self {
        Self {
            environment,
            load: TelegraphProcess::new(environment.supply.load_time_s),
            force: std::array::from_fn(|_| GaussMarkovProcess::new(environment.motion.time_constant_s)),
            random,
        }
    }

    /// The state at `time_s`, one period after the previous state. Processes of size 0 draw no random numbers.
    pub(crate) fn next(&mut self, time_s: f64, period_s: f64) -> EnvironmentState {
        let Environment { temperature, supply, motion } = self.environment;
        let cycle = |period_s: f64| (2.0 * PI * time_s / period_s).sin();
        let warm_up = -(-time_s / temperature.time_constant_s).exp_m1();
        let load = if supply.load_v == 0.0 { 0.0 } else { self.load.next(period_s, &mut self.random) };
        let force_g = if motion.deviation_g == 0.0 {
            [0.0; 3]
        } else {
            self.force.each_mut().map(|axis| motion.deviation_g * axis.next(period_s, &mut self.random))
        };
        EnvironmentState {
            temperature_c: temperature.rise_c * warm_up + temperature.cycle_c * cycle(temperature.period_s),
            supply_v: supply.load_v * load + supply.cycle_v * cycle(supply.period_s),
            force_g,
        }
    }
}
