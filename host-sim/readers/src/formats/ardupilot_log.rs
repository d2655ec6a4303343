//! DataFlash logs of ArduPilot (`.bin`): IMU messages, and batches of raw samples (ISBH, ISBD). The crate
//! `ardupilot-binlog` 0.2 panics at a stated length below 3.

use crate::columns::{ACCELEROMETER, AvailableColumn, GYROSCOPE, ReadingNote, Unit};
use crate::formats::message_layout::Scalar;
use crate::formats::topics::{EachRow, Offer, Source, Topic};
use crate::input::{Budget, FileBytes, InputError, Metered, Reason};
use crate::rows::{Ending, Number, TopicSensor};
use std::collections::BTreeMap;
use std::io::{self, BufReader, ErrorKind, Read};

const FORMAT: &str = "ArduPilot log";

/// First two bytes of a message, before its type.
const START: [u8; 2] = [0xA3, 0x95];
/// Description of a type, and its length.
const FMT: u8 = 0x80;
const FMT_BYTES: usize = 89;
pub(crate) const MAGIC: [u8; 3] = [START[0], START[1], FMT];

const BATCH_SAMPLES: usize = 32;

/// Vectors of an inertial sensor with channels and units.
const VECTORS: [([&str; 3], [&str; 3], &str); 2] =
    [(["GyrX", "GyrY", "GyrZ"], GYROSCOPE, "rad/s"), (["AccX", "AccY", "AccZ"], ACCELEROMETER, "m/s^2")];
const TEMPERATURE: &str = "T";
/// Times with units; the first one present is that of the samples.
const TIMES: [(&str, &str); 4] = [("SampleUS", "us"), ("TimeUS", "us"), ("TimeMS", "ms"), ("TimeS", "s")];
/// Number of a sensor among several.
const INSTANCE: &str = "I";

/// The rows of a topic; the least of known sensors is the default.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Rows {
    GyroscopeBatches(i64),
    /// By name, and number of the sensor.
    Messages(String, Option<i64>),
    AccelerometerBatches(i64),
}

impl Rows {
    fn name(&self) -> String {
        match self {
            Self::GyroscopeBatches(instance) => format!("gyro_batches:{instance}"),
            Self::Messages(name, Some(instance)) => format!("{name}:{instance}"),
            Self::Messages(name, None) => name.clone(),
            Self::AccelerometerBatches(instance) => format!("accel_batches:{instance}"),
        }
    }

    fn topic(&self, format: Option<&MessageFormat>, rows: u64) -> Topic {
        let topic = Topic { name: self.name(), rows: Some(rows), ..Topic::default() };
        let mut sensor = TopicSensor::default();
        let (Self::Messages(name, _), Some(format)) = (self, format) else {
            let is_gyroscope = matches!(self, Self::GyroscopeBatches(_));
            let (_, channels, unit) = VECTORS[usize::from(!is_gyroscope)];
            sensor.columns.push(("time", 0, None));
            sensor.add_axes(channels, [1, 2, 3], unit);
            let axes = ["x", "y", "z"].map(|axis| AvailableColumn { name: axis.to_owned(), unit: None });
            let columns = std::iter::once(AvailableColumn::known("time", "us")).chain(axes).collect();
            let kind = if is_gyroscope { "gyro_batches" } else { "accel_batches" };
            return Topic { kind: kind.to_owned(), columns, sensors: vec![sensor], ..topic };
        };
        let at = |label: &str| format.fields.iter().position(|(known, ..)| known == label);
        if let Some(time) = TIMES.iter().find_map(|(label, _)| at(label)) {
            sensor.columns.push(("time", time, None));
            for (labels, channels, unit) in VECTORS {
                if let [Some(x), Some(y), Some(z)] = labels.map(at) {
                    sensor.add_axes(channels, [x, y, z], unit);
                }
            }
        }
        let is_sensor = sensor.columns.len() > 1;
        if let Some(temperature) = at(TEMPERATURE).filter(|_| is_sensor) {
            sensor.columns.push(("temp", temperature, Unit::parse("degC")));
        }
        let column = |(label, ..): &(String, char, usize)| match TIMES.iter().find(|(known, _)| known == label) {
            Some((_, unit)) => AvailableColumn::known(label, unit),
            None => AvailableColumn { name: label.clone(), unit: None },
        };
        let columns = format.fields.iter().map(column).collect();
        let sensors = Some(sensor).filter(|_| is_sensor).into_iter().collect();
        Topic { kind: name.clone(), columns, sensors, ..topic }
    }
}

pub(crate) struct ArduPilotSource<'a> {
    file: &'a FileBytes,
    offer: Offer,
    rows: Vec<Rows>,
    budget: Budget,
}

impl<'a> ArduPilotSource<'a> {
    pub(crate) fn open(file: &'a FileBytes, budget: Budget) -> Result<Self, InputError> {
        let mut counted: BTreeMap<Rows, u64> = BTreeMap::new();
        let Log { formats, .. } = for_each_sample(file, budget, &mut |rows, _| {
            match counted.get_mut(rows) {
                Some(count) => *count += 1,
                None => _ = counted.insert(rows.clone(), 1),
            }
            Ok(())
        })?;
        let format = |rows: &Rows| match rows {
            Rows::Messages(name, _) => formats.values().find(|format| format.name == *name),
            _ => None,
        };
        let topics: Vec<Topic> = counted.iter().map(|(rows, count)| rows.topic(format(rows), *count)).collect();
        let rows: Vec<Rows> = counted.into_keys().collect();
        let preferred = topics.iter().find(|topic| !topic.sensors.is_empty()).map(|topic| topic.name.clone());
        Ok(Self { file, offer: Offer { preferred, ..Offer::new(FORMAT, topics) }, rows, budget })
    }
}

impl Source for ArduPilotSource<'_> {
    fn offer(&self) -> &Offer {
        &self.offer
    }

    fn read(&mut self, topic: usize, columns: &[usize], each: &mut EachRow) -> Result<Ending, InputError> {
        let wanted = &self.rows[topic];
        let mut picked = Vec::new();
        let Log { skipped, .. } = for_each_sample(self.file, self.budget, &mut |rows, row| {
            if rows != wanted {
                return Ok(());
            }
            picked.clear();
            picked.extend(columns.iter().map(|&at| row(at)));
            each(&picked)
        })?;
        let note = format!("{skipped} bytes of the log are no message and are skipped");
        Ok(Ending {
            damage: None,
            notes: Some(note).filter(|_| skipped > 0).map(ReadingNote::from).into_iter().collect(),
        })
    }
}

struct Batch {
    number: i64,
    rows: Rows,
    /// Counts per unit.
    multiplier: f64,
    start_us: i64,
    rate_hz: f64,
    samples: usize,
}

impl Batch {
    /// From ISBH; `None` for unknown sensors, or without scale or rate.
    fn from_header(header: &LogMessage) -> Option<Self> {
        let instance = header.integer("instance")?;
        let rows = match header.integer("type")? {
            0 => Rows::AccelerometerBatches(instance),
            1 => Rows::GyroscopeBatches(instance),
            _ => return None,
        };
        let (multiplier, rate_hz) = (header.number("mul")?.value(), header.number("smp_rate")?.value());
        let (number, start_us) = (header.integer("N")?, header.integer("SampleUS")?);
        let is_usable = multiplier > 0.0 && rate_hz > 0.0 && rate_hz.is_finite();
        is_usable.then_some(Self { number, rows, multiplier, start_us, rate_hz, samples: 0 })
    }
}

struct Log {
    formats: BTreeMap<u8, MessageFormat>,
    /// Bytes outside of messages.
    skipped: u64,
}

/// Gets the row's topic and its numbers by position.
type EachSample<'a> = dyn FnMut(&Rows, &dyn Fn(usize) -> Number) -> Result<(), InputError> + 'a;

fn for_each_sample(file: &FileBytes, budget: Budget, each: &mut EachSample) -> Result<Log, InputError> {
    let fail = |error| file.error(Reason::from_io(error));
    let input = BufReader::new(file.open().map_err(fail)?);
    let mut messages = Messages::new(Metered::new(input, budget.meter()));
    let mut batch: Option<Batch> = None;
    // By type: name and last instance.
    let mut known: BTreeMap<u8, Rows> = BTreeMap::new();
    while let Some(message) = messages.next().map_err(fail)? {
        match message.format.name.as_str() {
            "FMT" => {}
            "ISBH" => batch = Batch::from_header(&message),
            "ISBD" => {
                // A missing sequence number makes its samples a gap.
                let (Some(batch), Some(sequence)) = (batch.as_mut(), message.integer("seqno")) else { continue };
                if message.integer("N") != Some(batch.number) || sequence < 0 {
                    continue;
                }
                batch.samples = sequence as usize * BATCH_SAMPLES;
                for at in 0..BATCH_SAMPLES {
                    let after_us = batch.samples as f64 * 1e6 / batch.rate_hz;
                    batch.samples += 1;
                    let axis = |label: &str| {
                        message.element(label, at).map_or(f64::NAN, |count| f64::from(count) / batch.multiplier)
                    };
                    each(&batch.rows, &|column| match column {
                        // Integers keep every digit; a fraction of a microsecond is below the tick.
                        0 => Number::Real(batch.start_us as f64 + after_us),
                        column => Number::Real(axis(["x", "y", "z"][(column - 1).min(2)])),
                    })?;
                }
            }
            name => {
                let instance = message.integer(INSTANCE);
                let new = || Rows::Messages(name.to_owned(), instance);
                let rows = known.entry(message.bytes[2]).or_insert_with(new);
                if !matches!(rows, Rows::Messages(_, of) if *of == instance) {
                    *rows = new();
                }
                each(rows, &|column| message.number_at(column).unwrap_or(Number::Real(f64::NAN)))?;
            }
        }
    }
    Ok(Log { formats: messages.formats, skipped: messages.skipped })
}

#[derive(Debug, Clone, PartialEq)]
struct MessageFormat {
    name: String,
    length: usize,
    fields: Vec<(String, char, usize)>,
}

struct LogMessage<'a> {
    format: &'a MessageFormat,
    bytes: &'a [u8],
}

impl LogMessage<'_> {
    fn field(&self, label: &str) -> Option<(char, &[u8])> {
        let (_, kind, offset) = self.format.fields.iter().find(|(known, ..)| known == label)?;
        Some((*kind, self.bytes.get(*offset..)?))
    }

    fn number(&self, label: &str) -> Option<Number> {
        self.number_at(self.format.fields.iter().position(|(known, ..)| known == label)?)
    }

    fn number_at(&self, position: usize) -> Option<Number> {
        let (_, kind, offset) = self.format.fields.get(position)?;
        let (scalar, divisor) = scalar(*kind)?;
        let number = scalar.read(self.bytes.get(*offset..)?, false);
        Some(if divisor == 1.0 { number } else { Number::Real(number.value() / divisor) })
    }

    fn integer(&self, label: &str) -> Option<i64> {
        match self.number(label)? {
            Number::Integer(integer) => Some(integer),
            Number::Real(_) => None,
        }
    }

    /// Element `at` of 32 numbers of 16 bits.
    fn element(&self, label: &str, at: usize) -> Option<i16> {
        let (kind, bytes) = self.field(label)?;
        let own = bytes.get(2 * at..)?.first_chunk().filter(|_| kind == 'a')?;
        Some(i16::from_le_bytes(*own))
    }
}

/// The encoding of a number, and its divisor; `None` for texts, arrays and unknown types.
fn scalar(kind: char) -> Option<(Scalar, f64)> {
    const HUNDREDTHS: f64 = 100.0;
    Some(match kind {
        'b' => (Scalar::Signed(1), 1.0),
        'B' | 'M' => (Scalar::Unsigned(1), 1.0),
        'h' => (Scalar::Signed(2), 1.0),
        'H' => (Scalar::Unsigned(2), 1.0),
        'c' => (Scalar::Signed(2), HUNDREDTHS),
        'C' => (Scalar::Unsigned(2), HUNDREDTHS),
        'i' | 'L' => (Scalar::Signed(4), 1.0),
        'I' => (Scalar::Unsigned(4), 1.0),
        'e' => (Scalar::Signed(4), HUNDREDTHS),
        'E' => (Scalar::Unsigned(4), HUNDREDTHS),
        'q' => (Scalar::Signed(8), 1.0),
        'Q' => (Scalar::Unsigned(8), 1.0),
        'g' => (Scalar::Float(2), 1.0),
        'f' => (Scalar::Float(4), 1.0),
        'd' => (Scalar::Float(8), 1.0),
        _ => return None,
    })
}

fn field_bytes(kind: char) -> Option<usize> {
    match kind {
        'n' => Some(4),
        'N' => Some(16),
        'a' | 'Z' => Some(64),
        number => scalar(number).map(|(scalar, _)| scalar.bytes()),
    }
}

struct Messages<R> {
    input: R,
    pending: Vec<u8>,
    current: Vec<u8>,
    formats: BTreeMap<u8, MessageFormat>,
    skipped: u64,
}

impl<R: Read> Messages<R> {
    fn new(input: R) -> Self {
        let fmt = MessageFormat { name: "FMT".to_owned(), length: FMT_BYTES, fields: Vec::new() };
        let formats = BTreeMap::from([(FMT, fmt)]);
        Self { input, pending: Vec::new(), current: Vec::new(), formats, skipped: 0 }
    }

    /// Reads until `count` bytes are pending; false at the end.
    fn has(&mut self, count: usize) -> io::Result<bool> {
        while self.pending.len() < count {
            let start = self.pending.len();
            self.pending.resize(count, 0);
            let read = match self.input.read(&mut self.pending[start..]) {
                Err(error) if error.kind() == ErrorKind::Interrupted => 0,
                Err(error) => return Err(error),
                Ok(0) => {
                    self.pending.truncate(start);
                    return Ok(false);
                }
                Ok(read) => read,
            };
            self.pending.truncate(start + read);
        }
        Ok(true)
    }

    fn next(&mut self) -> io::Result<Option<LogMessage<'_>>> {
        let kind = loop {
            if !self.has(MAGIC.len())? {
                return Ok(None);
            }
            let length = if self.pending.starts_with(&START) {
                self.formats.get(&self.pending[2]).map(|format| format.length)
            } else {
                None
            };
            match length {
                Some(length) => {
                    if !self.has(length)? {
                        return Ok(None);
                    }
                    break self.pending[2];
                }
                None => {
                    self.pending.remove(0);
                    self.skipped += 1;
                }
            }
        };
        let length = self.formats.get(&kind).map_or(MAGIC.len(), |format| format.length);
        let rest = self.pending.split_off(length);
        self.current = std::mem::replace(&mut self.pending, rest);
        if kind == FMT
            && let Some((described, format)) = described_format(&self.current)
        {
            self.formats.insert(described, format);
        }
        let bytes = &self.current;
        Ok(self.formats.get(&kind).map(|format| LogMessage { format, bytes }))
    }
}

/// `None` for a contradictory description.
fn described_format(message: &[u8]) -> Option<(u8, MessageFormat)> {
    let text = |from: usize, bytes: usize| {
        let field = message.get(from..from + bytes)?;
        let end = field.iter().position(|byte| *byte == 0).unwrap_or(bytes);
        std::str::from_utf8(&field[..end]).ok()
    };
    let (kind, length) = (*message.get(3)?, usize::from(*message.get(4)?));
    let (name, types, labels) = (text(5, 4)?, text(9, 16)?, text(25, 64)?);
    let mut fields = Vec::new();
    let mut offset = MAGIC.len();
    for (label, kind) in labels.split(',').zip(types.chars()) {
        fields.push((label.to_owned(), kind, offset));
        offset += field_bytes(kind)?;
    }
    (kind != FMT && offset <= length).then(|| (kind, MessageFormat { name: name.to_owned(), length, fields }))
}

#[cfg(test)]
mod tests {
    use super::{MAGIC, Messages};

    fn format(kind: u8, length: u8, name: &str, types: &str, labels: &str) -> Vec<u8> {
        let mut bytes = [&MAGIC[..], &[kind, length]].concat();
        for (text, size) in [(name, 4), (types, 16), (labels, 64)] {
            bytes.extend(text.bytes());
            bytes.resize(bytes.len() + size - text.len(), 0);
        }
        bytes
    }

    #[test]
    fn damage_is_skipped_and_no_length_makes_it_panic() {
        let message = [&[0xA3, 0x95, 7][..], &9u16.to_le_bytes()].concat();
        let log = [
            format(7, 5, "ABC", "H", "V"),
            format(8, 1, "BAD", "H", "V"),
            message.clone(),
            vec![0xA3, 0x95, 8, 0xA3, 0x95],
            message.clone(),
            message[..4].to_vec(),
        ]
        .concat();
        let mut messages = Messages::new(log.as_slice());
        let mut values = Vec::new();
        while let Some(message) = messages.next().expect("memory") {
            values.extend(message.number("V").map(|number| number.value()));
        }
        assert_eq!(values, [9.0, 9.0]);
        assert_eq!(messages.skipped, 5);
    }
}
