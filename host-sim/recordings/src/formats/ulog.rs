//! ULog of PX4: gyroscopes and accelerometers, one sample a message or a FIFO of samples a message.

use crate::formats::message_table::{ACCELEROMETER, Fields, GYROSCOPE, MessageTable, choose_topic};
use crate::input::input_error::{InputError, Reason};
use crate::tables::any_sensor::ReadOptions;
use crate::tables::sensor_table::{Number, SensorTable};
use px4_ulog::stream_parser::model::FlattenedFieldType;
use px4_ulog::stream_parser::{DataMessage, LogParser};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

const FORMAT: &str = "PX4 ULog";

/// Bytes that are read at a time.
const BUFFER_BYTES: usize = 1 << 16;

/// Samples of a FIFO message.
const FIFO_SAMPLES: usize = 32;

/// The messages that are read: name, and what they have beside their time.
const MESSAGES: [(&str, &[Fields]); 5] = [
    ("sensor_gyro_fifo", &[GYROSCOPE]),
    ("sensor_gyro", &[GYROSCOPE]),
    ("sensor_combined", &[GYROSCOPE, ACCELEROMETER]),
    ("sensor_accel_fifo", &[ACCELEROMETER]),
    ("sensor_accel", &[ACCELEROMETER]),
];
/// Positions in [`MESSAGES`] of gyroscope and accelerometer, which drivers of one part publish with the same times.
const PAIRS: [[usize; 2]; 2] = [[0, 3], [1, 4]];
/// Unit of the times, which are those of the samples.
const TIME_UNIT: &str = "us";

/// Samples that wait for that of the other sensor at most.
const MOST_WAITING: usize = 1024;
/// Share of the samples that must have the time of one of the other sensor if both are to be read as one.
const MIN_PAIRED: f64 = 0.9;

/// Samples that a log has: of a message by its position in [`MESSAGES`], or of a gyroscope with its accelerometer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Topic {
    Single { message: usize, instance: u8 },
    Pair { pair: [usize; 2], instance: u8 },
}

impl Topic {
    fn name(self) -> String {
        let (name, instance) = match self {
            Self::Single { message, instance } => (MESSAGES[message].0.to_owned(), instance),
            Self::Pair { pair: [gyroscope, accelerometer], instance } => {
                (format!("{}+{}", MESSAGES[gyroscope].0, MESSAGES[accelerometer].0), instance)
            }
        };
        if instance == 0 { name } else { format!("{name}:{instance}") }
    }

    fn fields(self) -> &'static [Fields] {
        match self {
            Self::Single { message, .. } => MESSAGES[message].1,
            Self::Pair { .. } => &[GYROSCOPE, ACCELEROMETER],
        }
    }
}

/// Samples of a gyroscope and an accelerometer that wait for one of the other sensor at the same time.
#[derive(Debug, Default)]
struct Pairing {
    /// By the bits of the time in µs, which sort like the time.
    waiting: BTreeMap<u64, (usize, [Number; 4])>,
    paired: u64,
    /// Samples of which there is no other.
    alone: u64,
}

impl Pairing {
    /// Adds a sample of sensor 0, the gyroscope, or 1, the accelerometer; and gives it with that of the other sensor, once there
    /// are both.
    fn add(&mut self, sensor: usize, sample: [Number; 4]) -> Option<[Number; 7]> {
        let key = sample[0].value().max(0.0).to_bits();
        match self.waiting.remove(&key) {
            Some((other, waiting)) if other != sensor => {
                self.paired += 1;
                let [rates, forces] = if sensor == 0 { [sample, waiting] } else { [waiting, sample] };
                let ([time, x, y, z], [_, u, v, w]) = (rates, forces);
                Some([time, x, y, z, u, v, w])
            }
            before => {
                self.alone += u64::from(before.is_some());
                self.waiting.insert(key, (sensor, sample));
                if self.waiting.len() > MOST_WAITING {
                    self.waiting.pop_first();
                    self.alone += 1;
                }
                None
            }
        }
    }
}

/// What a first pass over a log finds.
struct Contents {
    topics: Vec<(String, Topic)>,
    /// The gyroscope with the most samples, with its accelerometer; the accelerometer with the most where there is no gyroscope.
    preferred: Option<String>,
    damage: Option<Reason>,
}

impl Contents {
    fn of(file: &Path) -> Result<Self, InputError> {
        let mut counted: BTreeMap<(usize, u8), u64> = BTreeMap::new();
        let mut pairings: BTreeMap<([usize; 2], u8), Pairing> = BTreeMap::new();
        let damage = for_each_sample(file, |message, instance, sample| {
            *counted.entry((message, instance)).or_insert(0) += 1;
            if let (Some((pair, sensor)), Ok(sample)) = (sensor_of_pair(message), sample.try_into()) {
                pairings.entry((pair, instance)).or_default().add(sensor, sample);
            }
            Ok(())
        })?;
        let samples = |message: usize, instance: u8| counted.get(&(message, instance)).copied().unwrap_or(0);
        let is_whole = |(pair, instance): ([usize; 2], u8), pairing: &Pairing| {
            let most = pair.iter().map(|&message| samples(message, instance)).max().unwrap_or(0);
            pairing.paired > 0 && pairing.paired as f64 >= MIN_PAIRED * most as f64
        };
        let pairs = pairings.iter().filter(|(key, pairing)| is_whole(**key, pairing)).map(|(key, _)| *key);
        let pairs: Vec<([usize; 2], u8)> = pairs.collect();
        let singles = counted.keys().map(|&(message, instance)| Topic::Single { message, instance });
        let topics: Vec<Topic> =
            singles.chain(pairs.iter().map(|&(pair, instance)| Topic::Pair { pair, instance })).collect();
        // The message that both sensors share before others with as many samples, and the first instance.
        let has_gyroscope = |message: usize| MESSAGES[message].1.contains(&GYROSCOPE);
        let rank = |(key, samples): &(&(usize, u8), &u64)| {
            (has_gyroscope(key.0), **samples, MESSAGES[key.0].1.len(), std::cmp::Reverse(**key))
        };
        let preferred = counted.iter().max_by_key(rank).map(|(&(message, instance), _)| {
            let with_other = pairs.iter().find(|(pair, of)| pair.contains(&message) && *of == instance);
            with_other.map_or(Topic::Single { message, instance }, |&(pair, instance)| Topic::Pair { pair, instance })
        });
        Ok(Self {
            topics: topics.into_iter().map(|topic| (topic.name(), topic)).collect(),
            preferred: preferred.map(Topic::name),
            damage,
        })
    }
}

/// The pair that a message belongs to, and whether it is its first or second.
fn sensor_of_pair(message: usize) -> Option<([usize; 2], usize)> {
    PAIRS.iter().find_map(|pair| Some((*pair, pair.iter().position(|of| *of == message)?)))
}

/// Reads a log: the topic that the user names, or the one that is preferred.
pub(crate) fn read(file: &Path, options: &ReadOptions) -> Result<SensorTable, InputError> {
    let fail = |reason| InputError::file(file, reason);
    let Contents { topics, preferred, damage } = Contents::of(file)?;
    let wanted = options.topic.as_deref().or(preferred.as_deref());
    let (name, chosen) = match (wanted, damage) {
        (None, Some(damage)) => return Err(fail(damage)),
        _ => choose_topic(FORMAT, &topics, wanted).map_err(fail)?,
    };
    let mut table = MessageTable::new(file, TIME_UNIT, chosen.fields(), options)?;
    let mut pairing = Pairing::default();
    let damage = for_each_sample(file, |message, instance, sample| match *chosen {
        Topic::Single { .. } if *chosen == (Topic::Single { message, instance }) => table.push(sample),
        Topic::Pair { pair, instance: of } if of == instance => {
            let sensor = pair.iter().position(|member| *member == message);
            match (sensor, sample.try_into()) {
                (Some(sensor), Ok(sample)) => pairing.add(sensor, sample).map_or(Ok(()), |both| table.push(&both)),
                _ => Ok(()),
            }
        }
        _ => Ok(()),
    })?;
    let mut table = table.finish(damage)?;
    let alone = pairing.alone + pairing.waiting.len() as u64;
    if alone > 0 {
        table.notes.push(format!(
            "{alone} samples of {name} have no sample of the other sensor at their time and are left out"
        ));
    }
    let others: Vec<&str> = topics.iter().map(|(name, _)| name.as_str()).filter(|other| other != name).collect();
    if options.topic.is_none() && !others.is_empty() {
        table.notes.push(format!("{name} is read; --topic reads one of the others: {}", others.join(", ")));
    }
    Ok(table)
}

/// Gives each sample of [`MESSAGES`] with the instance of its message to `each`; and why there are no more where the file is damaged.
fn for_each_sample(
    file: &Path,
    mut each: impl FnMut(usize, u8, &[Number]) -> Result<(), InputError>,
) -> Result<Option<Reason>, InputError> {
    let fail = |error| InputError::file(file, Reason::Io(error));
    let mut input = File::open(file).map_err(fail)?;
    let mut failure = None;
    let mut on_message = |message: &DataMessage| {
        let name = message.flattened_format.message_name();
        if failure.is_none()
            && let Some(number) = MESSAGES.iter().position(|(known, _)| *known == name)
        {
            let instance = message.multi_id.value();
            failure = samples(message, |sample| each(number, instance, sample)).err();
        }
    };
    let mut parser = LogParser::default();
    parser.set_data_message_callback(&mut on_message);
    let mut buffer = vec![0; BUFFER_BYTES];
    let damage = loop {
        let read = input.read(&mut buffer).map_err(fail)?;
        if read == 0 {
            break parser.has_leftover().then_some(Reason::Truncated { format: FORMAT });
        }
        if let Err(error) = parser.consume_bytes(&buffer[..read]) {
            break Some(Reason::Format { format: FORMAT, error: error.to_string().into() });
        }
    };
    drop(parser);
    failure.map_or(Ok(damage), Err)
}

/// Gives the samples of a message to `each`: the time, then the fields of [`MESSAGES`].
fn samples(message: &DataMessage, mut each: impl FnMut(&[Number]) -> Result<(), InputError>) -> Result<(), InputError> {
    let values = MessageValues(message);
    // Older logs have the time of the message alone.
    let time =
        values.number("timestamp_sample").filter(|time| time.value() > 0.0).or_else(|| values.number("timestamp"));
    let time = time.unwrap_or(Number::Real(f64::NAN));
    let value = |name: &str| values.number(name).map_or(f64::NAN, Number::value);
    match message.flattened_format.message_name() {
        "sensor_gyro_fifo" | "sensor_accel_fifo" => {
            let (interval_us, scale) = (value("dt"), value("scale"));
            let samples = value("samples");
            // Also false for NaN.
            if !(samples >= 0.0 && samples <= FIFO_SAMPLES as f64) {
                return each(&[]);
            }
            let samples = samples as usize;
            for at in 0..samples {
                // The time of the message is that of its last sample.
                let before_us = (samples - 1 - at) as f64 * interval_us;
                let axis = |axis: char| Number::Real(scale * value(&format!("{axis}[{at}]")));
                each(&[earlier(time, before_us), axis('x'), axis('y'), axis('z')])?;
            }
            Ok(())
        }
        "sensor_combined" => {
            let axes = ["gyro_rad", "accelerometer_m_s2"];
            let names = axes.into_iter().flat_map(|name| (0..3).map(move |axis| format!("{name}[{axis}]")));
            let row: Vec<Number> = std::iter::once(time).chain(names.map(|name| Number::Real(value(&name)))).collect();
            each(&row)
        }
        _ => each(&[time, Number::Real(value("x")), Number::Real(value("y")), Number::Real(value("z"))]),
    }
}

/// `time`, in µs, less `before_us`.
fn earlier(time: Number, before_us: f64) -> Number {
    match time {
        Number::Integer(time) if before_us.fract() == 0.0 => Number::Integer(time.saturating_sub(before_us as i64)),
        other => Number::Real(other.value() - before_us),
    }
}

/// The fields of a message by their names.
struct MessageValues<'a>(&'a DataMessage<'a>);

impl MessageValues<'_> {
    /// A field of any type of number; `None` where it is missing or cut off.
    fn number(&self, name: &str) -> Option<Number> {
        use FlattenedFieldType as Type;
        let format = self.0.flattened_format;
        let field = format.field_iter().find(|field| field.flattened_field_name == name)?;
        let bytes = self.0.data.get(usize::from(field.offset)..)?;
        let integer = match field.field_type {
            Type::Int8 => i64::from(i8::from_le_bytes(*bytes.first_chunk()?)),
            Type::UInt8 => i64::from(*bytes.first()?),
            Type::Int16 => i64::from(i16::from_le_bytes(*bytes.first_chunk()?)),
            Type::UInt16 => i64::from(u16::from_le_bytes(*bytes.first_chunk()?)),
            Type::Int32 => i64::from(i32::from_le_bytes(*bytes.first_chunk()?)),
            Type::UInt32 => i64::from(u32::from_le_bytes(*bytes.first_chunk()?)),
            Type::Int64 => i64::from_le_bytes(*bytes.first_chunk()?),
            Type::UInt64 => i64::try_from(u64::from_le_bytes(*bytes.first_chunk()?)).ok()?,
            Type::Float => return Some(Number::Real(f64::from(f32::from_le_bytes(*bytes.first_chunk()?)))),
            Type::Double => return Some(Number::Real(f64::from_le_bytes(*bytes.first_chunk()?))),
            _ => return None,
        };
        Some(Number::Integer(integer))
    }
}

#[cfg(test)]
mod tests {
    use super::{MOST_WAITING, Pairing};
    use crate::tables::sensor_table::Number;

    fn sample(time_us: i64, value: f64) -> [Number; 4] {
        [Number::Integer(time_us), Number::Real(value), Number::Real(value + 1.0), Number::Real(value + 2.0)]
    }

    #[test]
    fn samples_of_one_time_are_paired_in_either_order_and_few_wait() {
        let mut pairing = Pairing::default();
        assert_eq!(pairing.add(0, sample(10, 1.0)), None);
        assert_eq!(pairing.add(1, sample(20, 5.0)), None);
        let values = |row: Option<[Number; 7]>| row.expect("both").map(Number::value);
        assert_eq!(values(pairing.add(1, sample(10, 7.0))), [10.0, 1.0, 2.0, 3.0, 7.0, 8.0, 9.0]);
        assert_eq!(values(pairing.add(0, sample(20, 3.0))), [20.0, 3.0, 4.0, 5.0, 5.0, 6.0, 7.0]);
        for time in 0..10_000 {
            assert_eq!(pairing.add(0, sample(100 + time, 0.0)), None);
        }
        assert_eq!((pairing.waiting.len(), pairing.paired), (MOST_WAITING, 2));
        assert_eq!(pairing.alone, 10_000 - MOST_WAITING as u64);
    }
}
