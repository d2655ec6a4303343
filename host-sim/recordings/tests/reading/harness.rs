//! Reads a file as the command does, with the options of the command.

use adis16405_driver::{BURST_BYTES, BURST_REQUEST, Burst, Channel, GyroRange};
use flate2::Compression;
use flate2::write::GzEncoder;
use measurement::{MeasuredChannel, Measurement, SensorProfile, adis16405, profile_file};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::ReadOptions;
use recordings::file_format::{RecordedFormat, RecordedInput};
use recordings::inspection::InspectedTable;
use recordings::recorded_file::FrameReader;
use recordings::recording::{Recorder, Recording, TimeStamp};
use recordings::row_writer::{SensorRows, WriteError};
use recordings::sample_stream::{KeptInMemory, Reading as WayOfReading, SampleStream, StreamError};
use recordings::time_base::TimeRange;
use recordings::{ColumnSelection, InputError};
use std::io::Write;
use std::path::Path;

/// Recordings of so many rows are read into memory, longer ones in blocks.
const ROWS_IN_MEMORY: u64 = 1 << 18;

pub(crate) struct Reading {
    pub(crate) samples: Measurement,
    /// The reason, if it was not read to its end.
    pub(crate) damage: Option<String>,
    pub(crate) notes: Vec<String>,
}

impl Reading {
    pub(crate) fn rate_hz(&self) -> f64 {
        self.samples.sample_rate_hz
    }

    /// Samples that are missing between the first and the last.
    pub(crate) fn missing(&self) -> u64 {
        self.dropped("gap")
    }

    pub(crate) fn dropped(&self, cause: &str) -> u64 {
        self.samples.dropped.get(cause).copied().unwrap_or(0)
    }

    pub(crate) fn flagged(&self, cause: &str) -> u64 {
        self.samples.flagged.get(cause).copied().unwrap_or(0)
    }

    pub(crate) fn notes_contain(&self, words: &str) -> bool {
        self.notes.iter().any(|note| note.contains(words))
    }

    pub(crate) fn channel(&self, name: &str) -> &MeasuredChannel {
        self.samples.channels.iter().find(|channel| channel.profile.name == name).expect(name)
    }

    /// Samples of a channel that are no measurement for this reason.
    pub(crate) fn refused(&self, channel: &str, cause: &str) -> usize {
        self.channel(channel).refused.get(cause).map_or(0, Vec::len)
    }

    /// Allan deviation of samples that follow each other by one sample period, in the channel's unit.
    pub(crate) fn neighbours(&self, channel: &str) -> f64 {
        let channel = self.channel(channel);
        let used: Vec<(u64, i32)> = channel.used_samples(&self.samples.slots).collect();
        let pairs = used.windows(2).filter(|pair| pair[1].0 == pair[0].0 + 1);
        let squares: Vec<f64> = pairs.map(|pair| f64::from(pair[1].1 - pair[0].1).powi(2)).collect();
        channel.profile.lsb * (squares.iter().sum::<f64>() / (2 * squares.len()) as f64).sqrt()
    }

    /// Overlapping Allan deviation of a recording without gaps at `n` samples, in the channel's unit.
    pub(crate) fn deviation(&self, channel: &str, n: usize) -> f64 {
        let channel = self.channel(channel);
        let mut sums = vec![0_i64];
        sums.extend(channel.counts.iter().scan(0, |sum, count| {
            *sum += i64::from(*count);
            Some(*sum)
        }));
        let squares = (2 * n..sums.len()).map(|at| ((sums[at] - 2 * sums[at - n] + sums[at - 2 * n]) as f64).powi(2));
        let mean = squares.sum::<f64>() / (sums.len() - 2 * n) as f64;
        channel.profile.lsb * (mean / 2.0).sqrt() / n as f64
    }
}

#[derive(Default)]
pub(crate) struct Options {
    columns: Vec<String>,
    units: Vec<String>,
    topic: Option<String>,
    sensor: Option<String>,
    pub(crate) rate_hz: Option<f64>,
    range: GyroRange,
    part: Option<TimeRange>,
}

impl Options {
    /// Options in pairs, as in `["--rate", "100"]`.
    pub(crate) fn new<T: AsRef<str>>(options: &[T]) -> Self {
        let mut read = Self::default();
        let list = |text: &str| text.split(',').map(str::to_owned).collect();
        let number = |text: &str| text.parse::<f64>().expect("a number");
        let mut part = TimeRange { from_s: 0.0, to_s: f64::INFINITY };
        for pair in options.chunks(2) {
            let value = pair[1].as_ref();
            match pair[0].as_ref() {
                "--columns" => read.columns = list(value),
                "--units" => read.units = list(value),
                "--topic" => read.topic = Some(value.to_owned()),
                "--sensor" => read.sensor = Some(value.to_owned()),
                "--rate" => read.rate_hz = Some(number(value)),
                "--range" => read.range = if value == "75" { GyroRange::Dps75 } else { GyroRange::Dps300 },
                "--from" => part.from_s = number(value),
                "--to" => part.to_s = number(value),
                other => panic!("{other}"),
            }
            if ["--from", "--to"].contains(&pair[0].as_ref()) {
                read.part = Some(part);
            }
        }
        read
    }

    fn of_any_sensor(&self, file: &Path) -> Result<ReadOptions, InputError> {
        let sensor = match self.sensor.as_deref() {
            None => SensorProfile::generic(),
            Some("adis16405") => adis16405::profile(self.range.lsb()),
            Some(name) => profile_file::included(name).expect(name),
        };
        let selection = ColumnSelection::parse(&self.columns, &self.units)
            .map_err(|error| InputError::file(file, recordings::Reason::Selection(Box::new(error))))?;
        Ok(ReadOptions { sensor, selection, topic: self.topic.clone() })
    }

    fn are_of_counts(&self) -> bool {
        self.columns.is_empty() && self.units.is_empty() && self.sensor.is_none()
    }
}

pub(crate) fn read<T: AsRef<str>>(name: &str, content: &[u8], options: &[T]) -> Result<Reading, StreamError> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join(name);
    std::fs::write(&file, content).expect("written");
    read_file(&file, options)
}

pub(crate) fn read_file<T: AsRef<str>>(file: &Path, options: &[T]) -> Result<Reading, StreamError> {
    let options = Options::new(options);
    let kept = KeptInMemory { rows: ROWS_IN_MEMORY, rows_with_losses: ROWS_IN_MEMORY, most_lost: 1.0 };
    let reading = WayOfReading::new(options.rate_hz, kept).of_part(options.part);
    let input = RecordedInput::open(file)?;
    let stream = match input.format() {
        RecordedFormat::FrameLog | RecordedFormat::SpiExport => SampleStream::recorded(bursts(&input)?, reading)?,
        RecordedFormat::CountTable if options.are_of_counts() => SampleStream::counts(input, options.range, reading)?,
        _ => SampleStream::any_sensor(input, options.of_any_sensor(file)?, reading)?,
    };
    assert!(stream.is_in_memory(), "{}: more rows than these tests read", file.display());
    let damage = stream.rows_read().damage.clone();
    let notes = stream.notes().iter().map(ToString::to_string).chain(damage.clone()).collect();
    Ok(Reading { samples: stream.into_beginning(), damage, notes })
}

/// The bursts of a log of the SPI bus in its default range, without the driver.
fn bursts(input: &RecordedInput) -> Result<Recording, InputError> {
    let Some(mut frames) = FrameReader::open(input.bytes())? else { panic!("a log of the bus") };
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), GyroRange::default());
    while let Some(captured) = frames.next()? {
        let frame = captured.frame;
        let answer: Option<[u8; BURST_BYTES]> = frame.miso.try_into().ok();
        if let Some(answer) = answer.filter(|_| frame.mosi.starts_with(&BURST_REQUEST[..2])) {
            recorder.push(TimeStamp::from_time(frame.time_s), &Burst::from_bytes(&answer));
        }
    }
    let recording = recorder.finish();
    Ok(Recording { damage: frames.take_damage(recording.samples.len() as u64), ..recording })
}

pub(crate) fn rows<T: AsRef<str>>(file: &Path, options: &[T]) -> Result<String, StreamError> {
    let folder = tempfile::tempdir().expect("a folder");
    let table = folder.path().join("table.csv");
    let input = RecordedInput::open(file)?;
    sensor_rows(&input, options)?.write_table(&table).map_err(unwritten)?;
    Ok(std::fs::read_to_string(&table).expect("a table"))
}

pub(crate) fn write_array(file: &Path, array: &Path) -> Result<Vec<String>, StreamError> {
    let input = RecordedInput::open(file)?;
    Ok(sensor_rows(&input, &[""; 0])?.write_array(array).map_err(unwritten)?.columns)
}

fn sensor_rows<'a, T: AsRef<str>>(input: &'a RecordedInput, options: &[T]) -> Result<SensorRows<'a>, InputError> {
    let options = Options::new(options);
    let (part, stated_hz) = (options.part, options.rate_hz);
    Ok(SensorRows { input, options: options.of_any_sensor(input.name())?, part, stated_hz })
}

fn unwritten(error: WriteError) -> StreamError {
    match error {
        WriteError::Read(error) => error,
        WriteError::Write(error) => panic!("{error}"),
    }
}

pub(crate) fn inspect(file: &Path) -> Vec<InspectedTable> {
    let input = RecordedInput::open(file).unwrap_or_else(|error| panic!("{error}"));
    input.inspect(None, &ColumnSelection::parse(&[], &[]).expect("nothing")).unwrap_or_else(|error| panic!("{error}"))
}

pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}

/// Nearly normal numbers with a standard deviation of 1: sums of twelve uniform ones.
pub(crate) fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    move || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}
