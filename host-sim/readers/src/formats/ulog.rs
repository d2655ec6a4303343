//! ULog of PX4: sensors by message or FIFO, and any message. The crate `px4-ulog` follows nested formats without limit.

use crate::columns::{ACCELEROMETER, AvailableColumn, GYROSCOPE, ReadingNote};
use crate::formats::message_layout::{Definitions, Encoding, Field, FieldType, MessageLayout, Repeat, Scalar};
use crate::formats::topics::{EachRow, Offer, Source, Topic};
use crate::input::{Budget, FileBytes, InputError, OpenBytes, Reason};
use crate::rows::{Ending, Number, TopicSensor};
use std::collections::{BTreeMap, HashMap};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::rc::Rc;

const FORMAT: &str = "PX4 ULog";

const HEADER_BYTES: u64 = 16;
const FIFO_SAMPLES: usize = 32;
const TIME_UNIT: &str = "us";

/// Three axes of a sensor.
struct Vector {
    channels: [&'static str; 3],
    unit: &'static str,
}
const RATE: Vector = Vector { channels: GYROSCOPE, unit: "rad/s" };
const FORCE: Vector = Vector { channels: ACCELEROMETER, unit: "m/s^2" };
type Axes = ([&'static str; 3], Vector);
const XYZ: [&str; 3] = ["x", "y", "z"];
const SENSORS: [(&str, &[Axes]); 3] = [
    ("sensor_gyro", &[(XYZ, RATE)]),
    (
        "sensor_combined",
        &[
            (["gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"], RATE),
            (["accelerometer_m_s2[0]", "accelerometer_m_s2[1]", "accelerometer_m_s2[2]"], FORCE),
        ],
    ),
    ("sensor_accel", &[(XYZ, FORCE)]),
];
const FIFOS: [(&str, Vector); 2] = [("sensor_gyro_fifo", RATE), ("sensor_accel_fifo", FORCE)];
/// Published with the same times.
const PAIRS: [[&str; 2]; 2] = [["sensor_gyro_fifo", "sensor_accel_fifo"], ["sensor_gyro", "sensor_accel"]];

/// Waiting for the other sensor.
const MOST_WAITING: usize = 1024;
/// Least share of common times.
const MIN_PAIRED: f64 = 0.9;

type Key = (String, u8);

#[derive(Debug, Clone, PartialEq, Eq)]
enum Rows {
    Messages(Key),
    Fifo(Key),
    /// Gyroscope with accelerometer at the same time.
    Pair([&'static str; 2], u8),
}

fn name_of(name: &str, instance: u8) -> String {
    if instance == 0 { name.to_owned() } else { format!("{name}:{instance}") }
}

/// Samples waiting for their pair.
#[derive(Debug, Default)]
struct Pairing {
    /// By the bits of µs, which sort like times.
    waiting: BTreeMap<u64, (usize, [Number; 4])>,
    paired: u64,
    alone: u64,
}

impl Pairing {
    /// Gyroscope 0, accelerometer 1; returns a complete pair.
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

pub(crate) struct UlogSource<'a> {
    file: &'a FileBytes,
    /// Default: the gyroscope with most samples and its accelerometer, or that accelerometer.
    offer: Offer,
    rows: Vec<Rows>,
    budget: Budget,
}

impl<'a> UlogSource<'a> {
    pub(crate) fn open(file: &'a FileBytes, budget: Budget) -> Result<Self, InputError> {
        let mut layouts: BTreeMap<Key, Rc<MessageLayout>> = BTreeMap::new();
        let mut messages: BTreeMap<Key, u64> = BTreeMap::new();
        let mut samples: BTreeMap<Key, u64> = BTreeMap::new();
        let mut pairings: BTreeMap<([&'static str; 2], u8), Pairing> = BTreeMap::new();
        let mut row = Vec::new();
        let damage = for_each_message(file, budget, |message| {
            let key = (message.name.to_owned(), message.instance);
            layouts.entry(key.clone()).or_insert_with(|| Rc::clone(message.layout));
            *messages.entry(key.clone()).or_insert(0) += 1;
            let Some((pair, sensor)) = pair_of(message.name) else { return Ok(()) };
            for_each_sample(&message, &mut row, &mut |sample| {
                *samples.entry(key.clone()).or_insert(0) += 1;
                pairings.entry((pair, message.instance)).or_default().add(sensor, sample);
                Ok(())
            })
        })?;
        let mut source = Self { file, offer: Offer::new(FORMAT, Vec::new()), rows: Vec::new(), budget };
        let count = |key: &Key| samples.get(key).or(messages.get(key)).copied().unwrap_or(0);
        for (key, layout) in &layouts {
            source.add(key, layout, count(key));
        }
        let is_whole = |(pair, instance): &([&'static str; 2], u8), pairing: &Pairing| {
            let most = pair.iter().map(|name| count(&((*name).to_owned(), *instance))).max().unwrap_or(0);
            pairing.paired > 0 && pairing.paired as f64 >= MIN_PAIRED * most as f64
        };
        let pairs: Vec<([&'static str; 2], u8)> =
            pairings.iter().filter(|(key, pairing)| is_whole(key, pairing)).map(|(key, _)| *key).collect();
        for (pair, instance) in &pairs {
            source.add_pair(*pair, *instance, pairings[&(*pair, *instance)].paired);
        }
        // Shared messages, then the first instance.
        let rank = |(at, topic): &(usize, &Topic)| {
            let sensor = topic.sensors.first();
            let has = |axes: [&str; 3]| sensor.is_some_and(|sensor| sensor.has(axes[0]));
            (has(GYROSCOPE), topic.rows, has(ACCELEROMETER), std::cmp::Reverse(*at))
        };
        let is_single = |at: &usize| !matches!(source.rows[*at], Rows::Pair(..));
        let known =
            source.offer.topics.iter().enumerate().filter(|(at, topic)| !topic.sensors.is_empty() && is_single(at));
        let best = known.max_by_key(rank).map(|(at, topic)| match &source.rows[at] {
            Rows::Messages((name, instance)) | Rows::Fifo((name, instance)) => {
                let with_other = pairs.iter().find(|(pair, of)| pair.contains(&name.as_str()) && of == instance);
                with_other.map_or_else(|| topic.name.clone(), |(pair, instance)| pair_name(*pair, *instance))
            }
            Rows::Pair(..) => topic.name.clone(),
        });
        source.offer.preferred = best;
        match damage {
            Some(damage) if source.offer.topics.is_empty() => Err(file.error(damage)),
            _ => Ok(source),
        }
    }

    fn add(&mut self, key: &Key, layout: &MessageLayout, rows: u64) {
        let (name, instance) = key;
        let topic = Topic { name: name_of(name, *instance), kind: name.clone(), rows: Some(rows), ..Topic::default() };
        if let Some((_, vector)) = FIFOS.iter().find(|(fifo, _)| fifo == name) {
            let columns = sample_columns(&XYZ);
            let mut sensor = TopicSensor { columns: vec![("time", 0, None)], ..TopicSensor::default() };
            sensor.add_axes(vector.channels, [1, 2, 3], vector.unit);
            self.offer.topics.push(Topic { columns, sensors: vec![sensor], ..topic });
            self.rows.push(Rows::Fifo(key.clone()));
            return;
        }
        let available = |name: &str| {
            if name.starts_with("timestamp") {
                AvailableColumn::known(name, TIME_UNIT)
            } else {
                AvailableColumn { name: name.to_owned(), unit: None }
            }
        };
        let columns = layout.columns();
        let own = columns.iter().map(|column| available(&column.name));
        let all = own.chain([AvailableColumn::known("time", TIME_UNIT)]).collect();
        let mut sensor = TopicSensor { columns: vec![("time", columns.len(), None)], ..TopicSensor::default() };
        for (axes, vector) in SENSORS.iter().find(|(known, _)| known == name).map_or(&[][..], |(_, axes)| axes) {
            let [x, y, z] = axes.map(|axis| columns.iter().position(|column| column.name == axis));
            if let (Some(x), Some(y), Some(z)) = (x, y, z) {
                sensor.add_axes(vector.channels, [x, y, z], vector.unit);
            }
        }
        let sensors = Some(sensor).filter(|sensor| sensor.columns.len() > 1).into_iter().collect();
        self.offer.topics.push(Topic { columns: all, sensors, ..topic });
        self.rows.push(Rows::Messages(key.clone()));
    }

    fn add_pair(&mut self, pair: [&'static str; 2], instance: u8, rows: u64) {
        let columns = sample_columns(&[GYROSCOPE, ACCELEROMETER].concat());
        let mut sensor = TopicSensor { columns: vec![("time", 0, None)], ..TopicSensor::default() };
        sensor.add_axes(RATE.channels, [1, 2, 3], RATE.unit);
        sensor.add_axes(FORCE.channels, [4, 5, 6], FORCE.unit);
        let (name, kind, rows) = (pair_name(pair, instance), pair.join("+"), Some(rows));
        self.offer.topics.push(Topic { name, kind, rows, columns, sensors: vec![sensor], ..Topic::default() });
        self.rows.push(Rows::Pair(pair, instance));
    }
}

fn pair_name(pair: [&str; 2], instance: u8) -> String {
    name_of(&pair.join("+"), instance)
}

fn sample_columns(names: &[&str]) -> Vec<AvailableColumn> {
    let values = names.iter().map(|name| AvailableColumn { name: (*name).to_owned(), unit: None });
    std::iter::once(AvailableColumn::known("time", TIME_UNIT)).chain(values).collect()
}

fn pair_of(message: &str) -> Option<([&'static str; 2], usize)> {
    PAIRS.iter().find_map(|pair| Some((*pair, pair.iter().position(|of| *of == message)?)))
}

impl Source for UlogSource<'_> {
    fn offer(&self) -> &Offer {
        &self.offer
    }

    fn read(&mut self, topic: usize, columns: &[usize], each: &mut EachRow) -> Result<Ending, InputError> {
        let rows = &self.rows[topic];
        let mut pairing = Pairing::default();
        let (mut decoded, mut picked) = (Vec::new(), Vec::new());
        let mut pick = |row: &[Number]| {
            picked.clear();
            picked.extend(columns.iter().map(|&at| row.get(at).copied().unwrap_or(Number::Real(f64::NAN))));
            each(&picked)
        };
        let is = |message: &Message, (name, instance): &Key| message.name == name && message.instance == *instance;
        let damage = for_each_message(self.file, self.budget, |message| match rows {
            Rows::Messages(key) if is(&message, key) => {
                let time = decode(&message, &mut decoded);
                decoded.push(time);
                pick(&decoded)
            }
            Rows::Fifo(key) if is(&message, key) => {
                for_each_sample(&message, &mut decoded, &mut |sample| pick(&sample))
            }
            Rows::Pair(pair, instance) if *instance == message.instance => {
                let Some(sensor) = pair.iter().position(|member| *member == message.name) else { return Ok(()) };
                for_each_sample(&message, &mut decoded, &mut |sample| {
                    pairing.add(sensor, sample).map_or(Ok(()), |both| pick(&both))
                })
            }
            _ => Ok(()),
        })?;
        let alone = pairing.alone + pairing.waiting.len() as u64;
        let name = &self.offer.topics[topic].name;
        let note =
            format!("{alone} samples of {name} have no sample of the other sensor at their time and are left out");
        Ok(Ending { damage, notes: Some(note).filter(|_| alone > 0).map(ReadingNote::from).into_iter().collect() })
    }
}

struct Message<'a> {
    name: &'a str,
    instance: u8,
    layout: &'a Rc<MessageLayout>,
    data: &'a [u8],
}

/// Into `row`; returns its time.
fn decode(message: &Message, row: &mut Vec<Number>) -> Number {
    // Final padding is not logged.
    let _ = message.layout.decode(message.data, Encoding::Packed, row);
    let columns = message.layout.columns();
    let number = |name: &str| columns.iter().position(|column| column.name == name).map(|at| row[at]);
    let sampled = number("timestamp_sample").filter(|time| time.value() > 0.0);
    sampled.or_else(|| number("timestamp")).unwrap_or(Number::Real(f64::NAN))
}

fn for_each_sample(
    message: &Message,
    row: &mut Vec<Number>,
    each: &mut dyn FnMut([Number; 4]) -> Result<(), InputError>,
) -> Result<(), InputError> {
    let time = decode(message, row);
    let columns = message.layout.columns();
    let value =
        |name: &str| columns.iter().position(|column| column.name == name).map_or(f64::NAN, |at| row[at].value());
    if FIFOS.iter().all(|(name, _)| *name != message.name) {
        return each([time, Number::Real(value("x")), Number::Real(value("y")), Number::Real(value("z"))]);
    }
    let (interval_us, scale, samples) = (value("dt"), value("scale"), value("samples"));
    // Also for NaN.
    if !(samples >= 0.0 && samples <= FIFO_SAMPLES as f64) {
        return each([Number::Real(f64::NAN); 4]);
    }
    let first = ["x[0]", "y[0]", "z[0]"].map(|name| columns.iter().position(|column| column.name == name));
    let samples = samples as usize;
    for at in 0..samples {
        // The last sample's time.
        let before_us = (samples - 1 - at) as f64 * interval_us;
        let axis = |axis: usize| {
            let count = first[axis].and_then(|first| row.get(first + at)).map_or(f64::NAN, |count| count.value());
            Number::Real(scale * count)
        };
        each([earlier(time, before_us), axis(0), axis(1), axis(2)])?;
    }
    Ok(())
}

/// In µs.
fn earlier(time: Number, before_us: f64) -> Number {
    match time {
        Number::Integer(time) if before_us.fract() == 0.0 => Number::Integer(time.saturating_sub(before_us as i64)),
        other => Number::Real(other.value() - before_us),
    }
}

fn for_each_message(
    file: &FileBytes,
    budget: Budget,
    mut each: impl FnMut(Message) -> Result<(), InputError>,
) -> Result<Option<Reason>, InputError> {
    let fail = |error| file.error(Reason::Io(error));
    let mut input = MessageBytes { input: BufReader::new(file.open().map_err(fail)?), at: 0 };
    // Appended data follow a cut message.
    let mut appended: Vec<u64> = Vec::new();
    let mut meter = budget.meter();
    let mut formats: Definitions = HashMap::new();
    let mut layouts: HashMap<String, Rc<MessageLayout>> = HashMap::new();
    let mut subscriptions: HashMap<u16, (String, u8, Rc<MessageLayout>)> = HashMap::new();
    // Formats that are not understood are left out.
    let mut refused = None;
    let mut bytes = Vec::new();
    input.next(HEADER_BYTES, &mut bytes).map_err(fail)?;
    loop {
        let start = input.at;
        let is_whole = input.next(3, &mut bytes).map_err(fail)?;
        let [low, high, kind] = match bytes.as_slice() {
            [] => return Ok(refused),
            &[low, high, kind] if is_whole => [low, high, kind],
            _ => return Ok(Some(Reason::Truncated { format: FORMAT })),
        };
        let length = u16::from_le_bytes([low, high]);
        let end = start + 3 + u64::from(length);
        if let Some(offset) = appended.iter().copied().find(|offset| (start + 1..end).contains(offset)) {
            input.seek(offset).map_err(fail)?;
            continue;
        }
        if !input.next(u64::from(length), &mut bytes).map_err(fail)? {
            return Ok(Some(Reason::Truncated { format: FORMAT }));
        }
        if let Err(reason) = meter.add_bytes(3 + u64::from(length)) {
            return Ok(Some(reason));
        }
        match kind {
            b'F' => {
                if let Some((name, fields)) = format(&bytes) {
                    formats.insert(name, fields);
                }
            }
            b'A' => {
                let Some((&[instance, low, high], name)) = bytes.split_first_chunk() else { continue };
                let name = String::from_utf8_lossy(name).into_owned();
                let layout = match layouts.get(&name) {
                    Some(layout) => Rc::clone(layout),
                    None => match MessageLayout::new(&name, &formats) {
                        Ok(layout) => Rc::clone(layouts.entry(name.clone()).or_insert(Rc::new(layout))),
                        Err(reason) => {
                            refused.get_or_insert(reason);
                            continue;
                        }
                    },
                };
                subscriptions.insert(u16::from_le_bytes([low, high]), (name, instance, layout));
            }
            b'D' => {
                let Some((&[low, high], data)) = bytes.split_first_chunk() else { continue };
                if let Some((name, instance, layout)) = subscriptions.get(&u16::from_le_bytes([low, high])) {
                    each(Message { name, instance: *instance, layout, data })?;
                }
            }
            b'B' => match flag_bits(&bytes) {
                Ok(offsets) => appended = offsets,
                Err(reason) => return Ok(Some(reason)),
            },
            b'I' | b'M' | b'P' | b'Q' | b'R' | b'L' | b'C' | b'S' | b'O' => {}
            _ => {
                let error = format!("a message of unknown type {kind:#04x}");
                return Ok(Some(Reason::damaged(FORMAT, error)));
            }
        }
    }
}

struct MessageBytes {
    input: BufReader<OpenBytes>,
    at: u64,
}

impl MessageBytes {
    fn next(&mut self, count: u64, bytes: &mut Vec<u8>) -> io::Result<bool> {
        bytes.clear();
        let read = self.input.by_ref().take(count).read_to_end(bytes)? as u64;
        self.at += read;
        Ok(read == count)
    }

    fn seek(&mut self, at: u64) -> io::Result<()> {
        self.at = self.input.seek(SeekFrom::Start(at))?;
        Ok(())
    }
}

/// Offsets of appended data, by the flag bits; an error for unknown incompatible flags.
fn flag_bits(message: &[u8]) -> Result<Vec<u64>, Reason> {
    const DATA_APPENDED: u8 = 1;
    let incompatible = message.get(8..16).unwrap_or_default();
    let unknown =
        incompatible.iter().enumerate().any(|(at, flags)| flags & !(if at == 0 { DATA_APPENDED } else { 0 }) != 0);
    if unknown {
        return Err(Reason::damaged(FORMAT, "it has features that a reader has to know, and this one does not"));
    }
    let offsets = message.get(16..40).unwrap_or_default().chunks_exact(8);
    let offsets = offsets.map(|bytes| bytes.iter().rev().fold(0, |offset, byte| offset << 8 | u64::from(*byte)));
    Ok(offsets.filter(|offset| *offset > 0).collect())
}

/// `sensor_gyro:uint64_t timestamp;float[3] xyz;`.
fn format(text: &[u8]) -> Option<(String, Vec<Field>)> {
    let (name, fields) = std::str::from_utf8(text).ok()?.split_once(':')?;
    let field = |text: &str| {
        let (kind, name) = text.trim().split_once(' ')?;
        let (kind, repeat) = match kind.split_once('[') {
            Some((kind, count)) => (kind, Repeat::Times(count.strip_suffix(']')?.parse().ok()?)),
            None => (kind, Repeat::Once),
        };
        let scalar = match kind {
            "int8_t" => Scalar::Signed(1),
            "int16_t" => Scalar::Signed(2),
            "int32_t" => Scalar::Signed(4),
            "int64_t" => Scalar::Signed(8),
            "uint8_t" | "bool" | "char" => Scalar::Unsigned(1),
            "uint16_t" => Scalar::Unsigned(2),
            "uint32_t" => Scalar::Unsigned(4),
            "uint64_t" => Scalar::Unsigned(8),
            "float" => Scalar::Float(4),
            "double" => Scalar::Float(8),
            other => {
                let kind = FieldType::Nested(other.to_owned());
                return Some(Field { name: name.to_owned(), kind, repeat });
            }
        };
        Some(Field { name: name.to_owned(), kind: FieldType::Scalar(scalar), repeat })
    };
    let fields: Option<Vec<Field>> = fields.split(';').filter(|text| !text.trim().is_empty()).map(field).collect();
    Some((name.to_owned(), fields?))
}

#[cfg(test)]
mod tests {
    use super::{MOST_WAITING, Pairing};
    use crate::rows::Number;

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
