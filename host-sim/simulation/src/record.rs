//! The virtual sensor, read by the real driver over the emulated bus.

mod demonstration;
mod host;
mod logged_bus;

pub use host::Host;
pub use logged_bus::{LoggedBus, LoggedBusError};

use adis16405_driver::{Adis16405, Channel, Config, ConfigError, GyroRange, SamplePeriod};
use embedded_hal::spi::SpiDevice;
use host::Reader;
use recordings::frame_log::FrameLog;
use recordings::recording::{Clock, Recorder, Recording};
use std::cell::RefCell;
use std::io;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use virtual_sensor::{EmulatedBus, Hidden, NoiseModel, VirtualAdis16405};

/// Rate of the published characterisation that the default reproduces, Hz.
pub const SAMPLE_RATE_HZ: f64 = 204.8;

/// Longest simulation, s: a day, which is about 1 GB of samples.
pub const LONGEST_S: f64 = 86_400.0;

/// What to simulate.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// Virtual time to record, s, at the nominal sample rate.
    pub seconds: f64,
    /// Of all that is random; the same seed gives the same samples.
    pub seed: u64,
    /// What is declared.
    pub noise: NoiseModel,
    /// What is not.
    pub hidden: Hidden,
    /// Who reads the part.
    pub host: Host,
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
    /// The part of [`NoiseModel::paper`], hiding nothing, read by a perfect host.
    pub fn of_paper(seconds: f64, seed: u64) -> Self {
        Self { seconds, seed, noise: NoiseModel::paper(), hidden: Hidden::default(), host: Host::default() }
    }

    /// The same part with a line on gyro z and a gyro x that follows the temperature.
    pub fn of_demonstration(seconds: f64, seed: u64) -> Self {
        Self { hidden: demonstration::hidden(), ..Self::of_paper(seconds, seed) }
    }

    /// Samples that the part takes.
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
        self.read(&bus, bus.clone(), samples, progress)
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
        let recording = self.read(&bus, logged, samples, progress);
        if let Some(reason) = failure.take() {
            return Err(fail(reason));
        }
        if let Some(log) = Rc::into_inner(log) {
            log.into_inner().finish().map_err(fail)?;
        }
        recording
    }

    fn bus(&self) -> EmulatedBus {
        EmulatedBus::new(VirtualAdis16405::hiding(&self.hidden, self.noise.clone(), self.seed))
    }

    /// Reads `samples` samples through `device`, which is `bus` or a layer over it.
    fn read<SPI: SpiDevice<u8>>(
        &self,
        bus: &EmulatedBus,
        device: SPI,
        samples: u64,
        mut progress: impl FnMut(u64),
    ) -> Result<Recording, RecordError> {
        let mut driver = Adis16405::new(device, self.config().map_err(RecordError::Config)?);
        driver.init().map_err(|e| RecordError::Driver(e.to_string()))?;
        let mut recorder = Recorder::new(Channel::ALL.to_vec(), driver.config().range());
        let mut reader = Reader::new(self.host, self.hidden.missed_fraction(), self.seed);
        for taken in 0..samples {
            if taken % 1024 == 0 {
                progress(taken);
            }
            let ready_ns = bus.wait_for_data().ok_or(RecordError::Silent(taken))?;
            if let Some(time_s) = reader.stamp(ready_ns) {
                let burst = driver.burst().map_err(|e| RecordError::Driver(e.to_string()))?;
                recorder.push(Clock::at(time_s), &burst);
            }
        }
        progress(samples);
        let part = bus.part();
        if let Some(first) = part.violations().first() {
            return Err(RecordError::Violations { count: part.violation_count(), first: format!("{first:?}") });
        }
        Ok(recorder.finish())
    }

    /// The declared model has no term for the filter's bandwidth, so unless something is hidden there is none.
    fn config(&self) -> Result<Config, ConfigError> {
        Config::new(GyroRange::Dps300, self.hidden.taps_log2(), SamplePeriod::nearest(SAMPLE_RATE_HZ)?)
    }
}

/// Virtual time in s.
fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}
