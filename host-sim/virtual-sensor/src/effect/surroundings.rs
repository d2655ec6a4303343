//! What happens around the part and shows in its temperature, supply and acceleration outputs.

use super::process::{Markov, Telegraph};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// The courses of temperature, supply and specific force, as deviations from the values of the noise model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// Of the part, °C.
    pub temperature: TemperatureCourse,
    /// Of the part, V.
    pub supply: SupplyCourse,
    /// Specific force along x, y and z.
    pub motion: Motion,
}

/// Warm-up after power-on and a room that is heated in turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TemperatureCourse {
    /// By how much the part warms, °C.
    pub rise_c: f64,
    /// Of the warm-up, s.
    pub time_constant_s: f64,
    /// Amplitude of the room's cycle, °C.
    pub cycle_c: f64,
    /// Of the room's cycle, s.
    pub period_s: f64,
}

impl Default for TemperatureCourse {
    /// Constant.
    fn default() -> Self {
        Self { rise_c: 0.0, time_constant_s: 600.0, cycle_c: 0.0, period_s: 900.0 }
    }
}

/// A load that is switched at random and a source that drifts to and fro.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupplyCourse {
    /// Drop under load, V.
    pub load_v: f64,
    /// Correlation time of the load, s.
    pub load_time_s: f64,
    /// Amplitude of the source's cycle, V.
    pub cycle_v: f64,
    /// Of the source's cycle, s.
    pub period_s: f64,
}

impl Default for SupplyCourse {
    /// Constant.
    fn default() -> Self {
        Self { load_v: 0.0, load_time_s: 30.0, cycle_v: 0.0, period_s: 400.0 }
    }
}

/// Linear motion without rotation: Gauss-Markov specific force, alike and independent along the three axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Standard deviation, g.
    pub deviation_g: f64,
    /// Correlation time, s.
    pub time_constant_s: f64,
}

impl Default for Motion {
    /// At rest.
    fn default() -> Self {
        Self { deviation_g: 0.0, time_constant_s: 5.0 }
    }
}

/// The surroundings at one instant, as deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moment {
    pub(super) temperature_c: f64,
    pub(super) supply_v: f64,
    pub(super) force_g: [f64; 3],
}

/// Runs through the courses.
#[derive(Clone, Debug)]
pub(super) struct Course {
    surroundings: Surroundings,
    load: Telegraph,
    force: [Markov; 3],
    random: ChaCha8Rng,
}

impl Course {
    pub(super) fn new(surroundings: Surroundings, random: ChaCha8Rng) -> Self {
        Self {
            surroundings,
            load: Telegraph::new(surroundings.supply.load_time_s),
            force: std::array::from_fn(|_| Markov::new(surroundings.motion.time_constant_s)),
            random,
        }
    }

    pub(super) fn next(&mut self, time_s: f64, period_s: f64) -> Moment {
        let Surroundings { temperature, supply, motion } = self.surroundings;
        let cycle = |period_s: f64| (2.0 * PI * time_s / period_s).sin();
        let warmth = -(-time_s / temperature.time_constant_s).exp_m1();
        let load = if supply.load_v == 0.0 { 0.0 } else { self.load.next(period_s, &mut self.random) };
        let force_g = if motion.deviation_g == 0.0 {
            [0.0; 3]
        } else {
            self.force.each_mut().map(|axis| motion.deviation_g * axis.next(period_s, &mut self.random))
        };
        Moment {
            temperature_c: temperature.rise_c * warmth + temperature.cycle_c * cycle(temperature.period_s),
            supply_v: supply.load_v * load + supply.cycle_v * cycle(supply.period_s),
            force_g,
        }
    }
}
