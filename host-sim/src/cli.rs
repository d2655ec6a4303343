//! The arguments of the command line.

use adis16405_driver::GyroRange;
use benchmarks::losses::LossPlan;
use benchmarks::undeclared::{self, EffectKind, UndeclaredPlan};
use clap::{Args, Parser, Subcommand, ValueEnum};
use recordings::serial;
use simulation::Simulation;
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// Noise analysis of the ADIS16405 inertial sensor, with a virtual sensor, recordings and replay.
///
/// Without a command: one simulated hour of the virtual sensor, its report here and as a page in `report`.
#[derive(Debug, Parser)]
#[command(name = "host-sim", version)]
pub(crate) struct Cli {
    /// The subcommand.
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
    /// What to simulate without a subcommand.
    #[command(flatten)]
    pub(crate) simulate: SimulationArguments,
    /// Where the report goes besides the terminal.
    #[command(flatten)]
    pub(crate) output: OutputArguments,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Analyse a table of register counts (CSV, plain or gzip).
    Analyze(RecordingArguments),
    /// Send a table or an SPI frame log through the emulated bus and the driver, then analyse what was read.
    Replay(RecordingArguments),
    /// Explain recordings of hours: added effects, parameters that change, common-mode drift, and what compensation gains.
    Explain(ExplainArguments),
    /// Write every bus transaction of the virtual sensor, or the raw bursts of a device on a serial port, to an SPI frame
    /// log, then analyse what was read.
    Record {
        /// The log to write; gzip if it ends in .gz.
        out: PathBuf,
        /// Serial port of a device that runs the firmware, such as /dev/ttyUSB0.
        #[arg(long, conflicts_with = "seed")]
        port: Option<String>,
        /// Baud rate of the port.
        #[arg(long, default_value_t = serial::BAUD, requires = "port")]
        baud: u32,
        /// What to simulate.
        #[command(flatten)]
        simulate: SimulationArguments,
    },
    /// Show the messages of a device that runs the firmware.
    Monitor {
        /// Its serial port, such as /dev/ttyUSB0.
        port: String,
        /// Baud rate of the port.
        #[arg(long, default_value_t = serial::BAUD)]
        baud: u32,
        /// Command to send first, such as "f 819.2"; may be repeated.
        #[arg(long, value_name = "COMMAND")]
        send: Vec<String>,
        /// End after so many seconds [default: when the device disconnects].
        #[arg(long)]
        seconds: Option<f64>,
    },
    /// Convert an image for the Raspberry Pi Pico to the UF2 file that its boot loader takes.
    Uf2 {
        /// The image, an ELF.
        elf: PathBuf,
        /// The file to write.
        out: PathBuf,
    },
    /// Hide random effects in recordings of the virtual sensor and score how well the analysis names them.
    Undeclared(UndeclaredArguments),
    /// Repeat the published characterisation on simulated hours whose noise is known: slope method beside the fit.
    Paper {
        /// Hours to simulate; a scatter needs two.
        #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(2..))]
        seeds: u64,
        /// Seed of the first.
        #[arg(long, default_value_t = 1)]
        first_seed: u64,
    },
    /// Take samples out of simulated records and compare variance and coefficients with those of the complete records.
    Losses(LossArguments),
}

/// The benchmark of lost samples.
#[derive(Debug, Args)]
pub(crate) struct LossArguments {
    /// Records of each noise.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(2..=100_000))]
    records: u64,
    /// Binary logarithm of the number of samples of a record, at 204.8 SPS; 20 is 1.4 hours.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(14..=24))]
    samples_log2: u32,
    /// Seed of the first record.
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Threads [default: as many as the machine has cores].
    #[arg(long)]
    jobs: Option<NonZeroUsize>,
}

impl LossArguments {
    /// The benchmark that the arguments describe.
    pub(crate) fn plan(&self) -> LossPlan {
        LossPlan {
            records: self.records,
            samples: 1 << self.samples_log2,
            first_seed: self.first_seed,
            jobs: self.jobs.map_or_else(cores, NonZeroUsize::get),
        }
    }
}

/// Cores of the machine, 1 where it does not say.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get)
}

/// The detection benchmark.
#[derive(Debug, Args)]
pub(crate) struct UndeclaredArguments {
    /// Kind that is hidden alone; may be repeated [default: all].
    #[arg(long, value_enum)]
    pub(crate) kind: Vec<EffectKind>,
    /// Recordings a kind.
    #[arg(long, default_value_t = 40)]
    pub(crate) per_kind: u64,
    /// Recordings with nothing hidden.
    #[arg(long, default_value_t = 200)]
    pub(crate) nothing: u64,
    /// Recordings with two effects.
    #[arg(long, default_value_t = 200)]
    pub(crate) pairs: u64,
    /// Length of a recording, s.
    #[arg(long, default_value_t = 1800.0)]
    pub(crate) seconds: f64,
    /// Samples that are lost at random in every recording, %.
    #[arg(long, value_name = "PERCENT", default_value_t = 0.0, value_parser = loss_percent)]
    pub(crate) loss: f64,
    /// Recordings that are examined at a time [default: one a core].
    #[arg(long)]
    pub(crate) jobs: Option<NonZeroUsize>,
    /// First seed of each group of recordings.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..undeclared::SEEDS_PER_GROUP / 2))]
    pub(crate) seed: u64,
    /// Take the seeds that are kept for the end.
    #[arg(long)]
    pub(crate) sealed: bool,
}

impl UndeclaredArguments {
    /// The benchmark that the arguments describe.
    pub(crate) fn plan(&self) -> UndeclaredPlan {
        UndeclaredPlan {
            kinds: if self.kind.is_empty() { EffectKind::ALL.to_vec() } else { self.kind.clone() },
            per_kind: self.per_kind,
            empty: self.nothing,
            pairs: self.pairs,
            seconds: self.seconds,
            loss_percent: self.loss,
            seed: self.seed,
            sealed: self.sealed,
            jobs: self.jobs.map_or_else(cores, NonZeroUsize::get),
        }
    }
}

/// A share of lost samples from 0 to 50 %.
fn loss_percent(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(percent) if (0.0..=50.0).contains(&percent) => Ok(percent),
        _ => Err("not a percentage from 0 to 50".to_owned()),
    }
}

/// A recording.
#[derive(Debug, Args)]
pub(crate) struct RecordingArguments {
    /// The recording.
    pub(crate) file: PathBuf,
    /// Sample rate in Hz; overrides what the time stamps say.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Gyro range in which the recording was taken, deg/s.
    #[arg(long, value_enum, default_value = "300")]
    pub(crate) range: GyroRangeArgument,
}

/// Recordings to explain.
#[derive(Debug, Args)]
pub(crate) struct ExplainArguments {
    /// Tables of register counts (CSV, plain or gzip), or folders of them.
    #[arg(required = true)]
    pub(crate) recordings: Vec<PathBuf>,
    /// Sample rate in Hz; overrides what the time stamps say.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Write a figure of each channel into this folder.
    #[arg(long, value_name = "DIR")]
    pub(crate) pictures: Option<PathBuf>,
    /// Gyro range in which the recordings were taken, deg/s.
    #[arg(long, value_enum, default_value = "300")]
    pub(crate) range: GyroRangeArgument,
}

/// Full scale of the gyros.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum GyroRangeArgument {
    /// 0.05 deg/s per count.
    #[value(name = "300")]
    Dps300,
    /// 0.025 deg/s per count.
    #[value(name = "150")]
    Dps150,
    /// 0.0125 deg/s per count.
    #[value(name = "75")]
    Dps75,
}

impl From<GyroRangeArgument> for GyroRange {
    fn from(range: GyroRangeArgument) -> Self {
        match range {
            GyroRangeArgument::Dps300 => GyroRange::Dps300,
            GyroRangeArgument::Dps150 => GyroRange::Dps150,
            GyroRangeArgument::Dps75 => GyroRange::Dps75,
        }
    }
}

/// The virtual sensor's time and noise.
#[derive(Debug, Args)]
pub(crate) struct SimulationArguments {
    /// Virtual time in s [default: 60 for `record`, else 3600].
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) seconds: Option<f64>,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Only the noise of the baseline model: without this flag the sensor also hides a line and an effect of temperature.
    #[arg(long)]
    pub(crate) plain: bool,
}

impl SimulationArguments {
    /// The simulation, of `default_s` seconds if the arguments name no duration.
    pub(crate) fn simulation(&self, default_s: f64) -> Simulation {
        let seconds = self.seconds.unwrap_or(default_s);
        if self.plain { Simulation::paper(seconds, self.seed) } else { Simulation::demonstration(seconds, self.seed) }
    }
}

/// Where the report goes.
#[derive(Debug, Args)]
pub(crate) struct OutputArguments {
    /// Write the report as JSON.
    #[arg(long, value_name = "OUT", global = true)]
    pub(crate) json: Option<PathBuf>,
    /// Write the report as a page into this folder.
    #[arg(long, value_name = "DIR", global = true)]
    pub(crate) page: Option<PathBuf>,
    /// Write the noise model of the accelerometers and gyros as Kalibr's YAML.
    #[arg(long, value_name = "OUT", global = true)]
    pub(crate) kalibr: Option<PathBuf>,
}
