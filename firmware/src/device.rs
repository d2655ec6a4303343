//! State of the device, and supervision of the sensor: it is probed before its samples are used, and again when it is silent
//! or suspect.

use crate::board::Board;
use crate::learner::Learner;
use crate::retained::RetainedSettings;
use crate::sensor::{BURST_LIMIT_HZ, LOW_POWER_LIMIT_HZ, SensorIdentity, probe};
use adis16405_driver::{ClockMode, Config, GyroRange, SamplePeriod, TimeBase};
use core::fmt::Arguments;
use link::{Boot, Health, MessageRef, text_line};

/// Configuration at the first start: 204.8 samples a second, ±300 °/s, no filter.
pub const FIRST_CONFIG: Config = {
    let Ok(period) = SamplePeriod::from_divisor(TimeBase::Fast, 8) else { panic!("divisor") };
    let Ok(config) = Config::new(GyroRange::Dps300, 0, period) else { panic!("filter") };
    config
};

/// Settings at the first start: a report every ten seconds, one epoch without end.
pub(crate) const FIRST_SETTINGS: RetainedSettings = RetainedSettings {
    smpl_prd: FIRST_CONFIG.sample_period().register(),
    sens_avg: FIRST_CONFIG.sens_avg(),
    epoch_s: 0,
    epoch: 0,
    interval_s: 10,
    starts: 0,
};

/// Time between two probes of a sensor that does not answer.
const RETRY_US: u64 = 1_000_000;

/// What the application knows of itself and of the sensor.
pub(crate) struct DeviceState {
    /// Serial clock of the sensor's bus as set in the hardware, in Hz.
    pub(crate) spi_clock_hz: u32,
    pub(crate) boot: Boot,
    pub(crate) settings: RetainedSettings,
    /// Configuration that the sensor has, or will have after the next probe.
    pub(crate) config: Config,
    /// Product identification that the sensor answered last; 0 before.
    pub(crate) product_id: u16,
    pub(crate) sensor: SensorState,
    pub(crate) learner: Learner,
    pub(crate) epoch_start_us: u64,
    /// Times that the sensor was lost.
    pub(crate) recoveries: u32,
    pub(crate) bad_commands: u32,
}

/// Whether the sensor is in use.
#[derive(Debug, Clone, Copy)]
pub(crate) enum SensorState {
    /// To be probed (identified, tested and configured) at this time.
    Probing { at_us: u64 },
    /// Sampled since this time.
    Sampled { since_us: u64 },
}

impl DeviceState {
    pub(crate) fn is_sampled(&self) -> bool {
        matches!(self.sensor, SensorState::Sampled { .. })
    }

    pub(crate) fn epoch_age_s(&self, now_us: u64) -> u64 {
        (now_us - self.epoch_start_us) / 1_000_000
    }

    /// The counters of sampling, estimating and the application and the load figures of the board.
    pub(crate) fn health(&self, board: &mut impl Board) -> Health {
        let (meters, now_us) = (board.meters(), board.now_us());
        let asleep_permille = (1000 * meters.asleep_us).checked_div(now_us).unwrap_or(0);
        Health {
            recoveries: self.recoveries,
            bad_commands: self.bad_commands,
            serial_overruns: meters.serial_overruns,
            awake_permille: 1000_u32.saturating_sub(asleep_permille as u32),
            sampling_cycles: meters.sampling_cycles,
            estimator_cycles: meters.estimator_cycles,
            stack_bytes: meters.stack_bytes,
            stack_size: meters.stack_size,
            ..board.estimators(|estimators| estimators.health())
        }
    }

    /// Probes the sensor when that is due, and stops using one that is silent or suspect.
    pub(crate) fn supervise_sensor(&mut self, board: &mut impl Board) {
        let now_us = board.now_us();
        match self.sensor {
            SensorState::Probing { at_us } if now_us >= at_us => self.probe(board),
            SensorState::Probing { .. } => {}
            SensorState::Sampled { since_us } => {
                let (suspect, silent) =
                    board.estimators(|estimators| (estimators.is_suspect(), estimators.is_silent_at(now_us)));
                if suspect || silent {
                    self.recoveries = self.recoveries.saturating_add(1);
                    let reason = if silent {
                        "no data-ready edges"
                    } else {
                        "silent, edges at another rate, or only zeros or ones"
                    };
                    log(board, format_args!("sensor: {reason}; probing it"));
                    board.set_sampling(false);
                    self.sensor = SensorState::Probing { at_us: now_us.max(since_us + RETRY_US) };
                }
            }
        }
    }

    fn probe(&mut self, board: &mut impl Board) {
        // The sensor may be in low-power mode still, from before a restart: it takes any clock that this mode takes.
        board.set_clock_limit(LOW_POWER_LIMIT_HZ);
        let result = probe(board.sensor_bus(), self.config).map_err(|error| text_line(format_args!("{error}")));
        self.spi_clock_hz = board.set_clock_limit(match self.config.sample_period().clock_mode() {
            ClockMode::Normal => BURST_LIMIT_HZ,
            ClockMode::LowPower => LOW_POWER_LIMIT_HZ,
        });
        let now_us = board.now_us();
        match result {
            Ok(SensorIdentity { product, tested, diagnosis }) => {
                self.product_id = product.prod_id();
                let test = if tested { "passed" } else { "did not run" };
                let (product, diagnosis) = (self.product_id, diagnosis.bits());
                log(board, format_args!("sensor: ADIS{product}, self-test {test}, DIAG_STAT {diagnosis:#06x}"));
                board.estimators(|estimators| estimators.mark_probed(now_us));
                board.set_sampling(true);
                self.sensor = SensorState::Sampled { since_us: now_us };
            }
            Err(error) => {
                log(board, format_args!("sensor: {error}; trying again"));
                self.sensor = SensorState::Probing { at_us: now_us + RETRY_US };
            }
        }
    }
}

/// Sends a text as a log message, which host programs receive too.
fn log(board: &mut impl Board, text: Arguments<'_>) {
    let line = text_line(text);
    board.transmit_queue(|queue| queue.send(MessageRef::Log(&line)));
}

/// The configuration of a sensor whose registers have these values.
pub(crate) fn config_from_registers(smpl_prd: u8, sens_avg: u16) -> Option<Config> {
    let range = match sens_avg >> 8 {
        0b100 => GyroRange::Dps300,
        0b010 => GyroRange::Dps150,
        0b001 => GyroRange::Dps75,
        _ => return None,
    };
    Config::new(range, sens_avg as u8, SamplePeriod::from_register(smpl_prd)?).ok()
}
