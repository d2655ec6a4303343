//! The arguments of the command line.

use crate::bench::BenchPlan;
use crate::output_files::is_standard_stream;
use crate::output_format::{OutputFile, json_file, noise_file, output_file};
use adis16405_driver::GyroRange;
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::parser::ValueSource;
use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use observatory::recording_report::PROGRAM;
use recordings::file_format::RecordedInput;
use recordings::time_base::TimeRange;
use recordings::{InputError, MemoryTable, ReadMonitor, serial};
use reports::export::AxisChoice;
use reports::reading::ReadingOptions;
use simulation::Simulation;
use std::ffi::{OsStr, OsString};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Heading of the options that say how a recording is read.
const INPUT: &str = "Input";
/// Heading of the options that say which sensor it is.
const SENSOR: &str = "Sensor";
/// Heading of the options that say what is simulated.
const NOISE: &str = "Noise, effects and faults";
/// Heading of the options that say where the result goes.
const OUTPUT: &str = "Output";

/// Examples in the help of the program; each line is a command.
const EXAMPLES: &str = "\
Examples:
  imunoise imu.bag -o report.html            a recording of any inertial sensor
  imunoise demo                              an hour of the virtual sensor
  imunoise monitor /dev/ttyACM0              a device that runs the firmware";

/// Exit codes in the long help of the program.
const EXIT_CODES: &str = "\
Exit codes:
  0  done
  1  error, in one line on standard error
  2  wrong usage
  3  done, but a recording was not read to its end

Colour is left out if NO_COLOR is set. `imunoise COMMAND --help` has the units
and examples of the options; `-h` has one screen.";

/// Examples in the help of `analyze`.
const EXAMPLES_OF_ANALYZE: &str = "\
Examples:
  imunoise analyze flight.ulg -o report.html -o imu.yaml
  imunoise analyze imu.csv --columns gyro_x=wx,time=t --units deg/s,ms
  imunoise analyze run1.csv.gz --rate 100 -o report.json";

/// Examples in the help of `batch`.
const EXAMPLES_OF_BATCH: &str = "\
Examples:
  imunoise batch recordings -o reports --rows rows.ndjson
  imunoise batch a.csv.gz b.csv.gz -o reports --rate 100 -j 4 --resume";

/// Examples in the help of `demo`.
const EXAMPLES_OF_DEMO: &str = "\
The page is report.html, unless -o names another file.

Examples:
  imunoise demo
  imunoise demo --seconds 600 --plain -o hour.html";

/// Examples in the help of `inspect`.
const EXAMPLES_OF_INSPECT: &str = "\
Examples:
  imunoise inspect imu.bag
  imunoise inspect flight.ulg --topic sensor_gyro:1";

/// Examples in the help of `compare`.
const EXAMPLES_OF_COMPARE: &str = "\
Examples:
  imunoise compare run1.csv.gz run2.csv.gz --rate 100
  imunoise compare still.csv.gz --running hover.csv.gz
  imunoise compare before.json after.json
  imunoise compare report.json --data-sheet";

/// Examples in the help of `export`.
const EXAMPLES_OF_EXPORT: &str = "\
Examples:
  imunoise export report.json -o imu.yaml
  imunoise export gyro.csv accel.csv --rate 200 -o openvins=chain.yaml";

/// Examples in the help of `convert`.
const EXAMPLES_OF_CONVERT: &str = "\
Examples:
  imunoise convert flight.ulg still.csv.gz --from 8.2 --to 60
  imunoise convert imu.bag imu.npy";

/// Examples in the help of `monitor`.
const EXAMPLES_OF_MONITOR: &str = "\
Examples:
  imunoise monitor /dev/ttyACM0
  imunoise monitor /dev/ttyACM0 --send \"f 819.2\" --seconds 60";

/// Examples in the help of `record`.
const EXAMPLES_OF_RECORD: &str = "\
Examples:
  imunoise record cable.csv.gz --port /dev/ttyACM0 --seconds 3600
  imunoise record night.csv.gz --port COM4 --seconds 28800 -o report.html";

/// Examples in the help of `bench`.
const EXAMPLES_OF_BENCH: &str = "\
The sensor must be still. Two minutes; the statistics are reset, the settings
kept. docs/bench.md has what to do with an oscilloscope.

Examples:
  imunoise bench /dev/ttyACM0
  imunoise bench /dev/ttyACM0 --second /dev/ttyUSB0";

/// Length of a recording of a device if none is given, s.
const DEFAULT_S: f64 = 60.0;

/// Examples in the help of `replay`.
const EXAMPLES_OF_REPLAY: &str = "\
Examples:
  imunoise replay counts.csv.gz --rate 100
  imunoise replay bus.csv.gz -o report.json";

/// Examples in the help of `simulate`.
const EXAMPLES_OF_SIMULATE: &str = "\
Examples:
  imunoise simulate hour.csv.gz --noise gyro=0.037,0.009,0.0013
  imunoise simulate fan.csv --effect sinusoid:gyro_z:frequency=20,amplitude=0.1";

/// Examples in the help of `completions`.
const EXAMPLES_OF_COMPLETIONS: &str = "\
Examples:
  imunoise completions bash";

/// Noise analysis of inertial sensors, with a virtual ADIS16405.
#[derive(Debug, Parser)]
#[command(name = PROGRAM, version, arg_required_else_help = true)]
#[command(after_help = EXAMPLES, after_long_help = format!("{EXAMPLES}\n\n{EXIT_CODES}"))]
pub(crate) struct Cli {
    /// The subcommand.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Puts `analyze` before the recording if that comes first.
pub(crate) fn with_subcommand(mut words: Vec<OsString>) -> Vec<OsString> {
    let program = Cli::command();
    let is_recording = words.get(1).is_some_and(|word| {
        let name = word.to_string_lossy();
        let is_known = program.get_subcommands().any(|known| known.get_name() == name) || name == "help";
        // A misspelt subcommand is not taken for a recording.
        let is_path = name == "-" || name.contains(['.', '/', '\\']) || Path::new(word).exists();
        !is_known && is_path && (name == "-" || !name.starts_with('-'))
    });
    if is_recording {
        words.insert(1, "analyze".into());
    }
    words
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Analyse a recording: what its noise is, what it hides
    #[command(after_help = EXAMPLES_OF_ANALYZE)]
    Analyze(AnalyzeArguments),
    /// Simulate an hour of the virtual sensor and analyse it
    #[command(after_help = EXAMPLES_OF_DEMO)]
    Demo {
        /// Time and noise of the virtual sensor.
        #[command(flatten)]
        simulate: SimulationArguments,
        /// Outputs of the report besides the terminal.
        #[command(flatten)]
        output: OutputArguments,
    },
    /// Show what is in a file: topics, columns, units, rate, gaps
    #[command(after_help = EXAMPLES_OF_INSPECT)]
    Inspect(InspectArguments),
    /// Analyse many recordings or folders: a report each, and rows
    #[command(after_help = EXAMPLES_OF_BATCH)]
    Batch(Box<BatchArguments>),
    /// Compare recordings, or reports, or one with the data sheet
    #[command(after_help = EXAMPLES_OF_COMPARE)]
    Compare(Box<CompareArguments>),
    /// Write the noise of a report or recording for another program
    #[command(after_help = EXAMPLES_OF_EXPORT)]
    Export(ExportArguments),
    /// Write a recording as a table, a NumPy array or an SPI frame log
    #[command(after_help = EXAMPLES_OF_CONVERT)]
    Convert(ConvertArguments),
    /// Show a device live: coefficients, curves, findings, health
    #[command(after_help = EXAMPLES_OF_MONITOR)]
    Monitor(MonitorArguments),
    /// Check a device, its wires and its sensor: what passes, what fails
    #[command(after_help = EXAMPLES_OF_BENCH)]
    Bench(BenchArguments),
    /// Record the bursts of a device on a serial port; analyse them
    #[command(after_help = EXAMPLES_OF_RECORD)]
    Record {
        /// The SPI frame log to write; gzip if it ends in .gz.
        out: PathBuf,
        /// Serial port of a device, such as /dev/ttyUSB0.
        #[arg(long, help_heading = INPUT)]
        port: String,
        /// Baud rate of the port
        ///
        /// A port on USB ignores it.
        #[arg(verbatim_doc_comment, long, help_heading = INPUT, default_value_t = serial::BAUD)]
        baud: u32,
        /// Length of the recording, s.
        #[arg(long, help_heading = INPUT, default_value_t = DEFAULT_S, allow_negative_numbers = true, value_parser = duration)]
        seconds: f64,
        /// Outputs of the report besides the terminal.
        #[command(flatten)]
        output: OutputArguments,
    },
    /// Send a table or an SPI log through the emulated bus and driver
    #[command(after_help = EXAMPLES_OF_REPLAY)]
    Replay(ReplayArguments),
    /// Simulate a recording with stated noise, effects and faults
    #[command(after_help = EXAMPLES_OF_SIMULATE)]
    Simulate(Box<SimulateArguments>),
    /// Print the completions for a shell
    #[command(after_help = EXAMPLES_OF_COMPLETIONS)]
    Completions {
        /// The shell.
        shell: Shell,
    },
}

/// A recording to analyse, and where the report goes.
#[derive(Debug, Args)]
pub(crate) struct AnalyzeArguments {
    /// The recording, and how to read it.
    #[command(flatten)]
    pub(crate) recording: RecordingArguments,
    /// Each sensor of the file as its own recording
    ///
    /// For a file with several sensors or several rates. Gyros and
    /// accelerometers apart are one sensor: -o imu.yaml has both.
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, conflicts_with = "topic")]
    pub(crate) each_sensor: bool,
    /// Curves and models only, for records of any length
    ///
    /// Allan deviations and N, B, K in one pass and in fixed memory, without
    /// findings, for recordings of days.
    #[arg(verbatim_doc_comment, long, help_heading = OUTPUT)]
    pub(crate) quick: bool,
    /// Outputs of the report besides the terminal.
    #[command(flatten)]
    pub(crate) output: OutputArguments,
}

/// Files to inspect.
#[derive(Debug, Args)]
pub(crate) struct InspectArguments {
    /// The files, of any format
    ///
    /// Shows for each column its unit, first values, mean, noise and step,
    /// and what it is taken for; the rate in Hz, lost samples, the part at
    /// rest, and the command that analyses the file.
    #[arg(verbatim_doc_comment, value_name = "FILE", required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// Topic, message or array [default: every inertial sensor]
    ///
    /// Also one that is no inertial sensor.
    /// Example: --topic sensor_baro
    #[arg(verbatim_doc_comment, long, help_heading = INPUT)]
    pub(crate) topic: Option<String>,
}

/// A recording to replay, and where the report goes.
#[derive(Debug, Args)]
pub(crate) struct ReplayArguments {
    /// Register counts of an ADIS16405, or a log of its SPI bus.
    pub(crate) file: PathBuf,
    /// Sample rate; overrides the time stamps
    ///
    /// In Hz. Needed if the recording has no time stamps.
    /// Example: --rate 204.8
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Gyro range of counts: 300 [default], 150 or 75 deg/s
    ///
    /// Full scale of the gyros in deg/s, for register counts that do not say
    /// it: a count is 0.05, 0.025 or 0.0125 deg/s.
    #[arg(verbatim_doc_comment, long, help_heading = SENSOR, value_name = "DPS", value_enum, default_value = "300", hide_possible_values = true, hide_default_value = true)]
    pub(crate) range: GyroRangeArgument,
    /// Outputs of the report besides the terminal.
    #[command(flatten)]
    pub(crate) output: OutputArguments,
}

/// Recordings or reports to compare.
#[derive(Debug, Args)]
pub(crate) struct CompareArguments {
    /// The first one, and how to read it and the others.
    #[command(flatten)]
    pub(crate) recording: RecordingArguments,
    /// More recordings, or the second report
    ///
    /// A recording beside a report is analysed first.
    #[arg(verbatim_doc_comment, value_name = "FILE", required_unless_present_any = ["running", "data_sheet"])]
    pub(crate) more: Vec<PathBuf>,
    /// Recording with motors on: how much noisier?
    ///
    /// For each channel and averaging time the ratio of the Allan deviations,
    /// with 95 % bounds.
    /// Example: imunoise compare still.csv --running hover.csv
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, value_name = "FILE", conflicts_with = "data_sheet")]
    pub(crate) running: Option<PathBuf>,
    /// Compare a report with its sensor's data sheet
    ///
    /// N, B and K of the report over those of the data sheet that --sensor
    /// names. A recording is analysed first.
    #[arg(verbatim_doc_comment, long, conflicts_with = "more")]
    pub(crate) data_sheet: bool,
    /// Output of the result besides the terminal.
    #[command(flatten)]
    pub(crate) result: JsonArgument,
}

/// Recordings that have a report each.
#[derive(Debug, Args)]
pub(crate) struct BatchArguments {
    /// The first one, and how to read it and the others; of a folder all files below it.
    #[command(flatten)]
    pub(crate) recording: RecordingArguments,
    /// More recordings, or folders of them.
    #[arg(value_name = "FILE|DIR")]
    pub(crate) more: Vec<PathBuf>,
    /// Each sensor of each file as its own recording
    ///
    /// Each has a report of its own, FILE-TOPIC.json.
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, conflicts_with = "topic")]
    pub(crate) each_sensor: bool,
    /// Curves and models only, for records of any length
    ///
    /// Allan deviations and N, B, K in one pass and in fixed memory, without
    /// findings, for recordings of days.
    #[arg(verbatim_doc_comment, long, help_heading = OUTPUT)]
    pub(crate) quick: bool,
    /// Folder of the reports, which mirrors those given
    ///
    /// Each recording has a report FILE.json in it. Of a folder that is given
    /// those below it are mirrored.
    #[arg(verbatim_doc_comment, short, long, help_heading = OUTPUT, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// One JSON object a row: status, values, findings
    ///
    /// A table as lines of JSON, written as recordings are finished: a row of
    /// status, reason and notes for each, and its coefficients and findings.
    /// docs/fleet.md has the columns.
    /// Example: --rows rows.ndjson
    #[arg(verbatim_doc_comment, long, help_heading = OUTPUT, value_name = "OUT")]
    pub(crate) rows: Option<PathBuf>,
    /// Leave out what has a report of the same bytes
    ///
    /// Made with the same options and version. An interrupted run goes on.
    #[arg(verbatim_doc_comment, long, help_heading = OUTPUT)]
    pub(crate) resume: bool,
    /// Recordings at a time [default: one a core]
    ///
    /// Each is analysed by one thread.
    /// Example: -j 4
    #[arg(verbatim_doc_comment, short, long, value_name = "N")]
    pub(crate) jobs: Option<NonZeroUsize>,
    /// Print nothing.
    #[arg(short, long, help_heading = OUTPUT)]
    pub(crate) quiet: bool,
    /// Overwrite files that exist
    ///
    /// Without it they are kept, and the command ends with exit code 1.
    #[arg(verbatim_doc_comment, short, long, help_heading = OUTPUT)]
    pub(crate) force: bool,
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
    /// Format: table, frames or npy [default: by OUT's name]
    ///
    ///   table   CSV: counts of an ADIS16405, or channels with their units
    ///   frames  CSV: transactions of the SPI bus of an ADIS16405
    ///   npy     NumPy array of doubles: s, rad/s, m/s^2
    /// .csv and .txt, also with .gz, are tables, .npy is an array.
    #[arg(verbatim_doc_comment, long, help_heading = OUTPUT, value_name = "FORMAT", value_enum, hide_possible_values = true)]
    pub(crate) format: Option<RecordingFormat>,
    /// Overwrite files that exist
    ///
    /// Without it they are kept, and the command ends with exit code 1.
    #[arg(verbatim_doc_comment, short, long, help_heading = OUTPUT)]
    pub(crate) force: bool,
}

/// What to simulate.
#[derive(Debug, Args)]
pub(crate) struct SimulateArguments {
    /// The file to write.
    pub(crate) out: PathBuf,
    /// Format: table, frames or npy [default: by OUT's name]
    ///
    ///   table   CSV: counts of an ADIS16405, or channels with their units
    ///   frames  CSV: transactions of the SPI bus of an ADIS16405
    ///   npy     NumPy array of doubles: s, rad/s, m/s^2
    /// .csv and .txt, also with .gz, are tables, .npy is an array.
    #[arg(verbatim_doc_comment, long, help_heading = OUTPUT, value_name = "FORMAT", value_enum, hide_possible_values = true)]
    pub(crate) format: Option<RecordingFormat>,
    /// Overwrite files that exist
    ///
    /// Without it they are kept, and the command ends with exit code 1.
    #[arg(verbatim_doc_comment, short, long, help_heading = OUTPUT)]
    pub(crate) force: bool,
    /// Virtual time in s [default: 3600]
    ///
    /// An hour takes some seconds.
    #[arg(verbatim_doc_comment, long, allow_negative_numbers = true, value_parser = duration)]
    pub(crate) seconds: Option<f64>,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Sample rate; the part's nearest is taken.
    #[arg(long, help_heading = SENSOR, value_name = "HZ", default_value_t = simulation::SAMPLE_RATE_HZ, allow_negative_numbers = true)]
    pub(crate) rate: f64,
    /// Range of the gyros, deg/s: 300, 150 or 75.
    #[arg(long, help_heading = SENSOR, value_name = "DPS", value_enum, default_value = "300", hide_possible_values = true)]
    pub(crate) range: GyroRangeArgument,
    /// Taps per filter stage, 1 to 64 [default: by the range]
    ///
    /// A power of two: the Bartlett filter of the part, which averages twice.
    #[arg(verbatim_doc_comment, long, help_heading = SENSOR)]
    pub(crate) taps: Option<u32>,
    /// As in gyro=0.037,0.009,0.0013; see --help
    ///
    /// For one channel (gyro_x), or for all three of a kind (gyro, accl):
    /// that of one channel is taken. May be given several times. In deg/√s,
    /// deg/s, deg/s/√s, and in g/√Hz, g, g/√s. Default: those of a published
    /// part.
    /// Example: --noise gyro=0.037,0.009,0.0013 --noise gyro_z=0.05,0.01,0
    #[arg(verbatim_doc_comment, long, help_heading = NOISE, value_name = "CHANNEL=N,B,K", value_parser = channel_noise)]
    pub(crate) noise: Vec<ChannelNoise>,
    /// As in markov:gyro_x:time_constant=9,deviation=1
    ///
    /// May be given several times. Kinds: sinusoid, resonance, markov,
    /// telegraph, quantization, rate_ramp, temperature, supply, acceleration,
    /// common_mode, spikes, bias_step, dropped_samples, repeated_samples,
    /// sample_clock; docs/several-recordings.md has their keys. Sizes are in
    /// deg/s or g, frequencies in Hz, times in s.
    /// Example: --effect sinusoid:gyro_z:frequency=20.5,amplitude=0.2
    #[arg(verbatim_doc_comment, long, help_heading = NOISE, value_name = "EFFECT")]
    pub(crate) effect: Vec<String>,
    /// As in temperature:rise=8,time_constant=900
    ///
    /// May be given several times. temperature has rise and cycle in °C,
    /// time_constant and period in s; supply has load and cycle in V; motion
    /// has deviation in g.
    #[arg(verbatim_doc_comment, long, help_heading = NOISE, value_name = "PROFILE")]
    pub(crate) environment: Vec<String>,
    /// As in stuck_low:from=10,bursts=5
    ///
    /// A fault of the bus. May be given several times; `from` is in s. Kinds:
    /// impossible_rate, shifted, stuck_low, stuck_high, frozen, stale,
    /// low_supply.
    #[arg(verbatim_doc_comment, long, help_heading = NOISE, value_name = "FAULT")]
    pub(crate) fault: Vec<String>,
}

/// Noise of a channel, or of the three of a kind.
#[derive(Debug, Clone)]
pub(crate) struct ChannelNoise {
    /// Such as `gyro_z`, or `gyro_`.
    pub(crate) prefix: String,
    /// N, B, K.
    pub(crate) coefficients: String,
}

fn channel_noise(text: &str) -> Result<ChannelNoise, String> {
    let (name, coefficients) = text.split_once('=').ok_or("expected CHANNEL=N,B,K, as in gyro_z=0.05,0.01,0")?;
    let kinds = ["gyro", "accl"];
    let known = kinds.iter().flat_map(|kind| ["", "_x", "_y", "_z"].map(|axis| format!("{kind}{axis}")));
    if !known.clone().any(|known| known == name) {
        return Err(format!("`{name}` is none of {}", known.collect::<Vec<_>>().join(", ")));
    }
    let prefix = if kinds.contains(&name) { format!("{name}_") } else { name.to_owned() };
    Ok(ChannelNoise { prefix, coefficients: coefficients.to_owned() })
}

/// Reports or recordings whose noise is written in the format of another program.
#[derive(Debug, Args)]
pub(crate) struct ExportArguments {
    /// The first one, and how to read it and the others.
    #[command(flatten)]
    pub(crate) recording: RecordingArguments,
    /// More of one sensor: gyros in one file, accelerometers in another
    ///
    /// They are written as one sensor. Reports and recordings may be mixed.
    #[arg(verbatim_doc_comment, value_name = "FILE")]
    pub(crate) more: Vec<PathBuf>,
    /// Write the noise: .yaml (Kalibr) .csv .m .py .sdf
    ///
    /// May be given several times. The ending of FILE chooses the program:
    ///   .yaml  Kalibr, in rad/s and m/s^2
    ///   .csv   every parameter of every channel with 95 % bounds
    ///   .m     MATLAB's imuSensor
    ///   .py    GTSAM
    ///   .sdf   Gazebo
    /// FORMAT=FILE chooses others: openvins, vins, orbslam3, kf-gins, basalt.
    /// FORMAT=- is standard output.
    /// Example: -o imu.yaml -o openvins=chain.yaml
    #[arg(verbatim_doc_comment, short, long = "output", help_heading = OUTPUT, value_name = "FILE", required = true, value_parser = OsStringValueParser::new().try_map(noise_file))]
    pub(crate) outputs: Vec<OutputFile>,
    /// One number for three axes: rms [default] or worst
    ///
    /// For formats that have one number for x, y and z: their root mean
    /// square, or the largest.
    #[arg(verbatim_doc_comment, long = "combine-axes", value_name = "HOW", help_heading = OUTPUT, value_enum, default_value_t, hide_possible_values = true, hide_default_value = true)]
    pub(crate) axis: AxisChoice,
    /// Overwrite files that exist
    ///
    /// Without it they are kept, and the command ends with exit code 1.
    #[arg(verbatim_doc_comment, short, long, help_heading = OUTPUT)]
    pub(crate) force: bool,
}

/// Options of `analyze` that a proposed command states itself, or does not need.
const PROPOSED: [&str; 10] =
    ["topic", "columns", "units", "rate", "sensor", "range", "from", "to", "accept-guess", "each-sensor"];

/// The words of the command line, with the program's name first.
static TYPED: OnceLock<Vec<String>> = OnceLock::new();

/// Keeps the words of the command line, for commands that are proposed.
pub(crate) fn set_typed(words: &[OsString]) {
    // A process runs one command.
    let _ = TYPED.set(words.iter().map(|word| word.to_string_lossy().into_owned()).collect());
}

/// A file name with a number before its ending: `report-2.html`, `sensor-2.kalibr.yaml`.
fn numbered(file: &str, number: usize) -> String {
    let path = Path::new(file);
    let name = path.file_name().map(OsStr::to_string_lossy).unwrap_or_default();
    let (stem, ending) = name.split_at(name.find('.').unwrap_or(name.len()));
    path.with_file_name(format!("{stem}-{number}{ending}")).display().to_string()
}

/// The options that were given to `analyze`, without those that a proposed command states itself. With the `number` of the command among
/// several, its output files have it in their names.
pub(crate) fn other_options(number: Option<usize>) -> Vec<String> {
    let mut program = Cli::command();
    let typed = program.try_get_matches_from_mut(TYPED.get().into_iter().flatten()).ok();
    let (Some(typed), Some(analyze)) = (&typed, program.find_subcommand("analyze")) else { return Vec::new() };
    let Some(("analyze", typed)) = typed.subcommand() else { return Vec::new() };
    let mut options = Vec::new();
    for argument in analyze.get_arguments() {
        let id = argument.get_id().as_str();
        let Some(long) = argument.get_long().filter(|long| !PROPOSED.contains(long)) else { continue };
        if typed.value_source(id) != Some(ValueSource::CommandLine) {
            continue;
        }
        let option = argument.get_short().map_or_else(|| format!("--{long}"), |short| format!("-{short}"));
        if argument.get_action().takes_values() {
            let values = typed.get_raw(id).into_iter().flatten().map(|value| value.to_string_lossy().into_owned());
            let of_command = |value: String| match number {
                Some(number) if long == "output" && value != "-" => numbered(&value, number),
                _ => value,
            };
            options.extend(values.flat_map(|value| [option.clone(), of_command(value)]));
        } else {
            options.push(option);
        }
    }
    options
}

/// A recording and its sample rate.
#[derive(Debug, Clone, Args)]
pub(crate) struct RecordingArguments {
    /// The recording.
    #[command(flatten)]
    pub(crate) input: InputArguments,
    /// Sample rate; overrides the time stamps
    ///
    /// In Hz. Needed if the recording has no time stamps.
    /// Example: --rate 204.8
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Begin here, s from the first sample
    ///
    /// Example: --from 8.2 --to 60
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, value_name = "S", value_parser = time_in_recording)]
    pub(crate) from: Option<f64>,
    /// End before this, s from the first sample
    ///
    /// In s from the first sample of the file, not from --from.
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, value_name = "S", value_parser = time_in_recording)]
    pub(crate) to: Option<f64>,
}

impl RecordingArguments {
    /// The arguments of an input with no other option.
    pub(crate) fn new(input: InputArguments) -> Self {
        Self { input, rate: None, from: None, to: None }
    }

    /// These options for another `file`.
    pub(crate) fn of_file(&self, file: &Path) -> Self {
        Self { input: InputArguments { file: file.to_owned(), ..self.input.clone() }, ..self.clone() }
    }

    /// The options with which the recording is read, as words of a command line.
    pub(crate) fn options(&self, is_quick: bool) -> Vec<String> {
        let Self { input: InputArguments { columns, units, topic, range, sensor, .. }, rate, from, to } = self;
        let range = match range {
            GyroRangeArgument::Dps300 => None,
            GyroRangeArgument::Dps150 => Some(150),
            GyroRangeArgument::Dps75 => Some(75),
        };
        let (topic, sensor) = (topic.as_deref(), sensor.as_deref());
        let options = ReadingOptions { topic, columns, units, rate: *rate, sensor, range, from_s: *from, to_s: *to };
        options.words().into_iter().chain(is_quick.then(|| "--quick".to_owned())).collect()
    }

    /// The part of the recording that is read; `None` for all of it.
    pub(crate) fn time_range(&self) -> Option<TimeRange> {
        TimeRange::between(self.from, self.to)
    }
}

/// A recording.
#[derive(Debug, Clone, Args)]
pub(crate) struct InputArguments {
    /// The recording, of any format; - for standard input
    ///
    /// A text table, NumPy, MATLAB, HDF5, a ROS 1 or ROS 2 bag, ULog,
    /// ArduPilot, or an export of a logic analyser, also with .gz or .zst.
    /// The content tells the format, not the name.
    #[arg(verbatim_doc_comment)]
    pub(crate) file: PathBuf,
    /// As in gyro_x=wx,gyro_y=1 [default: by name]
    ///
    /// Which column is which channel, by its name or by its number from 0.
    /// Channels are gyro_x to gyro_z, accl_x to accl_z, magn_x to magn_z,
    /// temp, supply, and time or sample (an index).
    /// Example: --columns time=t,gyro_x=wx,gyro_y=wy,gyro_z=wz
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, value_name = "CHANNEL=COLUMN", value_delimiter = ',')]
    pub(crate) columns: Vec<String>,
    /// Per quantity, as deg/s,g,us [default: by name]
    ///
    /// Units of the columns, one a quantity, in any order, each with a factor
    /// if need be. Without a unit in the heading or here a rate or a specific
    /// force is refused.
    /// Example: --units rad/s,m/s^2,degC,ns
    /// Example: --units deg/s/131,g/16384
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, value_name = "UNIT", value_delimiter = ',')]
    pub(crate) units: Vec<String>,
    /// Columns that other sensors of the file read.
    #[arg(skip)]
    pub(crate) read_by_others: Vec<String>,
    /// Topic, message or array of a file with several
    ///
    /// One of the names that `imunoise inspect FILE` shows.
    /// Example: --topic /imu0
    /// Example: --topic sensor_gyro:1
    #[arg(verbatim_doc_comment, long, help_heading = INPUT)]
    pub(crate) topic: Option<String>,
    /// Accept a guess if no other is plausible
    ///
    /// Takes the columns and units that `imunoise inspect` proposes if
    /// nothing about them is in doubt, and says so. A rate in Hz is never
    /// guessed.
    #[arg(verbatim_doc_comment, long, help_heading = INPUT)]
    pub(crate) accept_guess: bool,
    /// Gyros of an ADIS16405: 300 [default], 150, 75 deg/s
    ///
    /// Full scale of the gyros in deg/s, for register counts that do not say
    /// it: a count is 0.05, 0.025 or 0.0125 deg/s.
    #[arg(verbatim_doc_comment, long, help_heading = SENSOR, value_name = "DPS", value_enum, default_value = "300", hide_possible_values = true, hide_default_value = true)]
    pub(crate) range: GyroRangeArgument,
    /// adis16405, adis16470, bmi088, mpu6050 or a TOML file
    ///
    /// The data sheet: ranges, counts and the values to compare with.
    /// Default: adis16405 for its own counts, generic for all others.
    /// Example: --sensor bmi088
    /// Example: --sensor my-part.toml
    #[arg(verbatim_doc_comment, long, help_heading = SENSOR, value_name = "NAME|FILE")]
    pub(crate) sensor: Option<String>,
    /// A recording in memory instead of the file.
    #[arg(skip)]
    pub(crate) memory: Option<RecordingInMemory>,
}

/// A recording in memory.
#[derive(Debug, Clone)]
pub(crate) enum RecordingInMemory {
    /// The bytes of a file.
    Bytes(Arc<[u8]>),
    /// Arrays.
    Arrays(Arc<MemoryTable>),
}

impl InputArguments {
    /// The arguments of a file with no other option.
    pub(crate) fn new(file: &Path) -> Self {
        Self {
            file: file.to_owned(),
            range: GyroRangeArgument::Dps300,
            sensor: None,
            columns: Vec::new(),
            units: Vec::new(),
            read_by_others: Vec::new(),
            topic: None,
            accept_guess: false,
            memory: None,
        }
    }

    /// Opens the recording; `monitor` is passed to [`RecordedInput::open_monitored`].
    ///
    /// # Errors
    /// It cannot be read, or has no known format.
    pub(crate) fn open(&self, monitor: &ReadMonitor) -> Result<RecordedInput, InputError> {
        match self.memory.clone() {
            None => RecordedInput::open_monitored(&self.file, monitor),
            Some(RecordingInMemory::Bytes(bytes)) => RecordedInput::in_memory_monitored(&self.file, bytes, monitor),
            Some(RecordingInMemory::Arrays(arrays)) => Ok(RecordedInput::of_arrays(&self.file, arrays, monitor)),
        }
    }
}

/// A finite time of at least 0 s.
fn time_in_recording(text: &str) -> Result<f64, String> {
    let time = text.parse().ok().filter(|time: &f64| time.is_finite() && *time >= 0.0);
    time.ok_or_else(|| "not a time of at least 0 s".to_owned())
}

/// A finite time above 0 s.
fn duration(text: &str) -> Result<f64, String> {
    time_in_recording(text).ok().filter(|time| *time > 0.0).ok_or_else(|| "not a time above 0 s".to_owned())
}

/// A device to check.
#[derive(Debug, Args)]
pub(crate) struct BenchArguments {
    /// Serial port of the device, such as /dev/ttyACM0.
    pub(crate) port: String,
    /// Baud rate of the port
    ///
    /// A port on USB ignores it.
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, default_value_t = serial::BAUD)]
    pub(crate) baud: u32,
    /// Its other port, which must carry the same bursts
    ///
    /// The USB port and the serial adapter of one device.
    /// Example: imunoise bench /dev/ttyACM0 --second /dev/ttyUSB0
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, value_name = "PORT")]
    pub(crate) second: Option<String>,
    /// Reads of PROD_ID.
    #[arg(long, default_value_t = BenchPlan::default().reads)]
    pub(crate) reads: u32,
    /// Time for which bursts are counted, s.
    #[arg(long, default_value_t = BenchPlan::default().bursts_s, value_parser = duration)]
    pub(crate) seconds: f64,
}

/// A device to show live.
#[derive(Debug, Args)]
pub(crate) struct MonitorArguments {
    /// Serial port of the device, such as /dev/ttyACM0.
    pub(crate) port: String,
    /// Baud rate of the port
    ///
    /// A port on USB ignores it.
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, default_value_t = serial::BAUD)]
    pub(crate) baud: u32,
    /// Command for the device, such as "f 819.2"; repeatable
    ///
    /// A line for the device's command line; `?` lists the commands.
    /// The sample rate in Hz:
    /// Example: --send "f 819.2"
    #[arg(verbatim_doc_comment, long, help_heading = INPUT, value_name = "COMMAND")]
    pub(crate) send: Vec<String>,
    /// End after so many seconds [default: at the end]
    ///
    /// Without it: when q is pressed, at Ctrl-C, or if the device hangs up.
    #[arg(verbatim_doc_comment, long, value_name = "S", value_parser = duration)]
    pub(crate) seconds: Option<f64>,
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
    /// Virtual time, s [default: 3600]
    ///
    /// An hour takes some seconds.
    #[arg(verbatim_doc_comment, long, allow_negative_numbers = true, value_parser = duration)]
    pub(crate) seconds: Option<f64>,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// N, B and K alone: no line, no effect of temperature
    ///
    /// Without it gyro z has a line of 0.2 deg/s at 20.5 Hz, and gyro x
    /// follows the temperature with 0.05 deg/s/°C.
    #[arg(verbatim_doc_comment, long)]
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
    /// Print every sentence and table of every channel
    ///
    /// Instead of one screen.
    #[arg(verbatim_doc_comment, long, conflicts_with = "quiet")]
    pub(crate) full: bool,
    /// Print nothing.
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Report as .html, .json, .svg, .yaml and others
    ///
    /// May be given several times. The ending of FILE chooses the format:
    ///   .json  the whole report, for programs and `imunoise compare`
    ///   .html  the whole report as one page with every figure
    ///   .svg   every figure, as FILE-gyro_x-allan.svg and so on
    ///   .csv   every parameter of every channel with 95 % bounds
    ///   .yaml  noise for Kalibr, in rad/s and m/s^2
    ///   .m     noise for MATLAB's imuSensor
    ///   .py    noise for GTSAM
    ///   .sdf   an IMU for Gazebo
    /// FORMAT=FILE chooses it by name: openvins, vins, orbslam3, kf-gins,
    /// basalt, or json, html, svg, csv, kalibr, matlab, gtsam, gazebo.
    /// The name - is JSON on standard output, FORMAT=- another format.
    /// Example: -o report.html -o imu.yaml -o openvins=chain.yaml
    #[arg(verbatim_doc_comment, short, long = "output", value_name = "FILE", value_parser = OsStringValueParser::new().try_map(output_file))]
    pub(crate) outputs: Vec<OutputFile>,
    /// Overwrite files that exist
    ///
    /// Without it they are kept, and the command ends with exit code 1.
    #[arg(verbatim_doc_comment, short, long)]
    pub(crate) force: bool,
    /// One number for three axes: rms [default] or worst
    ///
    /// For formats that have one number for x, y and z: their root mean
    /// square, or the largest.
    #[arg(
        verbatim_doc_comment,
        long = "combine-axes",
        value_name = "HOW",
        value_enum,
        default_value_t,
        requires = "outputs",
        hide_possible_values = true,
        hide_default_value = true
    )]
    pub(crate) axis: AxisChoice,
}

impl OutputArguments {
    /// True if an output is standard output, to which nothing else may be written then.
    pub(crate) fn prints_to_standard_output(&self) -> bool {
        self.outputs.iter().any(|output| is_standard_stream(&output.file))
    }
}

/// Where a result goes that is no report.
#[derive(Debug, Args)]
pub(crate) struct JsonArgument {
    /// Write the result as JSON; - for standard output
    ///
    /// Example: -o result.json
    #[arg(verbatim_doc_comment, short, long = "output", value_name = "FILE", value_parser = OsStringValueParser::new().try_map(json_file))]
    pub(crate) output: Option<OutputFile>,
    /// Overwrite files that exist
    ///
    /// Without it they are kept, and the command ends with exit code 1.
    #[arg(verbatim_doc_comment, short, long)]
    pub(crate) force: bool,
}

impl JsonArgument {
    /// The file, if one is given.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.output.as_ref().map(|output| output.file.as_path())
    }
}

#[cfg(test)]
mod tests {
    use super::{Cli, with_subcommand};
    use clap::{CommandFactory, Parser};

    /// Splits a command line as a shell does; quotation marks may contain blanks.
    fn words(line: &str) -> Vec<String> {
        let parts = line.split('"').enumerate();
        let words = |(at, part): (usize, &str)| -> Vec<String> {
            if at % 2 == 1 { vec![part.to_owned()] } else { part.split_whitespace().map(str::to_owned).collect() }
        };
        parts.flat_map(words).collect()
    }

    fn is_taken(words: &[String]) -> bool {
        Cli::try_parse_from(with_subcommand(words.iter().map(Into::into).collect())).is_ok()
    }

    #[test]
    fn every_command_and_option_has_examples_that_the_program_takes() {
        Cli::command().debug_assert();
        let program = Cli::command();
        let mut of_options = 0;
        for command in std::iter::once(&program).chain(program.get_subcommands()) {
            let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            let lines = text.lines().filter(|line| line.starts_with("  imunoise"));
            let examples: Vec<_> = lines.filter_map(|line| line.trim_start().split("   ").next()).map(words).collect();
            assert!(!examples.is_empty(), "{}", command.get_name());
            for example in &examples {
                assert!(is_taken(example), "{example:?}");
            }
            // The example of an option must be valid with at least one example of the command.
            let texts = command.get_arguments().filter_map(|argument| argument.get_long_help());
            for line in texts.flat_map(|text| text.to_string().lines().map(str::to_owned).collect::<Vec<_>>()) {
                let Some(options) = line.strip_prefix("Example: ").map(words) else { continue };
                let is_whole = options[0] == "imunoise";
                let in_one = examples.iter().any(|example| is_taken(&[example.as_slice(), &options].concat()));
                assert!(if is_whole { is_taken(&options) } else { in_one }, "{}: {line}", command.get_name());
                of_options += 1;
            }
        }
        assert!(of_options > 30, "{of_options}");
    }
}
