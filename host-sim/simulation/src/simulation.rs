//! A simulation: the real driver reads the virtual sensor over the emulated bus into a recording.

use crate::fault_injector::{FaultEnd, FaultyBus, FrameFault};
use crate::logged_bus::{LoggedBus, seconds};
use adis16405_driver::{Adis16405, Channel, Config, ConfigError, GyroRange, SamplePeriod};
use embedded_hal::spi::SpiDevice;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::Exp1;
use recordings::frame_log::FrameLogWriter;
use recordings::recording::{Recorder, Recording, TimeStamp};
use std::cell::RefCell;
use std::io;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use virtual_sensor::{
    EmulatedBus, Environment, InjectedEffect, NoiseModel, OutputRegister, SensorScenario, SupplyProfile,
    TemperatureProfile, VirtualAdis16405,
};

/// Sample rate of the published characterisation that [`Simulation::paper`] reproduces, Hz.
pub const SAMPLE_RATE_HZ: f64 = 204.8;

/// Longest simulation, s: one day, which is about 1 GB of samples.
pub const LONGEST_S: f64 = 86_400.0;

/// The random stream of the host clock; lower ones belong to the part.
const HOST_STREAM: u64 = 1 << 32;

/// A simulation: the part, its scenario, and the host that reads it.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// Length of the recording at the nominal sample rate, s of virtual time.
    pub seconds: f64,
    /// Seed of all random numbers; the same seed gives the same samples.
    pub seed: u64,
    /// The declared noise.
    pub noise: NoiseModel,
    /// The environment and the effects that the noise model does not declare.
    pub scenario: SensorScenario,
    /// The clock that time-stamps the samples.
    pub host: HostClock,
    /// Range of the gyroscopes.
    pub range: GyroRange,
    /// Sample rate, Hz; the part samples at the nearest rate that it can be set to.
    pub rate_hz: f64,
    /// Faults of the bus, in the order of their times.
    pub faults: Vec<TimedFault>,
}

/// A fault of the bus that begins at some time and damages a number of bursts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedFault {
    /// Start of the fault, s of virtual time.
    pub from_s: f64,
    /// The damage.
    pub fault: FrameFault,
    /// Number of bursts that it damages.
    pub bursts: u32,
}

/// The clock with which the host time-stamps the data-ready pulses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HostClock {
    /// Mean of the exponentially distributed time from a pulse to its time stamp, s.
    pub latency_s: f64,
    /// Seconds that the host counts in a true second.
    pub clock_ratio: f64,
}

impl Default for HostClock {
    /// The true time, without latency.
    fn default() -> Self {
        Self { latency_s: 0.0, clock_ratio: 1.0 }
    }
}

/// The reason for which a simulation gave no recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// The duration is not positive, not finite or above [`LONGEST_S`].
    #[error("{0} s: the duration must be positive and at most {LONGEST_S} s")]
    Duration(f64),
    /// The driver refused the configuration.
    #[error("configuration refused: {0:?}")]
    Config(ConfigError),
    /// The driver failed.
    #[error("driver: {0}")]
    Driver(String),
    /// The part stopped sampling.
    #[error("no more data-ready pulses after {0} samples")]
    Silent(u64),
    /// The driver violated the bus timing, so the samples are not those of a real part.
    #[error("{count} violations of the bus timing, the first {first}")]
    Violations {
        /// Number of violations.
        count: u64,
        /// The first one as text.
        first: String,
    },
    /// The frame log could not be written.
    #[error("{}: {reason}", file.display())]
    Log {
        /// Path of the log.
        file: PathBuf,
        /// The error of the operating system.
        reason: io::Error,
    },
}

impl Simulation {
    /// The part of [`NoiseModel::paper`] without undeclared effects, time-stamped without error.
    pub fn paper(seconds: f64, seed: u64) -> Self {
        Self {
            seconds,
            seed,
            noise: NoiseModel::paper(),
            scenario: SensorScenario::default(),
            host: HostClock::default(),
            range: GyroRange::Dps300,
            rate_hz: SAMPLE_RATE_HZ,
            faults: Vec::new(),
        }
    }

    /// [`paper`](Self::paper) with the default scenario of the command: gyro z has a spectral line, as of a motor
    /// nearby, and gyro x follows the temperature while the part warms up.
    pub fn demonstration(seconds: f64, seed: u64) -> Self {
        let temperature = TemperatureProfile { rise_c: 8.0, time_constant_s: 900.0, cycle_c: 1.0, period_s: 700.0 };
        let supply = SupplyProfile { load_v: 0.05, cycle_v: 0.02, ..SupplyProfile::default() };
        let (line, follower) = (OutputRegister::GyroZ, OutputRegister::GyroX);
        let scenario = SensorScenario {
            environment: Environment { temperature, supply, ..Environment::default() },
            effects: vec![
                InjectedEffect::Sinusoid { channel: line, frequency_hz: 20.5, amplitude: 0.2, phase_rad: 0.0 },
                InjectedEffect::Temperature { channel: follower, sensitivity: 0.05 },
            ],
        };
        Self { scenario, ..Self::paper(seconds, seed) }
    }

    /// Number of samples that the part takes.
    ///
    /// # Errors
    /// The duration is not positive, not finite or above [`LONGEST_S`], or the part does not have the rate.
    pub fn samples(&self) -> Result<u64, SimulationError> {
        if self.seconds > 0.0 && self.seconds <= LONGEST_S {
            Ok((self.seconds * self.sampled_hz()?).round() as u64)
        } else {
            Err(SimulationError::Duration(self.seconds))
        }
    }

    /// The rate at which the part samples, Hz.
    ///
    /// # Errors
    /// The part has no rate near [`rate_hz`](Self::rate_hz).
    pub fn sampled_hz(&self) -> Result<f64, SimulationError> {
        Ok(SamplePeriod::nearest(self.rate_hz).map_err(SimulationError::Config)?.hz())
    }

    /// Runs the simulation. `progress` is called with the number of samples taken, every 1024 samples and at the end.
    ///
    /// # Errors
    /// See [`SimulationError`].
    pub fn run(&self, progress: impl FnMut(u64)) -> Result<Recording, SimulationError> {
        let samples = self.samples()?;
        let bus = FaultyBus::new(self.bus()?);
        self.read(&bus, bus.clone(), samples, progress)
    }

    /// Runs the simulation and writes every transaction to the frame log `file`.
    ///
    /// # Errors
    /// Those of [`run`](Self::run), or the log cannot be written.
    pub fn run_logged(&self, file: &Path, progress: impl FnMut(u64)) -> Result<Recording, SimulationError> {
        let samples = self.samples()?;
        let fail = |reason| SimulationError::Log { file: file.to_owned(), reason };
        let log = Rc::new(RefCell::new(FrameLogWriter::create(file).map_err(fail)?));
        let bus = FaultyBus::new(self.bus()?);
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

    /// The bus with the part, and the fastest clock for bursts in the part's clock mode: 1 MHz, or 300 kHz in low-power mode, which slow
    /// rates select.
    fn bus(&self) -> Result<EmulatedBus, SimulationError> {
        let mode = SamplePeriod::nearest(self.rate_hz).map_err(SimulationError::Config)?.clock_mode();
        let part = VirtualAdis16405::with_scenario(&self.scenario, self.noise.clone(), self.seed);
        Ok(EmulatedBus::with_sck_hz(part, mode.max_burst_sck_hz()))
    }

    /// Reads `samples` samples through `device`, which is `faulty` or logs it.
    fn read<SPI: SpiDevice<u8>>(
        &self,
        faulty: &FaultyBus,
        device: SPI,
        samples: u64,
        mut progress: impl FnMut(u64),
    ) -> Result<Recording, SimulationError> {
        let bus = faulty.bus();
        let mut driver = Adis16405::new(device, bus.delay(), self.config().map_err(SimulationError::Config)?);
        driver.init().map_err(|e| SimulationError::Driver(e.to_string()))?;
        let mut recorder = Recorder::new(Channel::ALL.to_vec(), driver.config().range()).with_capacity(samples);
        let mut stamps = TimeStamps::new(self.host, self.scenario.missed_fraction(), self.seed);
        let mut faults = self.faults.iter().peekable();
        for taken in 0..samples {
            if taken % 1024 == 0 {
                progress(taken);
            }
            let ready_ns = bus.wait_for_data().ok_or(SimulationError::Silent(taken))?;
            while let Some(due) = faults.next_if(|fault| fault.from_s <= seconds(ready_ns)) {
                faulty.faults().borrow_mut().frames = Some((due.fault, FaultEnd::Bursts(due.bursts)));
            }
            if let Some(time_s) = stamps.next(ready_ns) {
                let burst = driver.burst().map_err(|e| SimulationError::Driver(e.to_string()))?;
                recorder.push(TimeStamp::from_time(time_s), &burst);
            }
        }
        progress(samples);
        let part = bus.part();
        if let Some(first) = part.violations().first() {
            return Err(SimulationError::Violations { count: part.violation_count(), first: format!("{first:?}") });
        }
        Ok(recorder.finish())
    }

    /// The filter is off without [`InjectedEffect::FilterBandwidth`]: the declared noise model has no term for it.
    fn config(&self) -> Result<Config, ConfigError> {
        Config::new(self.range, self.scenario.taps_log2(), SamplePeriod::nearest(self.rate_hz)?)
    }
}

/// Generates the host's time stamps.
#[derive(Debug, Clone)]
struct TimeStamps {
    clock: HostClock,
    missed_fraction: f64,
    random: ChaCha8Rng,
    latest_s: f64,
}

impl TimeStamps {
    /// `missed_fraction` is the fraction of samples that are missed at random, 0 to 1.
    fn new(clock: HostClock, missed_fraction: f64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(HOST_STREAM);
        Self { clock, missed_fraction, random, latest_s: 0.0 }
    }

    /// The time stamp of the sample that was ready at `ready_ns`, in s; `None` if the host misses the sample.
    fn next(&mut self, ready_ns: u64) -> Option<f64> {
        if self.random.random_bool(self.missed_fraction) {
            return None;
        }
        let latency_s = if self.clock.latency_s == 0.0 {
            0.0
        } else {
            let latency: f64 = self.random.sample(Exp1);
            self.clock.latency_s * latency
        };
        let stamp_s = (seconds(ready_ns) + latency_s) * self.clock.clock_ratio;
        // Delayed samples queue, so no time stamp is earlier than the one before.
        self.latest_s = self.latest_s.max(stamp_s);
        Some(self.latest_s)
    }
}
