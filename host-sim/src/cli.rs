//! What can be said on the command line.

use adis16405_driver::GyroRange;
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
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// What to simulate without a command.
    #[command(flatten)]
    pub simulate: Simulate,
    /// Where the report goes besides the terminal.
    #[command(flatten)]
    pub output: Output,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Analyse a table of register counts (CSV, plain or gzip).
    Analyze(Input),
    /// Send a table or an SPI frame log through the emulated bus and the driver, then analyse what was read.
    Replay(Input),
    /// Say what is in recordings of hours: effects, what moves, what channels share, and what knowing it is worth.
    Explain(Explain),
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
        simulate: Simulate,
    },
    /// Show what a device that runs the firmware sends.
    Monitor {
        /// Its serial port, such as /dev/ttyUSB0.
        port: String,
        /// Baud rate of the port.
        #[arg(long, default_value_t = serial::BAUD)]
        baud: u32,
        /// Command to send first, such as "f 819.2"; may be repeated.
        #[arg(long, value_name = "COMMAND")]
        send: Vec<String>,
        /// End after so many seconds [default: when the device hangs up].
        #[arg(long)]
        seconds: Option<f64>,
    },
    /// Turn an image for the Raspberry Pi Pico into the UF2 file that its boot loader takes.
    Uf2 {
        /// The image, an ELF.
        elf: PathBuf,
        /// The file to write.
        out: PathBuf,
    },
    /// Hide effects at random in recordings of the virtual sensor and tell how well the analysis names them.
    Undeclared(Undeclared),
    /// Repeat the published characterisation on hours whose noise is known: slopes read off beside the fit.
    Paper {
        /// Hours to simulate; a scatter needs two.
        #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(2..))]
        seeds: u64,
        /// Seed of the first.
        #[arg(long, default_value_t = 1)]
        first_seed: u64,
    },
}

/// Recordings with hidden effects.
#[derive(Debug, Args)]
pub struct Undeclared {
    /// Kind that is hidden alone; may be repeated [default: all].
    #[arg(long, value_enum)]
    pub kind: Vec<EffectKind>,
    /// Recordings a kind.
    #[arg(long, default_value_t = 40)]
    pub per_kind: u64,
    /// Recordings with nothing hidden.
    #[arg(long, default_value_t = 200)]
    pub nothing: u64,
    /// Recordings with two effects.
    #[arg(long, default_value_t = 200)]
    pub pairs: u64,
    /// Length of a recording, s.
    #[arg(long, default_value_t = 1800.0)]
    pub seconds: f64,
    /// Recordings that are examined at a time [default: one a core].
    #[arg(long)]
    pub jobs: Option<NonZeroUsize>,
    /// First seed of each group of recordings.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..undeclared::SEEDS_PER_GROUP / 2))]
    pub seed: u64,
    /// Take the seeds that are kept for the end.
    #[arg(long)]
    pub sealed: bool,
}

impl Undeclared {
    /// What is asked for.
    pub fn plan(&self) -> UndeclaredPlan {
        let cores = || std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        UndeclaredPlan {
            kinds: if self.kind.is_empty() { EffectKind::ALL.to_vec() } else { self.kind.clone() },
            per_kind: self.per_kind,
            empty: self.nothing,
            pairs: self.pairs,
            seconds: self.seconds,
            seed: self.seed,
            sealed: self.sealed,
            jobs: self.jobs.map_or_else(cores, NonZeroUsize::get),
        }
    }
}

/// A recording.
#[derive(Debug, Args)]
pub struct Input {
    /// The recording.
    pub file: PathBuf,
    /// Sample rate in Hz; overrides what the time stamps say.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Gyro range in which the recording was taken, deg/s.
    #[arg(long, value_enum, default_value = "300")]
    pub range: Range,
}

/// Recordings to explain.
#[derive(Debug, Args)]
pub struct Explain {
    /// Tables of register counts (CSV, plain or gzip), or folders of them.
    #[arg(required = true)]
    pub recordings: Vec<PathBuf>,
    /// Sample rate in Hz; overrides what the time stamps say.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Write a picture of each channel into this folder.
    #[arg(long, value_name = "DIR")]
    pub pictures: Option<PathBuf>,
    /// Gyro range in which the recordings were taken, deg/s.
    #[arg(long, value_enum, default_value = "300")]
    pub range: Range,
}

/// Full scale of the gyros.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Range {
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

impl From<Range> for GyroRange {
    fn from(range: Range) -> Self {
        match range {
            Range::Dps300 => GyroRange::Dps300,
            Range::Dps150 => GyroRange::Dps150,
            Range::Dps75 => GyroRange::Dps75,
        }
    }
}

/// The virtual sensor's time and noise.
#[derive(Debug, Args)]
pub struct Simulate {
    /// Virtual time in s [default: 60 for `record`, else 3600].
    #[arg(long, allow_negative_numbers = true)]
    pub seconds: Option<f64>,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Nothing but the declared noise: without it the sensor hides a line and an effect of temperature.
    #[arg(long)]
    pub plain: bool,
}

impl Simulate {
    /// With `default_s` seconds unless told otherwise.
    pub fn simulation(&self, default_s: f64) -> Simulation {
        let seconds = self.seconds.unwrap_or(default_s);
        if self.plain { Simulation::paper(seconds, self.seed) } else { Simulation::demonstration(seconds, self.seed) }
    }
}

/// Where the report goes.
#[derive(Debug, Args)]
pub struct Output {
    /// Write the report as JSON.
    #[arg(long, value_name = "OUT", global = true)]
    pub json: Option<PathBuf>,
    /// Write the report as a page into this folder.
    #[arg(long, value_name = "DIR", global = true)]
    pub page: Option<PathBuf>,
    /// Write the noise model of the accelerometers and gyros as Kalibr's YAML.
    #[arg(long, value_name = "OUT", global = true)]
    pub kalibr: Option<PathBuf>,
}
