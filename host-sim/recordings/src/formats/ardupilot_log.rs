//! DataFlash logs of ArduPilot (`.bin`): IMU messages, and batches of raw samples (ISBH, ISBD) with gaps between them.
//!
//! The crate `ardupilot-binlog` 0.2 is not used because a format message that states a length below 3 bytes makes it panic.

use crate::formats::message_table::{ACCELEROMETER, Fields, GYROSCOPE, MessageTable, choose_topic};
use crate::input::input_error::{InputError, Reason};
use crate::tables::any_sensor::ReadOptions;
use crate::tables::sensor_table::{Number, SensorTable};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};
use std::path::Path;

const FORMAT: &str = "ArduPilot log";

/// First two bytes of every message; its type follows.
const START: [u8; 2] = [0xA3, 0x95];
/// Type of the message that describes another type, and its length.
const FMT: u8 = 0x80;
const FMT_BYTES: usize = 89;
/// First bytes of every log.
pub(crate) const MAGIC: [u8; 3] = [START[0], START[1], FMT];

/// Samples in an ISBD message.
const BATCH_SAMPLES: usize = 32;

/// What an IMU message has beside its time, and its labels in the log.
const IMU: &[Fields] = &[GYROSCOPE, ACCELEROMETER, &[("temp", "degC")]];
const IMU_LABELS: [&str; 8] = ["TimeUS", "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ", "T"];
/// Unit of the times.
const TIME_UNIT: &str = "us";

/// A source of samples in a log; the first that a log has is read where the user names none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Topic {
    GyroscopeBatches(i64),
    Imu(i64),
    AccelerometerBatches(i64),
}

impl Topic {
    fn name(self) -> String {
        match self {
            Self::GyroscopeBatches(instance) => format!("gyro_batches:{instance}"),
            Self::Imu(instance) => format!("IMU:{instance}"),
            Self::AccelerometerBatches(instance) => format!("accel_batches:{instance}"),
        }
    }

    fn fields(self) -> &'static [Fields] {
        match self {
            Self::GyroscopeBatches(_) => &[GYROSCOPE],
            Self::Imu(_) => IMU,
            Self::AccelerometerBatches(_) => &[ACCELEROMETER],
        }
    }
}

/// Reads a log.
pub(crate) fn read(file: &Path, options: &ReadOptions) -> Result<SensorTable, InputError> {
    let fail = |reason| InputError::file(file, reason);
    let mut counted: BTreeMap<Topic, u64> = BTreeMap::new();
    for_each_sample(file, |topic, _| {
        *counted.entry(topic).or_insert(0) += 1;
        Ok(())
    })?;
    let topics: Vec<(String, Topic)> = counted.keys().map(|&topic| (topic.name(), topic)).collect();
    let wanted = options.topic.as_deref().or(topics.first().map(|(name, _)| name.as_str()));
    let (name, chosen) = choose_topic(FORMAT, &topics, wanted).map_err(fail)?;
    let mut table = MessageTable::new(file, TIME_UNIT, chosen.fields(), options)?;
    let skipped = for_each_sample(file, |topic, row| if topic == *chosen { table.push(row) } else { Ok(()) })?;
    let mut table = table.finish(None)?;
    let others: Vec<&str> = topics.iter().map(|(name, _)| name.as_str()).filter(|other| other != name).collect();
    if options.topic.is_none() && !others.is_empty() {
        table.notes.push(format!("{name} is read; --topic reads one of the others: {}", others.join(", ")));
    }
    if skipped > 0 {
        table.notes.push(format!("{skipped} bytes of the log are no message and are skipped"));
    }
    Ok(table)
}

/// The header of a batch: what its samples are and when they were taken.
struct Batch {
    number: i64,
    topic: Topic,
    /// Counts per unit.
    multiplier: f64,
    start_us: i64,
    rate_hz: f64,
    samples: usize,
}

impl Batch {
    /// From an ISBH message; `None` if it is of no known sensor or has no scale or rate.
    fn from_header(header: &LogMessage) -> Option<Self> {
        let instance = header.integer("instance")?;
        let topic = match header.integer("type")? {
            0 => Topic::AccelerometerBatches(instance),
            1 => Topic::GyroscopeBatches(instance),
            _ => return None,
        };
        let (multiplier, rate_hz) = (header.number("mul")?.value(), header.number("smp_rate")?.value());
        let (number, start_us) = (header.integer("N")?, header.integer("SampleUS")?);
        let is_usable = multiplier > 0.0 && rate_hz > 0.0 && rate_hz.is_finite();
        is_usable.then_some(Self { number, topic, multiplier, start_us, rate_hz, samples: 0 })
    }
}

/// Gives every sample with its topic to `each`; returns the bytes that are no message.
fn for_each_sample(
    file: &Path,
    mut each: impl FnMut(Topic, &[Number]) -> Result<(), InputError>,
) -> Result<u64, InputError> {
    let fail = |error| InputError::file(file, Reason::Io(error));
    let mut messages = Messages::new(BufReader::new(File::open(file).map_err(fail)?));
    let mut batch: Option<Batch> = None;
    while let Some(message) = messages.next().map_err(fail)? {
        match message.format.name.as_str() {
            "IMU" => {
                let row = IMU_LABELS.map(|label| message.number(label).unwrap_or(Number::Real(f64::NAN)));
                each(Topic::Imu(message.integer("I").unwrap_or(0)), &row)?;
            }
            "ISBH" => {
                batch = Batch::from_header(&message);
            }
            "ISBD" => {
                // A message is lost where the sequence number is not the next one: its samples are a gap.
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
                    // Integers keep every digit of a time since the start; the fraction of a microsecond is below its tick.
                    let time = Number::Real(batch.start_us as f64 + after_us);
                    each(
                        batch.topic,
                        &[time, Number::Real(axis("x")), Number::Real(axis("y")), Number::Real(axis("z"))],
                    )?;
                }
            }
            _ => {}
        }
    }
    Ok(messages.skipped)
}

/// A type of message as the log describes it.
#[derive(Debug, Clone, PartialEq)]
struct MessageFormat {
    name: String,
    /// Bytes of the message, with its start and type.
    length: usize,
    /// Label, type and place of each field.
    fields: Vec<(String, char, usize)>,
}

/// A message.
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
        let (kind, bytes) = self.field(label)?;
        let integer = match kind {
            'b' => i64::from(i8::from_le_bytes(*bytes.first_chunk()?)),
            'B' | 'M' => i64::from(*bytes.first()?),
            'h' => i64::from(i16::from_le_bytes(*bytes.first_chunk()?)),
            'H' => i64::from(u16::from_le_bytes(*bytes.first_chunk()?)),
            'i' => i64::from(i32::from_le_bytes(*bytes.first_chunk()?)),
            'I' => i64::from(u32::from_le_bytes(*bytes.first_chunk()?)),
            'q' => i64::from_le_bytes(*bytes.first_chunk()?),
            'Q' => i64::try_from(u64::from_le_bytes(*bytes.first_chunk()?)).ok()?,
            // Hundredths.
            'c' => return Some(Number::Real(f64::from(i16::from_le_bytes(*bytes.first_chunk()?)) / 100.0)),
            'f' => return Some(Number::Real(f64::from(f32::from_le_bytes(*bytes.first_chunk()?)))),
            'd' => return Some(Number::Real(f64::from_le_bytes(*bytes.first_chunk()?))),
            _ => return None,
        };
        Some(Number::Integer(integer))
    }

    fn integer(&self, label: &str) -> Option<i64> {
        match self.number(label)? {
            Number::Integer(integer) => Some(integer),
            Number::Real(_) => None,
        }
    }

    /// Element `at` of an array of 32 numbers of 16 bits.
    fn element(&self, label: &str, at: usize) -> Option<i16> {
        let (kind, bytes) = self.field(label)?;
        let own = bytes.get(2 * at..)?.first_chunk().filter(|_| kind == 'a')?;
        Some(i16::from_le_bytes(*own))
    }
}

/// Bytes of a field; `None` for a type that is not known.
fn field_bytes(kind: char) -> Option<usize> {
    Some(match kind {
        'b' | 'B' | 'M' => 1,
        'h' | 'H' | 'c' | 'C' | 'g' => 2,
        'i' | 'I' | 'e' | 'E' | 'f' | 'L' | 'n' => 4,
        'q' | 'Q' | 'd' => 8,
        'N' => 16,
        'a' | 'Z' => 64,
        _ => return None,
    })
}

/// Reads messages one after the other; what is none is skipped and counted.
struct Messages<R> {
    input: R,
    /// Bytes that were read and not consumed.
    pending: Vec<u8>,
    /// The message that was returned last.
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

    /// Whether `count` bytes are pending; reads more if not.
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

    /// The next message; `None` at the end, where a message may be cut off.
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

/// The type that a format message describes; `None` if it contradicts itself.
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
