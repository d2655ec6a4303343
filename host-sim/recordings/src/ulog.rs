//! ULog of PX4: gyroscopes and accelerometers, one sample a message or a FIFO of samples a message.

use crate::any_sensor::ReadOptions;
use crate::input_error::{InputError, Reason};
use crate::message_table::{MessageTable, choose_topic};
use crate::sensor_table::{Number, SensorTable};
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

/// The messages that are read: name, and fields with their units. The time is that of the sample, in µs.
const MESSAGES: [(&str, &[(&str, &str)]); 5] = [
    ("sensor_gyro_fifo", &GYROSCOPE),
    ("sensor_gyro", &GYROSCOPE),
    (
        "sensor_combined",
        &[
            ("time", "us"),
            ("gyro_x", "rad/s"),
            ("gyro_y", "rad/s"),
            ("gyro_z", "rad/s"),
            ("accl_x", "m/s^2"),
            ("accl_y", "m/s^2"),
            ("accl_z", "m/s^2"),
        ],
    ),
    ("sensor_accel_fifo", &ACCELEROMETER),
    ("sensor_accel", &ACCELEROMETER),
];
const GYROSCOPE: [(&str, &str); 4] = [("time", "us"), ("gyro_x", "rad/s"), ("gyro_y", "rad/s"), ("gyro_z", "rad/s")];
const ACCELEROMETER: [(&str, &str); 4] =
    [("time", "us"), ("accl_x", "m/s^2"), ("accl_y", "m/s^2"), ("accl_z", "m/s^2")];

/// Reads a log. Without a topic the first of [`MESSAGES`] that it has is read, in its first instance.
pub(crate) fn read(file: &Path, options: &ReadOptions) -> Result<SensorTable, InputError> {
    let fail = |reason| InputError::file(file, reason);
    let mut counted: BTreeMap<(usize, u8), u64> = BTreeMap::new();
    let damage = for_each_message(file, |number, instance, _| {
        *counted.entry((number, instance)).or_insert(0) += 1;
        Ok(())
    })?;
    let name = |(number, instance): (usize, u8)| match instance {
        0 => MESSAGES[number].0.to_owned(),
        _ => format!("{}:{instance}", MESSAGES[number].0),
    };
    let topics: Vec<(String, (usize, u8))> = counted.keys().map(|&key| (name(key), key)).collect();
    let first = topics.first().map(|(name, _)| name.as_str());
    let wanted = options.topic.as_deref().or(first);
    let (topic, chosen) = match (wanted, damage) {
        (None, Some(damage)) => return Err(fail(damage)),
        _ => choose_topic(FORMAT, &topics, wanted).map_err(fail)?,
    };
    let mut table = MessageTable::new(file, MESSAGES[chosen.0].1, options)?;
    let damage =
        for_each_message(
            file,
            |number, instance, message| {
                if (number, instance) == *chosen { push(&mut table, message) } else { Ok(()) }
            },
        )?;
    let mut table = table.finish(damage)?;
    let others: Vec<&str> = topics.iter().map(|(name, _)| name.as_str()).filter(|name| name != topic).collect();
    if options.topic.is_none() && !others.is_empty() {
        table.notes.push(format!("{topic} is read; --topic reads one of the others: {}", others.join(", ")));
    }
    Ok(table)
}

/// Gives each message of [`MESSAGES`] with its instance to `each`; and why there are no more where the file is damaged.
fn for_each_message(
    file: &Path,
    mut each: impl FnMut(usize, u8, &DataMessage) -> Result<(), InputError>,
) -> Result<Option<Reason>, InputError> {
    let fail = |error| InputError::file(file, Reason::Io(error));
    let mut input = File::open(file).map_err(fail)?;
    let mut failure = None;
    let mut on_message = |message: &DataMessage| {
        let name = message.flattened_format.message_name();
        if failure.is_none()
            && let Some(number) = MESSAGES.iter().position(|(known, _)| *known == name)
        {
            failure = each(number, message.multi_id.value(), message).err();
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

/// The samples of a message.
fn push(table: &mut MessageTable, message: &DataMessage) -> Result<(), InputError> {
    let fields = Fields(message);
    // Older logs have the time of the message alone.
    let time =
        fields.number("timestamp_sample").filter(|time| time.value() > 0.0).or_else(|| fields.number("timestamp"));
    let time = time.unwrap_or(Number::Real(f64::NAN));
    let value = |name: &str| fields.number(name).map_or(f64::NAN, Number::value);
    match message.flattened_format.message_name() {
        "sensor_gyro_fifo" | "sensor_accel_fifo" => {
            let (interval_us, scale) = (value("dt"), value("scale"));
            let samples = value("samples");
            // Also false for NaN.
            if !(samples >= 0.0 && samples <= FIFO_SAMPLES as f64) {
                return table.push(&[]);
            }
            let samples = samples as usize;
            for at in 0..samples {
                // The time of the message is that of its last sample.
                let before_us = (samples - 1 - at) as f64 * interval_us;
                let axis = |axis: char| Number::Real(scale * value(&format!("{axis}[{at}]")));
                table.push(&[earlier(time, before_us), axis('x'), axis('y'), axis('z')])?;
            }
            Ok(())
        }
        "sensor_combined" => {
            let axes = ["gyro_rad", "accelerometer_m_s2"];
            let values = axes.into_iter().flat_map(|name| (0..3).map(move |axis| format!("{name}[{axis}]")));
            let row: Vec<Number> = std::iter::once(time).chain(values.map(|name| Number::Real(value(&name)))).collect();
            table.push(&row)
        }
        _ => table.push(&[time, Number::Real(value("x")), Number::Real(value("y")), Number::Real(value("z"))]),
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
struct Fields<'a>(&'a DataMessage<'a>);

impl Fields<'_> {
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
