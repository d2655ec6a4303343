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
const INPUT: &str = "Input";
/// Heading of the options that say which sensor it is.
const SENSOR: &str = "Sensor";
/// Heading of the options that say what is simulated.
const NOISE: &str = "Noise, effects and faults";
/// Heading of the options that say where the result goes.
const OUTPUT: &str = "Output";

/// Below the options of the program; each line is a command.
const EXAMPLES: &str = "\
Examples:
  host-sim                                   an hour of the virtual sensor; its page in ./report
  host-sim analyze imu.bag --page report     a recording of any inertial sensor
  host-sim monitor /dev/ttyACM0              a device that runs the firmware, live";

/// Below the options of `analyze`; each line is a command.
const EXAMPLES_OF_ANALYZE: &str = "\
Examples:
  host-sim analyze flight.ulg --page report --export kalibr=imu.yaml
  host-sim analyze imu.csv --columns gyro_x=wx,gyro_y=wy,time=t --units deg/s,ms --sensor bmi088
  host-sim analyze run1.csv.gz run2.csv.gz --rate 100";

/// Noise analysis of the ADIS16405 and other inertial sensors, and a virtual ADIS16405.
#[derive(Debug, Parser)]
#[command(name = "host-sim", version, args_conflicts_with_subcommands = true, disable_help_subcommand = true)]
#[command(after_help = EXAMPLES)]
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
    /// Analyse a recording of any format, or compare the noise of several
    #[command(after_help = EXAMPLES_OF_ANALYZE)]
    Analyze(AnalyzeArguments),
    /// Show what is in a file: topics, columns, units, rate, gaps, where it is at rest
    Inspect(InspectArguments),
    /// Compare the coefficients of a report with those of another, or with the data sheet
    Compare(CompareArguments),
    /// Write the noise of a report in the file format of another program
    Export(ExportArguments),
    /// Write a recording of any format as a table, a NumPy array or an SPI frame log
    Convert(ConvertArguments),
    /// Show a device that runs the firmware, or a recording, while its record grows
    Monitor(MonitorArguments),
    /// Record the bus of the virtual sensor, or of a device on a serial port, and analyse it
    Record {
        /// The SPI frame log to write; gzip if it ends in .gz.
        out: PathBuf,
        /// Serial port of a device that runs the firmware, such as /dev/ttyUSB0.
        #[arg(long, help_heading = INPUT, conflicts_with_all = ["seed", "plain"])]
        port: Option<String>,
        /// Baud rate of the port.
        #[arg(long, help_heading = INPUT, default_value_t = serial::BAUD, requires = "port")]
        baud: u32,
        /// What to simulate.
        #[command(flatten)]
        simulate: SimulationArguments,
        /// Where the report goes besides the terminal.
        #[command(flatten)]
        output: OutputArguments,
    },
    /// Send a table or an SPI log through the emulated bus and the driver, and analyse it
    Replay(ReplayArguments),
    /// Write a recording of the virtual sensor with the noise, effects and faults described
    Simulate(Box<SimulateArguments>),
    /// Print the completions for a shell
    Completions {
        /// The shell.
        shell: Shell,
    },
}

/// Recordings to analyse, and where the report goes.
#[derive(Debug, Args)]
pub(crate) struct AnalyzeArguments {
    /// The first recording, and how to read it and the others.
    #[command(flatten)]
    pub(crate) recording: RecordingArguments,
    /// More recordings: does the sensor show the same noise in all of them?
    #[arg(value_name = "FILE")]
    pub(crate) more: Vec<PathBuf>,
    /// Each sensor of the file as a recording of its own.
    #[arg(long, help_heading = INPUT, conflicts_with = "topic")]
    pub(crate) each_sensor: bool,
    /// With motors running: its noise over that of the others.
    #[arg(long, help_heading = INPUT, value_name = "RUNNING", conflicts_with = "reports")]
    pub(crate) against: Option<PathBuf>,
    /// Curves and models alone, in memory that does not grow.
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) quick: bool,
    /// Write the report of each recording as DIR/NAME.json.
    #[arg(long, help_heading = OUTPUT, value_name = "DIR", conflicts_with_all = ["full", "explain", "pictures", "json", "page", "exports", "axis"])]
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
    /// Topic, message or array [default: all with an inertial sensor].
    #[arg(long, help_heading = INPUT)]
    pub(crate) topic: Option<String>,
}

/// A recording to replay, and where the report goes.
#[derive(Debug, Args)]
pub(crate) struct ReplayArguments {
    /// Register counts of an ADIS16405, or a log of its SPI bus.
    pub(crate) file: PathBuf,
    /// Sample rate; overrides what the time stamps say.
    #[arg(long, help_heading = INPUT, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Range of the gyros, deg/s: 300, 150 or 75; a log says it itself.
    #[arg(long, help_heading = SENSOR, value_name = "DPS", value_enum, default_value = "300", hide_possible_values = true)]
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
    /// Compare with the typical values of the sensor's data sheet.
    #[arg(long, conflicts_with = "second")]
    pub(crate) data_sheet: bool,
    /// Where the result goes besides the terminal.
    #[command(flatten)]
    pub(crate) output: JsonArgument,
}

/// How a recording is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RecordingFormat {
    /// CSV: register counts of an ADIS16405, or any channels with their units in the header; gzip if the name ends in .gz.
    Table,
    /// CSV: bus transactions of an ADIS16405; gzip if the name ends in .gz.
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
    /// Its format: table, frames or npy [default: by its name, npy or table].
    #[arg(long, help_heading = OUTPUT, value_name = "FORMAT", value_enum, hide_possible_values = true)]
    pub(crate) format: Option<RecordingFormat>,
}

/// What to simulate.
#[derive(Debug, Args)]
pub(crate) struct SimulateArguments {
    /// The file to write.
    pub(crate) out: PathBuf,
    /// Its format: table, frames or npy [default: by its name, npy or table].
    #[arg(long, help_heading = OUTPUT, value_name = "FORMAT", value_enum, hide_possible_values = true)]
    pub(crate) format: Option<RecordingFormat>,
    /// Virtual time in s [default: 3600].
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) seconds: Option<f64>,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Sample rate; the nearest one that the part has.
    #[arg(long, help_heading = SENSOR, value_name = "HZ", default_value_t = simulation::SAMPLE_RATE_HZ, allow_negative_numbers = true)]
    pub(crate) rate: f64,
    /// Range of the gyros, deg/s: 300, 150 or 75.
    #[arg(long, help_heading = SENSOR, value_name = "DPS", value_enum, default_value = "300", hide_possible_values = true)]
    pub(crate) range: GyroRangeArgument,
    /// Taps of a stage of the filter, 1 to 64 [default: the fewest of the range].
    #[arg(long, help_heading = SENSOR)]
    pub(crate) taps: Option<u32>,
    /// All gyros: deg/√s, deg/s, deg/s/√s [default: a published part].
    #[arg(long, help_heading = NOISE, value_name = "N,B,K")]
    gyro: Option<String>,
    /// Gyro x.
    #[arg(long, help_heading = NOISE, value_name = "N,B,K")]
    gyro_x: Option<String>,
    /// Gyro y.
    #[arg(long, help_heading = NOISE, value_name = "N,B,K")]
    gyro_y: Option<String>,
    /// Gyro z.
    #[arg(long, help_heading = NOISE, value_name = "N,B,K")]
    gyro_z: Option<String>,
    /// All accelerometers: g/√Hz, g, g/√s [default: a published part].
    #[arg(long, help_heading = NOISE, value_name = "N,B,K")]
    accl: Option<String>,
    /// Accelerometer x.
    #[arg(long, help_heading = NOISE, value_name = "N,B,K")]
    accl_x: Option<String>,
    /// Accelerometer y.
    #[arg(long, help_heading = NOISE, value_name = "N,B,K")]
    accl_y: Option<String>,
    /// Accelerometer z.
    #[arg(long, help_heading = NOISE, value_name = "N,B,K")]
    accl_z: Option<String>,
    /// As in sinusoid:gyro_z:frequency=20.5,amplitude=0.2; repeatable.
    #[arg(long, help_heading = NOISE, value_name = "EFFECT")]
    pub(crate) effect: Vec<String>,
    /// As in temperature:rise=8,time_constant=900; repeatable.
    #[arg(long, help_heading = NOISE, value_name = "PROFILE")]
    pub(crate) environment: Vec<String>,
    /// Of the bus, as in stuck_low:from=10,bursts=5; repeatable.
    #[arg(long, help_heading = NOISE, value_name = "FAULT")]
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
    #[arg(long, help_heading = OUTPUT, value_enum)]
    pub(crate) format: ExportFormat,
    /// Where the program has one number a sensor: rms or worst.
    #[arg(long, help_heading = OUTPUT, value_enum, default_value_t, hide_possible_values = true)]
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
    /// Sample rate; overrides what the time stamps say.
    #[arg(long, help_heading = INPUT, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Leave out what comes before this time, s from the first sample.
    #[arg(long, help_heading = INPUT, value_name = "S", value_parser = time_in_recording)]
    pub(crate) from: Option<f64>,
    /// Leave out what comes then or later, s from the first sample.
    #[arg(long, help_heading = INPUT, value_name = "S", value_parser = time_in_recording)]
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
    /// The recording, of any format; - for standard input.
    pub(crate) file: PathBuf,
    /// As in gyro_x=wx,gyro_y=1,gyro_z=gyro.2 [default: by name].
    #[arg(long, help_heading = INPUT, value_name = "CHANNEL=COLUMN", value_delimiter = ',')]
    pub(crate) columns: Vec<String>,
    /// One a quantity, as in rad/s,m/s^2,us [default: by name].
    #[arg(long, help_heading = INPUT, value_name = "UNIT", value_delimiter = ',')]
    pub(crate) units: Vec<String>,
    /// Topic, message or array of a file with several.
    #[arg(long, help_heading = INPUT)]
    pub(crate) topic: Option<String>,
    /// Take a guess of column or unit if no other is plausible.
    #[arg(long, help_heading = INPUT)]
    pub(crate) yes: bool,
    /// Range of the gyros of an ADIS16405, deg/s: 300, 150 or 75.
    #[arg(long, help_heading = SENSOR, value_name = "DPS", value_enum, default_value = "300", hide_possible_values = true)]
    pub(crate) range: GyroRangeArgument,
    /// adis16405, adis16470, bmi088, mpu6050, generic or a file.
    #[arg(long, help_heading = SENSOR, value_name = "NAME|FILE")]
    pub(crate) sensor: Option<String>,
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
    #[arg(long, help_heading = INPUT, default_value_t = serial::BAUD)]
    pub(crate) baud: u32,
    /// Command to send to the device first, such as "f 819.2"; may be repeated.
    #[arg(long, help_heading = INPUT, value_name = "COMMAND")]
    pub(crate) send: Vec<String>,
    /// End after so many seconds [default: with the connection or the recording].
    #[arg(long)]
    pub(crate) seconds: Option<f64>,
    /// Seconds of a recording in a second, or max for no waiting.
    #[arg(long, help_heading = INPUT, value_name = "TIMES|max", default_value = "1", value_parser = replay_speed)]
    pub(crate) speed: f64,
    /// Sample rate of a recording; overrides what the time stamps say.
    #[arg(long, help_heading = INPUT, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Range of the gyros of a recording, deg/s: 300, 150 or 75.
    #[arg(long, help_heading = SENSOR, value_name = "DPS", value_enum, default_value = "300", hide_possible_values = true)]
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
#[command(next_help_heading = "Virtual sensor")]
pub(crate) struct SimulationArguments {
    /// Time, s [default: 60 for `record`, else 3600].
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) seconds: Option<f64>,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// N, B and K alone, without the line and the effect of temperature.
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
#[command(next_help_heading = OUTPUT)]
pub(crate) struct OutputArguments {
    /// Print every table of every channel instead of one screen.
    #[arg(long, conflicts_with_all = ["quiet", "explain"])]
    pub(crate) full: bool,
    /// Print sentences: what was found, what changes, what is foretold.
    #[arg(long, conflicts_with = "quiet")]
    pub(crate) explain: bool,
    /// Print nothing.
    #[arg(long)]
    pub(crate) quiet: bool,
    /// Write every figure as SVG into this folder; the page saves them as PNG.
    #[arg(long, value_name = "DIR")]
    pub(crate) pictures: Option<PathBuf>,
    /// Write the report as JSON; - for standard output.
    #[arg(long, value_name = "OUT")]
    pub(crate) json: Option<PathBuf>,
    /// Write the report as a page into this folder.
    #[arg(long, value_name = "DIR")]
    pub(crate) page: Option<PathBuf>,
    /// Write the noise for a program, as in kalibr=imu.yaml; repeatable.
    #[arg(long = "export", value_name = "FORMAT=OUT", value_parser = export_target)]
    pub(crate) exports: Vec<ExportTarget>,
    /// Where --export has one number a sensor: rms or worst.
    #[arg(long, value_enum, default_value_t, requires = "exports", hide_possible_values = true)]
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

#[cfg(test)]
mod tests {
    use super::{Cli, EXAMPLES, EXAMPLES_OF_ANALYZE};
    use clap::{CommandFactory, Parser};

    #[test]
    fn the_examples_are_commands_that_the_program_takes() {
        Cli::command().debug_assert();
        let lines = EXAMPLES.lines().chain(EXAMPLES_OF_ANALYZE.lines()).filter(|line| line.starts_with("  "));
        let commands: Vec<&str> = lines.filter_map(|line| line.trim_start().split("   ").next()).collect();
        assert_eq!(commands.len(), 6);
        for command in commands {
            assert!(Cli::try_parse_from(command.split_whitespace()).is_ok(), "{command}");
        }
    }
}
