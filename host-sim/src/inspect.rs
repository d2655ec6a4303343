//! `inspect`: the contents of a file, without an analysis, and the command that would analyse it, with guesses for missing information.

use crate::cli::{self, InputArguments, InspectArguments, RecordingArguments};
use crate::output::{self, Incomplete, note};
use crate::output_files::is_standard_stream;
use anyhow::{Result, anyhow};
use measurement::Measurement;
use recordings::file_format::{RecordedFormat, RecordedInput, TopicDescription};
use recordings::inspection::{ColumnGuess, InspectedColumn, InspectedTable, Proposal};
use recordings::sample_stream::StreamError;
use recordings::time_base::{TimeBaseError, TimeRange};
use recordings::{ColumnSelection, InputError, Printable, ReadMonitor, Reason};
use reports::rounding::compact;
use reports::summary::time_options;
use std::fmt::{self, Display, Write as _};
use std::io::Write;
use std::path::Path;

/// Most columns of a table, and most topics without data, that are shown.
const MOST_COLUMNS: usize = 64;
const MOST_TOPICS: usize = 32;
/// Number of columns of a table above which constant columns are not shown one by one.
const WIDE: usize = 16;

/// Reads a recording as `analyze` does.
type ReadMeasurement = fn(&RecordingArguments) -> Result<Measurement>;

/// Prints the contents of the files of the arguments; `read` reads a log of the bus.
pub(crate) fn run(arguments: &InspectArguments, read: ReadMeasurement) -> Result<()> {
    let InspectArguments { files, topic } = arguments;
    let mut is_complete = true;
    for (number, file) in files.iter().enumerate() {
        let input = RecordedInput::open(file)?;
        let text = match input.format() {
            RecordedFormat::FrameLog | RecordedFormat::SpiExport => describe_bus_log(file, read)?,
            _ => {
                let input_arguments = InputArguments { topic: topic.clone(), ..InputArguments::new(file) };
                let contents = Contents::read(&input, RecordingArguments::new(input_arguments))?;
                is_complete &= !contents.tables.iter().any(|table| table.is_damaged);
                contents.to_string()
            }
        };
        output::print(|out| {
            if number > 0 {
                writeln!(out)?;
            }
            writeln!(out, "{}: {}", Printable(&file.display().to_string()), input.format().name())?;
            out.write_all(text.as_bytes())
        })?;
    }
    Incomplete::check(is_complete)
}

/// Describes a log of the bus. It has no columns to choose, so it is read as `analyze` reads it.
fn describe_bus_log(file: &Path, read: ReadMeasurement) -> Result<String> {
    let input = InputArguments::new(file);
    let measurement = read(&RecordingArguments::new(input))?;
    let Measurement { sample_rate_hz, channels, .. } = &measurement;
    let names: Vec<&str> = channels.iter().map(|channel| channel.profile.name).collect();
    let (samples, periods) = (measurement.len() as u64, measurement.periods());
    Ok(format!(
        "{samples} samples at {sample_rate_hz:.4} Hz in {:.1} s; {} missing in {} gaps\n{}\n",
        periods as f64 / sample_rate_hz,
        periods - samples,
        measurement.gaps(),
        names.join(", ")
    ))
}

/// The arguments for each sensor of the file of `recording`. With `--accept-guess`, missing information is guessed.
///
/// # Errors
/// The file is damaged, or has one sensor, or lacks information that is not guessed.
pub(crate) fn each_sensor(recording: &RecordingArguments) -> Result<Vec<RecordingArguments>> {
    let opened = recording.input.open(&ReadMonitor::default())?;
    let contents = Contents::read(&opened, recording.clone())?;
    let is_offered = |proposal: &&Proposal| {
        contents.several.is_empty() || proposal.topic.as_ref().is_some_and(|topic| contents.several.contains(topic))
    };
    let proposals: Vec<&Proposal> = contents.proposals().filter(is_offered).collect();
    let taken = |proposal: &&Proposal| recording.input.accept_guess && proposal.is_safe() || proposal.is_complete();
    if proposals.is_empty() || !proposals.iter().all(taken) {
        let error = anyhow!(
            "{}: what each sensor is, the file does not say",
            Printable(&recording.input.file.display().to_string())
        );
        return Err(Question { error, text: contents.to_string(), hint: "" }.into());
    }
    let column = |assignment: &String| Some(assignment.split_once('=')?.1.to_owned());
    let columns: Vec<String> = proposals.iter().flat_map(|proposal| &proposal.columns).filter_map(column).collect();
    let of_sensor = |proposal| {
        let mut arguments = contents.arguments(proposal);
        arguments.input.read_by_others.clone_from(&columns);
        arguments
    };
    Ok(proposals.into_iter().map(of_sensor).collect())
}

/// The longest part at rest of the file of `recording`, as `inspect` shows it; `None` if it shows none, or more than one table.
pub(crate) fn part_at_rest(recording: &RecordingArguments) -> Option<TimeRange> {
    let file = &recording.input.file;
    let is_read_again = !is_standard_stream(file);
    let input = is_read_again.then(|| recording.input.open(&ReadMonitor::default()).ok())??;
    match Contents::read(&input, recording.clone()).ok()?.tables.as_slice() {
        [table] => table.part_at_rest(),
        _ => None,
    }
}

/// Content of a file.
struct Contents {
    /// Arguments of the user.
    given: RecordingArguments,
    tables: Vec<InspectedTable>,
    /// Topics that were not read.
    others: Vec<TopicDescription>,
    /// Sensors of one kind.
    several: Vec<String>,
}

impl Contents {
    fn read(input: &RecordedInput, given: RecordingArguments) -> Result<Self> {
        let InputArguments { columns, units, topic, .. } = &given.input;
        let mut tables = input.inspect(topic.as_deref(), &ColumnSelection::parse(columns, units)?)?;
        for proposal in tables.iter_mut().flat_map(|table| &mut table.proposals) {
            // A rate that the user states needs no proposal.
            proposal.lacks_rate &= given.rate.is_none();
            proposal.topic = topic.clone().or(proposal.topic.take());
            proposal.units.splice(0..0, units.iter().cloned());
            if !columns.is_empty() {
                proposal.columns.clone_from(columns);
            }
        }
        let is_read = |name: &str| tables.iter().any(|table| table.topic == name);
        // Arrays are shown with all others.
        let others = if is_read("") { Vec::new() } else { input.contents()? };
        let others = others.into_iter().filter(|of| !is_read(&of.name)).collect();
        let several = if topic.is_some() { Vec::new() } else { input.sensors()? };
        Ok(Self { given, tables, others, several })
    }

    fn proposals(&self) -> impl Iterator<Item = &Proposal> {
        self.tables.iter().flat_map(|table| &table.proposals)
    }

    /// The arguments with the proposal filled in.
    fn arguments(&self, proposal: &Proposal) -> RecordingArguments {
        let mut arguments = self.given.clone();
        arguments.input.topic.clone_from(&proposal.topic);
        arguments.input.columns.clone_from(&proposal.columns);
        arguments.input.units.clone_from(&proposal.units);
        arguments.input.sensor = self.given.input.sensor.clone().or(proposal.sensor.map(str::to_owned));
        if let (None, Some(part)) = (self.given.time_range(), proposal.part) {
            let TimeRange { from_s, to_s } = part.whole_tenths();
            (arguments.from, arguments.to) = (Some(from_s), Some(to_s));
        }
        arguments
    }

    /// The command that analyses a sensor, with the options that the user gave, and its `number` among several in what it writes.
    fn command(&self, proposal: &Proposal, number: Option<usize>) -> String {
        let mut arguments = self.arguments(proposal);
        // If the file has one sensor that the format identifies, the command needs no topic.
        let is_only = self.proposals().count() == 1 && self.several.is_empty() && proposal.is_found;
        arguments.input.topic = arguments.input.topic.filter(|_| !is_only || self.given.input.topic.is_some());
        let file = self.given.input.file.display().to_string();
        let rate = ["--rate", "HZ"].into_iter().filter(|_| proposal.lacks_rate).map(str::to_owned);
        let words = [file].into_iter().chain(arguments.options(false)).chain(rate).chain(cli::other_options(number));
        format!("imunoise analyze {}", words.map(|word| quoted(&word)).collect::<Vec<_>>().join(" "))
    }
}

impl Display for Contents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, table) in self.tables.iter().enumerate() {
            if number > 0 {
                writeln!(f)?;
            }
            write_table(table, f)?;
        }
        if !self.others.is_empty() {
            writeln!(f, "\nother topics:")?;
        }
        for TopicDescription { name, kind, rows, columns, .. } in self.others.iter().take(MOST_TOPICS) {
            let rows = rows.map_or_else(String::new, |rows| format!(", {rows} rows"));
            let lacking = if columns.is_empty() { ", without a definition or numbers" } else { "" };
            writeln!(f, "  {} {}{rows}{lacking}", Printable(name), Printable(kind))?;
        }
        if self.others.len() > MOST_TOPICS {
            writeln!(f, "  … and {} more", self.others.len() - MOST_TOPICS)?;
        }
        if self.tables.is_empty() {
            let how = "where the packages of these types are installed, `ros2 bag convert` to MCAP writes their definitions along";
            return writeln!(f, "\nno topic can be read without its definition; {how}");
        }
        if self.proposals().next().is_none() {
            let how = "say which with --columns and --units, as in --columns gyro_x=COLUMN --units rad/s";
            return writeln!(f, "\nno column is known to be one of an inertial sensor; {how}");
        }
        writeln!(f, "\nto analyse it:")?;
        let are_several = self.proposals().count() > 1;
        for (proposal, number) in self.proposals().zip(1..) {
            writeln!(f, "  {}", self.command(proposal, are_several.then_some(number)))?;
            for doubt in &proposal.doubts {
                writeln!(f, "    in doubt: {doubt}")?;
            }
        }
        // `--each-sensor` accepts these proposals.
        let is_taken = |proposal: &Proposal| proposal.is_complete() || proposal.is_safe();
        if self.proposals().count() > 1 && self.proposals().all(is_taken) {
            let rest = if self.proposals().all(Proposal::is_complete) { "" } else { " --accept-guess" };
            let file = quoted(&self.given.input.file.display().to_string());
            writeln!(f, "all of them, as several recordings:\n  imunoise analyze {file} --each-sensor{rest}")?;
        }
        Ok(())
    }
}

/// Writes rows, rate and gaps of a table, and a line for each column.
fn write_table(table: &InspectedTable, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let InspectedTable { topic, kind, rows, is_cut, columns, rate, stated_rate_hz, duration_s, missing, gaps, .. } =
        table;
    let title: Vec<&str> = [topic.as_str(), kind].into_iter().filter(|text| !text.is_empty()).collect();
    if !title.is_empty() {
        writeln!(f, "{}", Printable(&title.join(" ")))?;
    }
    write!(f, "{}{rows} rows", if *is_cut { "the first " } else { "" })?;
    if let Some(rate) = rate {
        write!(f, " at {:.4} Hz ({:.4} to {:.4})", rate.hz, rate.low_hz, rate.high_hz)?;
    }
    if let Some(hz) = stated_rate_hz {
        write!(f, ", {hz} Hz by the file")?;
    }
    match duration_s {
        Some(duration) => write!(f, " in {duration:.2} s")?,
        None if table.has("time") => write!(f, "; times of an unknown unit")?,
        None => write!(f, "; no time stamps")?,
    }
    match missing {
        _ if !table.has("time") && !table.has("sample") => writeln!(f),
        0 => writeln!(f, "; no sample missing"),
        missing => writeln!(f, "; {missing} samples missing in {gaps} gaps"),
    }?;
    write_steady(table, f)?;
    let mut lines = vec![["column", "unit", "first values", "mean", "noise", "step", "taken for"].map(str::to_owned)];
    let mut reason = "";
    // In a wide table, such as one of messages with covariances, constant columns are only named.
    let is_constant = |column: &&InspectedColumn| {
        columns.len() > WIDE && column.noise == 0.0 && column.guess.is_none() && !column.mean.is_nan()
    };
    let constant: Vec<&str> = columns.iter().filter(is_constant).map(|column| column.name.as_str()).collect();
    let shown = || columns.iter().filter(|column| !is_constant(column));
    for column in shown().take(MOST_COLUMNS) {
        // Neighbouring columns often have the same reason, which is shown once.
        let own = column.guess.as_ref().map_or("", |guess| guess.reason.as_str());
        lines.push(line(column, if own == reason { "" } else { own }));
        reason = own;
    }
    let width = |at: usize| lines.iter().map(|line| line[at].chars().count()).max().unwrap_or(0);
    let widths: [usize; 7] = std::array::from_fn(width);
    for line in &lines {
        let mut text = String::from(" ");
        for (field, width) in line.iter().zip(widths) {
            write!(text, " {field:width$} ")?;
        }
        writeln!(f, "{}", text.trim_end())?;
    }
    if shown().count() > MOST_COLUMNS {
        writeln!(f, "  … and {} columns more", shown().count() - MOST_COLUMNS)?;
    }
    if let [first, .., last] = constant.as_slice() {
        writeln!(f, "  {} columns never change, {} to {}", constant.len(), Printable(first), Printable(last))?;
    }
    table.notes.iter().try_for_each(|note| writeln!(f, "note: {}", Printable(&note.to_string())))
}

fn write_steady(table: &InspectedTable, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let Some(steady) = &table.steady else { return Ok(()) };
    let what = if steady.is_rest { "at rest" } else { "steady (without units, that is all that is known)" };
    match (steady.rows.len(), table.steady_s) {
        (0, _) => writeln!(f, "never {what}"),
        (length, _) if length == table.rows => writeln!(f, "{what} all the time"),
        (_, Some(TimeRange { from_s, to_s })) => {
            writeln!(f, "longest part {what}: {}, in s", time_options(from_s, to_s))
        }
        (_, None) => writeln!(f, "longest part {what}: rows {} to {}", steady.rows.start + 1, steady.rows.end),
    }
}

fn line(column: &InspectedColumn, reason: &str) -> [String; 7] {
    let InspectedColumn { name, unit, first, mean, noise, step, guess } = column;
    let first: Vec<String> = first.iter().map(|value| compact(*value, 6)).collect();
    let guess = guess.as_ref().map_or_else(String::new, |ColumnGuess { channel, unit, .. }| {
        let unit = unit.map_or_else(String::new, |unit| format!(" in {unit}"));
        let reason = if reason.is_empty() { String::new() } else { format!(": {reason}") };
        format!("{channel}{unit}{reason}")
    });
    let is_number = !mean.is_nan();
    [
        Printable(name).to_string(),
        unit.unwrap_or("").to_owned(),
        if is_number { first.join(" ") } else { "no numbers".to_owned() },
        if is_number { compact(*mean, 6) } else { String::new() },
        if is_number { compact(*noise, 3) } else { String::new() },
        step.map_or_else(String::new, |step| compact(step, 6)),
        guess,
    ]
}

/// A text as one word of a shell, without terminal control characters.
fn quoted(text: &str) -> String {
    let text = Printable(text).to_string();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./,=:+@%".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// An error that more options can resolve, with the columns of the file and the command.
#[derive(Debug)]
pub(crate) struct Question {
    error: anyhow::Error,
    /// The table and the command, in lines.
    pub(crate) text: String,
    /// Effect of the option `--accept-guess`, in one line; empty if it has none.
    pub(crate) hint: &'static str,
}

impl Display for Question {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#}", self.error)
    }
}

impl std::error::Error for Question {}

/// The result of `read` for a recording. If the file lacks information, the error shows its columns and the command with the best guess.
/// With `--accept-guess` a safe guess is used, and printed.
pub(crate) fn read_or_ask<R>(
    recording: &RecordingArguments,
    read: impl Fn(&RecordingArguments) -> Result<R>,
) -> Result<R> {
    let error = match read(recording) {
        Ok(read) => return Ok(read),
        Err(error) => error,
    };
    let InputArguments { file, accept_guess, .. } = &recording.input;
    if !is_answered_by_columns(&error) || is_standard_stream(file) {
        return Err(error);
    }
    let opened = recording.input.open(&ReadMonitor::default()).map_err(anyhow::Error::from);
    let Ok(contents) = opened.and_then(|opened| Contents::read(&opened, recording.clone())) else { return Err(error) };
    let proposals: Vec<&Proposal> = contents.proposals().collect();
    let hint = match proposals.as_slice() {
        [proposal] if *accept_guess && proposal.is_safe() => {
            note(format_args!("guessed: {}", contents.command(proposal, None)));
            return read(&contents.arguments(proposal));
        }
        [proposal] if proposal.is_safe() => "--accept-guess takes this guess\n",
        _ if *accept_guess => "--accept-guess takes no guess in doubt, no rate, and none of several\n",
        _ => "",
    };
    Err(Question { error, text: contents.to_string(), hint }.into())
}

/// True if a column, a unit, a topic or a rate is missing.
fn is_answered_by_columns(error: &anyhow::Error) -> bool {
    let by_reason = |error: &InputError| {
        use Reason::{NoSensor, NoTimeUnit, Selection, SeveralTopics, UnequalRows};
        matches!(error.reason, Selection(_) | NoTimeUnit(_) | NoSensor { .. } | SeveralTopics(_) | UnequalRows(_))
    };
    let by_time = |error: &TimeBaseError| matches!(error, TimeBaseError::NoRate);
    error.chain().any(|cause| {
        let of_stream = cause.downcast_ref::<StreamError>();
        of_stream.is_some_and(|error| match error {
            StreamError::Input(error) => by_reason(error),
            StreamError::TimeBase(error) => by_time(error),
        }) || cause.downcast_ref::<InputError>().is_some_and(by_reason)
            || cause.downcast_ref::<TimeBaseError>().is_some_and(by_time)
    })
}
