//! State of the device, and supervision of the sensor: probes, recovery, status register.

use crate::board::{Board, BusTiming};
use crate::channels::{CHANNELS, ChannelSet};
use crate::counters::add;
use crate::event::event;
use crate::learner::Learner;
use crate::recovery::{RecoveryLadder, RecoveryStep};
use crate::retained::{RetainedSettings, UserSettings};
use crate::sample_intake::SensorTrouble;
use crate::scale::ReportScale;
use crate::sensor::{BURST_LIMIT_HZ, LOW_POWER_LIMIT_HZ, ProbeScope, SensorIdentity, probe, read_diagnosis};
use crate::status_flags::StatusFlags;
use adis16405_driver::{ClockMode, Config, GyroRange, SamplePeriod, TimeBase, Timing};
use core::fmt::Arguments;
use link::{Boot, Health, MessageRef, text, text_line};

/// Configuration at the first start: 204.8 samples a second, ±300 °/s, no filter.
pub const FIRST_CONFIG: Config = {
    let Ok(period) = SamplePeriod::from_divisor(TimeBase::Fast, 8) else { panic!("divisor") };
    let Ok(config) = Config::new(GyroRange::Dps300, 0, period) else { panic!("filter") };
    config
};

/// Settings at the first start: a report every ten seconds, an endless epoch.
pub(crate) const FIRST_SETTINGS: UserSettings = UserSettings {
    smpl_prd: FIRST_CONFIG.sample_period().register(),
    sens_avg: FIRST_CONFIG.sens_avg(),
    epoch_s: 0,
    interval_s: 10,
    prod_id: 0,
};

const RETRY_US: u64 = 1_000_000;
/// Pause for a sensor that may have lost its supply: its longest start-up, µs.
pub(crate) const START_UP_US: u64 = Timing::DEFAULT.start_up_us as u64;
const LOG_FLUSH_US: u64 = 200_000;

pub(crate) struct DeviceState {
    /// Serial clock as set in the hardware, Hz.
    pub(crate) spi_clock_hz: u32,
    pub(crate) boot: Boot,
    pub(crate) settings: RetainedSettings,
    pub(crate) config: Config,
    /// Product identification of the sensor; 0 before it has answered.
    pub(crate) product_id: u16,
    pub(crate) sensor: SensorState,
    pub(crate) learner: Learner,
    /// Start of the epoch, µs since the start of the device; negative if before.
    pub(crate) epoch_start_us: i64,
    /// Counters of the application, without those of sampling, estimators and load.
    pub(crate) counters: Health,
    pub(crate) recovery: SensorRecovery,
    pub(crate) status_flags: StatusFlags,
    pub(crate) report_scale: ReportScale,
}

#[derive(Debug, Clone, Copy)]
#[cfg_attr(all(target_os = "none", feature = "microcontroller"), derive(defmt::Format))]
pub(crate) enum SensorState {
    /// The sensor is to be probed at this time, as this step of recovery or, for `None`, on request.
    Probing {
        at_us: u64,
        step: Option<RecoveryStep>,
    },
    Sampled {
        since_us: u64,
    },
    Restarting {
        at_us: u64,
    },
}

#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SensorRecovery {
    ladder: RecoveryLadder,
    pub(crate) tested: bool,
    pub(crate) failed_test: ChannelSet,
    check_requested: bool,
}

impl DeviceState {
    pub(crate) fn is_sampled(&self) -> bool {
        matches!(self.sensor, SensorState::Sampled { .. })
    }

    pub(crate) fn epoch_age_us(&self, now_us: u64) -> u64 {
        (now_us as i64 - self.epoch_start_us).max(0) as u64
    }

    pub(crate) fn epoch_age_s(&self, now_us: u64) -> u64 {
        self.epoch_age_us(now_us) / 1_000_000
    }

    pub(crate) fn health(&self, board: &mut impl Board) -> Health {
        let of_board = Health {
            data_ready_masked: board.sampling_activity().masked,
            usb_dropped: board.transmit_queue(|queue| queue.usb_dropped()),
            ..board.health()
        };
        board.estimators(|estimators| estimators.health()).with(&self.counters).with(&of_board)
    }

    /// Probes the sensor when due, and stops using one in trouble. True if the microcontroller is to be restarted.
    pub(crate) fn supervise_sensor(&mut self, board: &mut impl Board) -> bool {
        let now_us = board.now_us();
        match self.sensor {
            SensorState::Probing { at_us, step } if now_us >= at_us => self.probe(step, board),
            SensorState::Probing { .. } => {}
            SensorState::Sampled { since_us } => {
                let (is_intact, trouble, used, settled, flagged_us) = board.estimators(|estimators| {
                    let (used, settled) = (estimators.since_probe.used > 0, estimators.is_settled());
                    let flagged_us = estimators.monitor.last_edge_us().filter(|_| estimators.since_probe.error_flag);
                    (estimators.monitor.has_period(), estimators.trouble(now_us), used, settled, flagged_us)
                });
                if !is_intact {
                    // The burst must end first: a sensor that is cut off within a burst answers late.
                    board.set_sampling(false);
                    panic!("memory is damaged: the sample period is 0");
                }
                if let Some(trouble) = trouble {
                    add(&mut self.counters.recoveries, u32::from(used));
                    self.recover(trouble, since_us + RETRY_US, board);
                } else {
                    if settled {
                        self.recovery.ladder.settle();
                    }
                    if let Some(edge_us) = flagged_us {
                        self.read_status(edge_us, board);
                    }
                }
            }
            SensorState::Restarting { at_us } => {
                if now_us >= at_us {
                    // This is reached only if the board does not restart.
                    self.request_probe(now_us);
                    return true;
                }
            }
        }
        false
    }

    /// Resumes sampling after a pause by the device: the lost samples do not make the sensor suspect.
    pub(crate) fn resume_sampling(&self, board: &mut impl Board) {
        if self.is_sampled() {
            let now_us = board.now_us();
            board.estimators(|estimators| estimators.monitor.restart_at(now_us));
            board.set_sampling(true);
        }
    }

    /// Requests a probe at `at_us`; sampling must be disabled.
    pub(crate) fn request_probe(&mut self, at_us: u64) {
        self.sensor = SensorState::Probing { at_us, step: None };
    }

    /// Begins the next step of recovery, at `earliest_us` or later.
    fn recover(&mut self, trouble: SensorTrouble, earliest_us: u64, board: &mut impl Board) {
        event!(warn, "sensor in trouble: {}", trouble);
        let last_edge_us = board.estimators(|estimators| estimators.monitor.last_edge_us());
        board.set_sampling(false);
        let (reason, cause, left_alone_us) = match trouble {
            _ if board.sampling_activity().is_masked => ("the data-ready line oscillates and is masked", "", 0),
            // The sensor must not be clocked during its start-up.
            SensorTrouble::NoEdges => ("no data-ready edges", "", last_edge_us.unwrap_or(0) + START_UP_US),
            SensorTrouble::EdgeRate => ("silent, or edges at another rate", "", 0),
            SensorTrouble::Unusable(cause) => ("unusable bursts: ", cause, 0),
        };
        self.take_step(earliest_us.max(left_alone_us), board, format_args!("{reason}{cause}"));
    }

    /// Schedules the next step for `at_us` or now, whichever is later.
    fn take_step(&mut self, at_us: u64, board: &mut impl Board, reason: Arguments<'_>) {
        let now_us = board.now_us();
        let step = self.recovery.ladder.next_step();
        event!(warn, "recovery step {}", step);
        if self.recovery.ladder.is_logged() || step == RecoveryStep::Restart {
            log(board, format_args!("sensor: {reason}; {}", step.name()));
        }
        self.sensor = match step {
            RecoveryStep::Restart => SensorState::Restarting { at_us: now_us + LOG_FLUSH_US },
            step => SensorState::Probing { at_us: at_us.max(now_us), step: Some(step) },
        };
    }

    fn probe(&mut self, step: Option<RecoveryStep>, board: &mut impl Board) {
        let mut scope = ProbeScope { pulse: false, reset: false, self_test: !self.recovery.tested };
        let counters = &mut self.counters;
        match step {
            None | Some(RecoveryStep::Restart) => {}
            Some(RecoveryStep::Reread) => add(&mut counters.rereads, 1),
            Some(step @ (RecoveryStep::BusReset | RecoveryStep::SlowBus)) => {
                add(&mut counters.bus_resets, 1);
                board.reset_bus();
                if step == RecoveryStep::SlowBus {
                    board.set_bus_timing(BusTiming::SLOW);
                }
                scope = ProbeScope { pulse: true, reset: false, self_test: true };
            }
            Some(RecoveryStep::ResetLine) if board.reset_sensor() => {
                add(&mut counters.reset_lines, 1);
                self.recovery.tested = false;
                return self.request_probe(board.now_us() + START_UP_US);
            }
            Some(RecoveryStep::SoftwareReset | RecoveryStep::ResetLine) => {
                add(&mut counters.sensor_resets, 1);
                scope = ProbeScope { pulse: true, reset: true, self_test: true };
            }
        }
        // The sensor may be in low-power mode.
        let sck_hz = board.set_clock_limit(LOW_POWER_LIMIT_HZ);
        let result = probe(board.sensor_bus(), self.config, sck_hz, scope, self.settings.user.prod_id)
            .map_err(|error| text!("{error}"));
        self.spi_clock_hz = board.set_clock_limit(clock_limit_hz(self.config));
        match result {
            Ok(identity) => {
                self.report_identity(identity, board);
                let now_us = board.now_us();
                board.estimators(|estimators| estimators.accept_samples_after_settling(now_us));
                board.set_sampling(true);
                self.sensor = SensorState::Sampled { since_us: now_us };
                event!(info, "sensor {}", self.sensor);
            }
            Err(error) => {
                let retry_us = board.now_us() + RETRY_US;
                self.take_step(retry_us, board, format_args!("{error}"));
            }
        }
    }

    /// Logs the result of a probe, and marks failed channels.
    fn report_identity(&mut self, identity: SensorIdentity, board: &mut impl Board) {
        let product = identity.product.prod_id();
        self.product_id = product;
        event!(info, "ADIS{=u16}, self-test {}", product, identity.test);
        let requested = core::mem::take(&mut self.recovery.check_requested);
        let Some(test) = identity.test else {
            return log(board, format_args!("sensor: ADIS{product}, configured"));
        };
        self.recovery.tested = true;
        self.recovery.failed_test = ChannelSet::EMPTY;
        for channel in test.failed_sensors() {
            let index = CHANNELS.iter().position(|&other| other == channel);
            self.recovery.failed_test.insert_if(index.unwrap_or(0), index.is_some());
        }
        log(board, format_args!("sensor: ADIS{product}, self-test {test}"));
        if requested {
            let verdict = if test.passed() { "passed" } else { "FAILED; keep the sensor still and repeat it" };
            log(board, format_args!("check: {verdict}"));
        }
    }

    pub(crate) fn request_check(&mut self, now_us: u64, board: &mut impl Board) {
        board.set_sampling(false);
        (self.recovery.tested, self.recovery.check_requested) = (false, true);
        self.request_probe(now_us);
    }

    /// Disables sampling and sets a serial clock for `config`; the error is the clock in Hz if none is slow enough.
    pub(crate) fn prepare_clock(&mut self, config: Config, board: &mut impl Board) -> Result<(), u32> {
        board.set_sampling(false);
        let clock_hz = board.set_clock_limit(clock_limit_hz(config));
        if clock_hz <= clock_limit_hz(config) {
            self.spi_clock_hz = clock_hz;
            return Ok(());
        }
        self.spi_clock_hz = board.set_clock_limit(clock_limit_hz(self.config));
        board.set_sampling(self.is_sampled());
        Err(clock_hz)
    }

    /// Reads and clears DIAG_STAT after an error flag: in the first half of the sample period from `edge_us` on, and at
    /// most once a second.
    fn read_status(&mut self, edge_us: u64, board: &mut impl Board) {
        let now_us = board.now_us();
        let half_period_us = (5e5 / self.config.sample_period().hz()) as u64;
        if !self.status_flags.is_due(now_us) || now_us.saturating_sub(edge_us) >= half_period_us {
            return;
        }
        board.set_sampling(false);
        let diagnosis = read_diagnosis(board.sensor_bus(), self.config);
        board.set_sampling(true);
        board.estimators(|estimators| estimators.since_probe.error_flag = false);
        if let Some(causes) = self.status_flags.add(diagnosis, now_us, &mut self.counters) {
            event!(warn, "DIAG_STAT {}", causes);
            log(board, format_args!("sensor: DIAG_STAT {causes}"));
        }
    }
}

pub(crate) fn clock_limit_hz(config: Config) -> u32 {
    match config.sample_period().clock_mode() {
        ClockMode::Normal => BURST_LIMIT_HZ,
        ClockMode::LowPower => LOW_POWER_LIMIT_HZ,
    }
}

pub(crate) fn log(board: &mut impl Board, text: Arguments<'_>) {
    let line = text_line(text);
    board.transmit_queue(|queue| queue.send(MessageRef::Log(&line)));
}
