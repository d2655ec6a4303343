//! The virtual sensor, read by the real driver over the emulated bus.

mod logged_bus;

pub use logged_bus::{LoggedBus, LoggedBusError};

use crate::recording::{Clock, Recorder, Recording};
use crate::sensor::{EmulatedBus, NoiseModel, VirtualAdis16405};
use crate::source::frame_log::FrameLog;
use adis16405_driver::{Adis16405, Channel, Config, ConfigError, GyroRange, SamplePeriod};
use embedded_hal::spi::SpiDevice;
use std::cell::RefCell;
use std::io;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Rate of the published characterisation that the default reproduces, Hz.
pub const SAMPLE_RATE_HZ: f64 = 204.8;

/// Longest simulation, s: a day, which is about 1 GB of samples.
pub const LONGEST_S: f64 = 86_400.0;

/// What to simulate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Simulation {
    /// Virtual time to record, s.
    pub seconds: f64,
    /// Of the noise; the same seed gives the same samples.
    pub seed: u64,
}

/// Why a simulation gave no recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The duration is not in the range that is supported.
    #[error("{0} s: the duration must be positive and at most {LONGEST_S} s")]
    Duration(f64),
    /// The configuration is not one that the part accepts.
    #[error("configuration refused: {0:?}")]
    Config(ConfigError),
    /// The driver gave up.
    #[error("driver: {0}")]
    Driver(String),
    /// The part stopped sampling.
    #[error("no more data-ready pulses after {0} samples")]
    Silent(u64),
    /// The bus was used outside the part's limits, so the samples prove nothing.
    #[error("{count} violations of the bus timing, the first {first}")]
    Violations {
        /// How many there were.
        count: u64,
        /// The first, in words.
        first: String,
    },
    /// The frame log could not be written.
    #[error("{}: {reason}", file.display())]
    Log {
        /// The log.
        file: PathBuf,
        /// The operating system's answer.
        reason: io::Error,
    },
}

impl Simulation {
    /// Samples that the simulation takes.
    ///
    /// # Errors
    /// The duration is not positive, not finite or above [`LONGEST_S`].
    pub fn samples(&self) -> Result<u64, RecordError> {
        if self.seconds > 0.0 && self.seconds <= LONGEST_S {
            Ok((self.seconds * SAMPLE_RATE_HZ).round() as u64)
        } else {
            Err(RecordError::Duration(self.seconds))
        }
    }

    /// Runs the simulation. `progress` hears the number of samples taken, now and then.
    ///
    /// # Errors
    /// The duration is unusable, or driver and part do not get along.
    pub fn run(&self, progress: impl FnMut(u64)) -> Result<Recording, RecordError> {
        let samples = self.samples()?;
        let bus = self.bus();
        read(&bus, bus.clone(), samples, progress)
    }

    /// Runs the simulation and writes every transaction to the frame log `file`.
    ///
    /// # Errors
    /// As [`run`](Self::run), or the log cannot be written.
    pub fn run_logged(&self, file: &Path, progress: impl FnMut(u64)) -> Result<Recording, RecordError> {
        let samples = self.samples()?;
        let fail = |reason| RecordError::Log { file: file.to_owned(), reason };
        let log = Rc::new(RefCell::new(FrameLog::create(file).map_err(fail)?));
        let bus = self.bus();
        let logged = LoggedBus::new(bus.clone(), Rc::clone(&log));
        let failure = logged.failure();
        let recording = read(&bus, logged, samples, progress);
        if let Some(reason) = failure.take() {
            return Err(fail(reason));
        }
        if let Some(log) = Rc::into_inner(log) {
            log.into_inner().finish().map_err(fail)?;
        }
        recording
    }

    fn bus(&self) -> EmulatedBus {
        EmulatedBus::new(VirtualAdis16405::new(NoiseModel::paper(), self.seed))
    }
}

/// Reads `samples` samples through `device`, which is `bus` or a layer over it.
fn read<SPI: SpiDevice<u8>>(
    bus: &EmulatedBus,
    device: SPI,
    samples: u64,
    mut progress: impl FnMut(u64),
) -> Result<Recording, RecordError> {
    let mut driver = Adis16405::new(device, config().map_err(RecordError::Config)?);
    driver.init().map_err(|e| RecordError::Driver(e.to_string()))?;
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), driver.config().range());
    for taken in 0..samples {
        if taken % 1024 == 0 {
            progress(taken);
        }
        let ready_ns = bus.wait_for_data().ok_or(RecordError::Silent(taken))?;
        let burst = driver.burst().map_err(|e| RecordError::Driver(e.to_string()))?;
        recorder.push(Clock::at(seconds(ready_ns)), &burst);
    }
    progress(samples);
    let part = bus.part();
    if let Some(first) = part.violations().first() {
        return Err(RecordError::Violations { count: part.violation_count(), first: format!("{first:?}") });
    }
    Ok(recorder.finish())
}

/// No digital filter: the declared model has no term for its bandwidth.
fn config() -> Result<Config, ConfigError> {
    Config::new(GyroRange::Dps300, 0, SamplePeriod::nearest(SAMPLE_RATE_HZ)?)
}

/// Virtual time in s.
fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}
