//! The arguments of the command line.

use adis16405_driver::GyroRange;
use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use recordings::serial;
use recordings::time_base::TimeRange;
use reports::export::{AxisChoice, ExportFormat};
use simulation::Simulation;
use std::path::{Path, PathBuf};

/// Heading of the options that say how a recording is read.
const READING: &str = "Reading";

/// Noise analysis of the ADIS16405 inertial sensor, with a virtual sensor, recordings and replay.
///
/// Without a command: one simulated hour of the virtual sensor, its report here and as a page in `report`.
#[derive(Debug, Parser)]
#[command(name = "host-sim", version, args_conflicts_with_subcommands = true)]
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
    /// Analyse a recording: a table of counts or in any units, an array, a bag, a flight log, an SPI log; or compare the noise
    /// of several.
    Analyze(AnalyzeArguments),
    /// Show what is in a file without analysing it: topics, columns, units, rate, gaps, where it is at rest, and the command that
    /// analyses it.
    Inspect(InspectArguments),
    /// Send a table or an SPI frame log through the emulated bus and the driver, then analyse what was read.
    Replay(ReplayArguments),
    /// Explain recordings in sentences: what was found, what changes in the course of the record, and what the models foretell.
    Explain(ExplainArguments),
    /// Write every bus transaction of the virtual sensor, or the raw bursts of a device on a serial port, to an SPI frame
    /// log, then analyse what was read.
    Record {
        /// The log to write; gzip if it ends in .gz.
        out: PathBuf,
        /// Serial port of a device that runs the firmware, such as /dev/ttyUSB0.
        #[arg(long, conflicts_with_all = ["seed", "plain"])]
        port: Option<String>,
        /// Baud rate of the port.
        #[arg(long, default_value_t = serial::BAUD, requires = "port")]
        baud: u32,
        /// What to simulate.
        #[command(flatten)]
        simulate: SimulationArguments,
        /// Where the report goes besides the terminal.
        #[command(flatten)]
        output: OutputArguments,
    },
    /// Write the noise of a report in the file format of another program.
    Export(ExportArguments),
    /// Compare the coefficients of a report with those of another, or with the data sheet.
    Compare(CompareArguments),
    /// Write a recording of any format as a table, a NumPy array or an SPI frame log.
    Convert(ConvertArguments),
    /// Write a recording of the virtual sensor, with the noise, the effects and the faults that are described.
    Simulate(Box<SimulateArguments>),
    /// Print the completions for a shell.
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Show a device that runs the firmware, or a recording that is replayed, while its record grows: verdict, curves, findings,
    /// health. Prints lines where standard output is no terminal.
    Monitor(MonitorArguments),
}

/// Recordings to analyse, and where the report goes.
#[derive(Debug, Args)]
pub(crate) struct AnalyzeArguments {
    /// The first recording, and how to read it and the others.
    #[command(flatten)]
    pub(crate) recording: RecordingArguments,
    /// More recordings of the same sensor: one summary, and whether they show the same noise; with --reports of any sensors.
    #[arg(value_name = "FILE")]
    pub(crate) more: Vec<PathBuf>,
    /// Analyse every sensor of a file that has several, each as a recording of its own.
    #[arg(long, help_heading = READING, conflicts_with = "topic")]
    pub(crate) each_sensor: bool,
    /// A recording with motors running: its noise over that of the others, by channel and octave.
    #[arg(long, value_name = "RUNNING", conflicts_with = "reports")]
    pub(crate) against: Option<PathBuf>,
    /// Curves, models and errors alone, in memory that does not grow with the recording: no spectra, spikes, steps, temperature,
    /// common causes or changes of the noise.
    #[arg(long)]
    pub(crate) quick: bool,
    /// Write the report of each recording as NAME.json into this folder, as many recordings at a time as there are cores.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["full", "pictures", "json", "page", "exports", "axis"])]
    pub(crate) reports: Option<PathBuf>,
    /// Where the report goes besides the terminal.
    #[command(flatten)]
    pub(crate) output: OutputArguments,
}

/// Files to inspect.
#[derive(Debug, Args)]
pub(crate) struct InspectArguments {
    /// The files, of any format.
    #[arg(value_name = "FILE", required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// Topic, message or array of a file with several [default: all with an inertial sensor].
    #[arg(long)]
    pub(crate) topic: Option<String>,
}

/// A recording to replay, and where the report goes.
#[derive(Debug, Args)]
pub(crate) struct ReplayArguments {
    /// Register counts of an ADIS16405, or a log of its SPI bus.
    pub(crate) file: PathBuf,
    /// Sample rate in Hz; overrides what the time stamps say.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Gyro range in which the counts were taken, deg/s; a log says it itself.
    #[arg(long, value_enum, default_value = "300")]
    pub(crate) range: GyroRangeArgument,
    /// Where the report goes besides the terminal.
    #[command(flatten)]
    pub(crate) output: OutputArguments,
}

/// Reports to compare.
#[derive(Debug, Args)]
pub(crate) struct CompareArguments {
    /// A report that `analyze --json` wrote.
    #[arg(value_name = "REPORT")]
    pub(crate) first: PathBuf,
    /// Another, which is called better or worse than the first.
    #[arg(value_name = "REPORT", required_unless_present = "data_sheet")]
    pub(crate) second: Option<PathBuf>,
    /// Compare with the typical values of the data sheet of the sensor that was analysed.
    #[arg(long, conflicts_with = "second")]
    pub(crate) data_sheet: bool,
    /// Where the result goes besides the terminal.
    #[command(flatten)]
    pub(crate) output: JsonArgument,
}

/// How a recording is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RecordingFormat {
    /// Register counts of an ADIS16405, or any channels with their units in the header, in CSV; gzip if the name ends in .gz.
    Table,
    /// Bus transactions of an ADIS16405 in CSV, gzip if the name ends in .gz.
    Frames,
    /// A NumPy array of doubles in SI units.
    Npy,
}

/// A recording to convert.
#[derive(Debug, Args)]
pub(crate) struct ConvertArguments {
    /// The recording.
    #[command(flatten)]
    pub(crate) recording: RecordingArguments,
    /// The file to write.
    pub(crate) out: PathBuf,
    /// Its format [default: by its name, npy or table].
    #[arg(long, value_enum)]
    pub(crate) format: Option<RecordingFormat>,
}

/// What to simulate.
///
/// Coefficients are N in deg/√s or g/√Hz, B in deg/s or g, K in deg/s/√s or g/√s; without them they are those of a published
/// ADIS16405. An effect is KIND[:CHANNEL]:KEY=VALUE,… with the names of the report, such as
/// sinusoid:gyro_z:frequency=20.5,amplitude=0.2.
#[derive(Debug, Args)]
pub(crate) struct SimulateArguments {
    /// The file to write.
    pub(crate) out: PathBuf,
    /// Its format [default: by its name, npy or table].
    #[arg(long, value_enum)]
    pub(crate) format: Option<RecordingFormat>,
    /// Virtual time in s [default: 3600].
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) seconds: Option<f64>,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Sample rate, Hz; the nearest one that the part has.
    #[arg(long, value_name = "HZ", default_value_t = simulation::SAMPLE_RATE_HZ, allow_negative_numbers = true)]
    pub(crate) rate: f64,
    /// Full scale of the gyros, deg/s.
    #[arg(long, value_enum, default_value = "300")]
    pub(crate) range: GyroRangeArgument,
    /// Taps of each stage of the part's filter: 1 to 64, a power of two [default: the fewest that the range allows].
    #[arg(long)]
    pub(crate) taps: Option<u32>,
    /// Coefficients of all gyros.
    #[arg(long, value_name = "N,B,K")]
    gyro: Option<String>,
    /// Coefficients of gyro x.
    #[arg(long, value_name = "N,B,K")]
    gyro_x: Option<String>,
    /// Coefficients of gyro y.
    #[arg(long, value_name = "N,B,K")]
    gyro_y: Option<String>,
    /// Coefficients of gyro z.
    #[arg(long, value_name = "N,B,K")]
    gyro_z: Option<String>,
    /// Coefficients of all accelerometers.
    #[arg(long, value_name = "N,B,K")]
    accl: Option<String>,
    /// Coefficients of accelerometer x.
    #[arg(long, value_name = "N,B,K")]
    accl_x: Option<String>,
    /// Coefficients of accelerometer y.
    #[arg(long, value_name = "N,B,K")]
    accl_y: Option<String>,
    /// Coefficients of accelerometer z.
    #[arg(long, value_name = "N,B,K")]
    accl_z: Option<String>,
    /// Effect that the noise does not declare; may be repeated.
    #[arg(long, value_name = "EFFECT")]
    pub(crate) effect: Vec<String>,
    /// Profile of temperature, supply or motion, such as temperature:rise=8,time_constant=900; may be repeated.
    #[arg(long, value_name = "PROFILE")]
    pub(crate) environment: Vec<String>,
    /// Fault of the bus, such as stuck_low:from=10,bursts=5; may be repeated.
    #[arg(long, value_name = "FAULT")]
    pub(crate) fault: Vec<String>,
}

impl SimulateArguments {
    /// Beginnings of the names of channels, and their coefficients; those of one axis come after those of all.
    pub(crate) fn coefficients(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let all = [
            ("gyro_", &self.gyro),
            ("accl_", &self.accl),
            ("gyro_x", &self.gyro_x),
            ("gyro_y", &self.gyro_y),
            ("gyro_z", &self.gyro_z),
            ("accl_x", &self.accl_x),
            ("accl_y", &self.accl_y),
            ("accl_z", &self.accl_z),
        ];
        all.into_iter().filter_map(|(prefix, text)| Some((prefix, text.as_deref()?)))
    }
}

/// A report to write in the format of another program.
#[derive(Debug, Args)]
pub(crate) struct ExportArguments {
    /// The program.
    #[arg(long, value_enum)]
    pub(crate) format: ExportFormat,
    /// What stands for the three axes, where the program has one number a sensor.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) axis: AxisChoice,
    /// A report that `analyze --json` wrote.
    pub(crate) report: PathBuf,
    /// The file to write.
    pub(crate) out: PathBuf,
}

/// A recording and its sample rate.
#[derive(Debug, Clone, Args)]
pub(crate) struct RecordingArguments {
    /// The recording.
    #[command(flatten)]
    pub(crate) input: InputArguments,
    /// Sample rate in Hz; overrides what the time stamps say.
    #[arg(long, help_heading = READING, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Leave out what comes before this time, s from the first sample.
    #[arg(long, help_heading = READING, value_name = "S", value_parser = time_in_recording)]
    pub(crate) from: Option<f64>,
    /// Leave out what comes at this time or later, s from the first sample.
    #[arg(long, help_heading = READING, value_name = "S", value_parser = time_in_recording)]
    pub(crate) to: Option<f64>,
}

impl RecordingArguments {
    /// Of which nothing but the input is said.
    pub(crate) fn new(input: InputArguments) -> Self {
        Self { input, rate: None, from: None, to: None }
    }

    /// The part of the recording that is read; `None` for all of it.
    pub(crate) fn time_range(&self) -> Option<TimeRange> {
        let is_part = self.from.is_some() || self.to.is_some();
        is_part.then(|| TimeRange { from_s: self.from.unwrap_or(0.0), to_s: self.to.unwrap_or(f64::INFINITY) })
    }
}

/// A recording.
#[derive(Debug, Clone, Args)]
pub(crate) struct InputArguments {
    /// The recording, of a format that its content tells; - for standard input.
    pub(crate) file: PathBuf,
    /// Gyro range of an ADIS16405 in which the recording was taken, deg/s.
    #[arg(long, help_heading = READING, value_enum, default_value = "300")]
    pub(crate) range: GyroRangeArgument,
    /// The sensor: adis16405, generic, adis16470, bmi088, mpu6050, or a profile file [default: adis16405 for register counts
    /// and SPI logs, else generic].
    #[arg(long, help_heading = READING, value_name = "NAME|FILE")]
    pub(crate) sensor: Option<String>,
    /// Columns of the channels, as in gyro_x=wx,gyro_y=wy,time=t; a number for a column without a name, from 0; gyro.0 for
    /// column 0 of the array gyro [default: by their names].
    #[arg(long, help_heading = READING, value_name = "CHANNEL=COLUMN", value_delimiter = ',')]
    pub(crate) columns: Vec<String>,
    /// Units of the columns, one for each quantity, as in rad/s,m/s^2,us [default: by the names of the columns].
    #[arg(long, help_heading = READING, value_name = "UNIT", value_delimiter = ',')]
    pub(crate) units: Vec<String>,
    /// Topic, message or array of a file with several.
    #[arg(long, help_heading = READING)]
    pub(crate) topic: Option<String>,
    /// Take the guess of a column or a unit that the file does not say, if nothing else is plausible.
    #[arg(long, help_heading = READING)]
    pub(crate) yes: bool,
}

impl InputArguments {
    /// A file of which nothing is said.
    pub(crate) fn new(file: &Path) -> Self {
        Self {
            file: file.to_owned(),
            range: GyroRangeArgument::Dps300,
            sensor: None,
            columns: Vec::new(),
            units: Vec::new(),
            topic: None,
            yes: false,
        }
    }
}

/// A finite time of at least 0 s.
fn time_in_recording(text: &str) -> Result<f64, String> {
    let time = text.parse().ok().filter(|time: &f64| time.is_finite() && *time >= 0.0);
    time.ok_or_else(|| "not a time of at least 0 s".to_owned())
}

/// What to show live.
#[derive(Debug, Args)]
pub(crate) struct MonitorArguments {
    /// A serial port such as /dev/ttyUSB0, or a recording in a file.
    #[arg(value_name = "PORT|FILE")]
    pub(crate) source: PathBuf,
    /// Baud rate of the port.
    #[arg(long, default_value_t = serial::BAUD)]
    pub(crate) baud: u32,
    /// Command to send to the device first, such as "f 819.2"; may be repeated.
    #[arg(long, value_name = "COMMAND")]
    pub(crate) send: Vec<String>,
    /// End after so many seconds [default: when the device disconnects or the recording ends].
    #[arg(long)]
    pub(crate) seconds: Option<f64>,
    /// Speed of a recording: seconds of it in a second, or max for no waiting.
    #[arg(long, value_name = "TIMES|max", default_value = "1", value_parser = replay_speed)]
    pub(crate) speed: f64,
    /// Sample rate of a recording in Hz; overrides what the time stamps say.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Gyro range in which the recording was taken, deg/s.
    #[arg(long, value_enum, default_value = "300")]
    pub(crate) range: GyroRangeArgument,
}

impl MonitorArguments {
    /// The recording, as the other commands take it.
    pub(crate) fn recording(&self) -> RecordingArguments {
        let Self { source, rate, range, .. } = self;
        let input = InputArguments { range: *range, ..InputArguments::new(source) };
        RecordingArguments { rate: *rate, ..RecordingArguments::new(input) }
    }
}

/// A positive number, or `max`, which is infinite.
fn replay_speed(text: &str) -> Result<f64, String> {
    if text == "max" {
        return Ok(f64::INFINITY);
    }
    let speed = text.parse().ok().filter(|speed: &f64| speed.is_finite() && *speed > 0.0);
    speed.ok_or_else(|| "neither a positive number nor max".to_owned())
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
    /// Gyro range in which the recordings were taken, deg/s.
    #[arg(long, value_enum, default_value = "300")]
    pub(crate) range: GyroRangeArgument,
    /// Write every figure of the reports as SVG into this folder.
    #[arg(long, value_name = "DIR")]
    pub(crate) pictures: Option<PathBuf>,
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
#[command(next_help_heading = "Output")]
pub(crate) struct OutputArguments {
    /// Print every table of every channel instead of one screen.
    #[arg(long, conflicts_with = "quiet")]
    pub(crate) full: bool,
    /// Print nothing.
    #[arg(long)]
    pub(crate) quiet: bool,
    /// Write every figure as SVG and PNG into this folder.
    #[arg(long, value_name = "DIR")]
    pub(crate) pictures: Option<PathBuf>,
    /// Write the report as JSON; - for standard output.
    #[arg(long, value_name = "OUT")]
    pub(crate) json: Option<PathBuf>,
    /// Write the report as a page into this folder.
    #[arg(long, value_name = "DIR")]
    pub(crate) page: Option<PathBuf>,
    /// Write the noise of gyros and accelerometers for another program, as in kalibr=imu.yaml, with the formats of `export`; may be
    /// repeated.
    #[arg(long = "export", value_name = "FORMAT=OUT", value_parser = export_target)]
    pub(crate) exports: Vec<ExportTarget>,
    /// What stands for the three axes, where the program of --export has one number a sensor.
    #[arg(long, value_enum, default_value_t, requires = "exports")]
    pub(crate) axis: AxisChoice,
}

/// A file for another program.
#[derive(Debug, Clone)]
pub(crate) struct ExportTarget {
    /// Its format.
    pub(crate) format: ExportFormat,
    /// The file to write.
    pub(crate) file: PathBuf,
}

fn export_target(text: &str) -> Result<ExportTarget, String> {
    let formats = || {
        let names = ExportFormat::value_variants().iter().filter_map(ValueEnum::to_possible_value);
        names.map(|name| name.get_name().to_owned()).collect::<Vec<_>>().join(", ")
    };
    let (name, file) = text
        .split_once('=')
        .filter(|(_, file)| !file.is_empty())
        .ok_or("expected FORMAT=OUT, as in kalibr=imu.yaml")?;
    let format = ExportFormat::from_str(name, true).map_err(|_| format!("`{name}` is none of {}", formats()))?;
    Ok(ExportTarget { format, file: file.into() })
}

/// Where a result goes that is no report.
#[derive(Debug, Args)]
pub(crate) struct JsonArgument {
    /// Write the result as JSON.
    #[arg(long, value_name = "OUT")]
    pub(crate) json: Option<PathBuf>,
}
