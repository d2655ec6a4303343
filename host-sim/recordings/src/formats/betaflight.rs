//! Blackbox logs of Betaflight and INAV (`.bbl`, `.bfl`): gyroscope and accelerometer with the scales of their header, and every other
//! field of the main frames. A file has a log for each flight.

use crate::columns::axes::{ACCELEROMETER, GYROSCOPE};
use crate::columns::column_selection::AvailableColumn;
use crate::formats::blackbox_frames::{BlackboxLog, Damage};
use crate::formats::topics::{EachRow, Ending, Source, Topic, TopicSensor};
use crate::input::input_error::{InputError, Reason};
use crate::tables::sensor_table::Number;

use std::convert::Infallible;
use std::path::Path;

const FORMAT: &str = "blackbox log";
/// First bytes of every log.
pub(crate) const MAGIC: &[u8] = b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n";

/// Fields of the sensors.
const RATES: [&str; 3] = ["gyroADC[0]", "gyroADC[1]", "gyroADC[2]"];
const FORCES: [&str; 3] = ["accSmooth[0]", "accSmooth[1]", "accSmooth[2]"];
/// Columns after the fields: the time, and the number of the frame, those that were dropped included.
const TIME: &str = "time";
const NUMBER: &str = "frame";

/// The logs of a file, which are held in memory as they are in the file.
pub(crate) struct BlackboxSource<'a> {
    file: &'a Path,
    bytes: Vec<u8>,
    /// Where each log begins and ends.
    ranges: Vec<std::ops::Range<usize>>,
    topics: Vec<Topic>,
}

impl<'a> BlackboxSource<'a> {
    pub(crate) fn open(file: &'a Path) -> Result<Self, InputError> {
        let fail = |reason| InputError::file(file, reason);
        let bytes = std::fs::read(file).map_err(|error| fail(Reason::Io(error)))?;
        let mut starts: Vec<usize> = (0..bytes.len()).filter(|&at| bytes[at..].starts_with(MAGIC)).collect();
        starts.push(bytes.len());
        let mut source = Self { file, bytes: Vec::new(), ranges: Vec::new(), topics: Vec::new() };
        let mut refused = None;
        for range in starts.windows(2).map(|ends| ends[0]..ends[1]) {
            match parse(&bytes[range.clone()]) {
                Ok(log) => {
                    let name = format!("log:{}", source.topics.len());
                    source.topics.push(topic(name, &log));
                    source.ranges.push(range);
                }
                Err(reason) => _ = refused.get_or_insert(reason),
            }
        }
        source.bytes = bytes;
        match refused {
            Some(reason) if source.topics.is_empty() => Err(fail(reason)),
            _ => Ok(source),
        }
    }
}

fn parse(log: &[u8]) -> Result<BlackboxLog<'_>, Reason> {
    BlackboxLog::parse(log).map_err(|error| Reason::Format { format: FORMAT, error: error.into() })
}

/// Fields of the main frames, each with the size of 1 in its unit, and the unit.
fn topic(name: String, log: &BlackboxLog) -> Topic {
    let fields: Vec<&str> = log.fields().iter().map(|field| field.name).collect();
    let at = |name: &str| fields.iter().position(|field| *field == name);
    // Baseflight's own scale has another unit. Cleanflight is what Betaflight and INAV state too.
    let rate = if log.header("Firmware type") == Some("Cleanflight") { "deg/s" } else { "" };
    let unit = |name: &str| match name {
        name if RATES.contains(&name) => rate,
        name if FORCES.contains(&name) => "g",
        _ => "",
    };
    let own = fields.iter().map(|name| AvailableColumn::known(name, unit(name)));
    let columns = own.chain([AvailableColumn::known(TIME, "us"), AvailableColumn::known(NUMBER, "")]).collect();
    let mut sensor = TopicSensor {
        columns: vec![("time", fields.len(), None), ("sample", fields.len() + 1, None)],
        ..TopicSensor::default()
    };
    for (names, channels, unit) in [(RATES, GYROSCOPE, rate), (FORCES, ACCELEROMETER, "g")] {
        if let [Some(x), Some(y), Some(z)] = names.map(at) {
            sensor.add_axes(channels, [x, y, z], unit);
        }
    }
    sensor.note = Some("gyroADC is what the flight controller has filtered and rounded".to_owned());
    let sensors = Some(sensor).filter(|sensor| sensor.has(GYROSCOPE[0])).into_iter().collect();
    let revision = log.header("Firmware revision").unwrap_or_default();
    let kind = revision.split(" (").next().unwrap_or_default().to_owned();
    Topic { name, kind, columns, sensors, ..Topic::default() }
}

/// deg/s in a count of the gyroscope: `gyro_scale` is the bits of a float, and a log of high resolution has tenths of it.
fn rate_scale(log: &BlackboxLog) -> f64 {
    let bits = log.header("gyro_scale").and_then(|text| u32::from_str_radix(text.trim_start_matches("0x"), 16).ok());
    let scale = bits.map_or(1.0, |bits| f64::from(f32::from_bits(bits)));
    if log.header("blackbox_high_resolution") == Some("1") { scale / 10.0 } else { scale }
}

/// g in a count of the accelerometer.
fn force_scale(log: &BlackboxLog) -> f64 {
    let counts = log.header("acc_1G").and_then(|text| text.parse::<f64>().ok()).filter(|counts| *counts > 0.0);
    counts.map_or(f64::NAN, f64::recip)
}

/// Part of the median by which the steps between neighbours differ at most.
const JITTER: f64 = 0.1;

/// The usual time between two frames, us: the mean of the steps near the median. `None` of fewer than two frames.
fn usual_step(log: &BlackboxLog) -> Option<f64> {
    let (mut steps, mut last) = (Vec::new(), None);
    let Ok(_) = log.for_each_frame(|_, time| -> Result<(), Infallible> {
        steps.extend(last.filter(|last| *last < time).map(|last| (time - last) as f64));
        last = Some(time);
        Ok(())
    });
    let middle = steps.len() / 2;
    let median = (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)?;
    steps.retain(|step| (step / median - 1.0).abs() <= JITTER);
    Some(steps.iter().sum::<f64>() / steps.len() as f64)
}

impl Source for BlackboxSource<'_> {
    fn format(&self) -> &'static str {
        FORMAT
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn read(&mut self, topic: usize, columns: &[usize], each: &mut EachRow) -> Result<Ending, InputError> {
        let fail = |reason| InputError::file(self.file, reason);
        let log = parse(&self.bytes[self.ranges[topic].clone()]).map_err(fail)?;
        let fields = log.fields();
        let (rate, force) = (rate_scale(&log), force_scale(&log));
        let scale = |&column: &usize| match fields.get(column).map(|field| field.name) {
            Some(name) if RATES.contains(&name) => Some(rate),
            Some(name) if FORCES.contains(&name) => Some(force),
            _ => None,
        };
        let scales: Vec<Option<f64>> = columns.iter().map(scale).collect();
        // The clock of the samples is regular: a frame is at the nearest of its ticks, and later than the one before.
        let step = usual_step(&log).unwrap_or(1.0);
        let (mut number, mut first) = (-1i64, None);
        let mut row = Vec::with_capacity(columns.len());
        let damage = log.for_each_frame(|values, time| {
            let ticks = ((time - *first.get_or_insert(time)) as f64 / step).round() as i64;
            number = ticks.max(number.saturating_add(1));
            row.clear();
            for (&column, scale) in columns.iter().zip(&scales) {
                row.push(match (values.get(column), scale) {
                    (Some(value), Some(scale)) => Number::Real(scale * *value as f64),
                    (Some(value), None) => Number::Integer(*value),
                    _ if column == fields.len() + 1 => Number::Integer(number),
                    _ => Number::Integer(time),
                });
            }
            each(&row)
        })?;
        Ok(Ending { notes: notes(damage), ..Ending::default() })
    }
}

/// What the user should know of damaged places.
fn notes(Damage { places, frames }: Damage) -> Vec<String> {
    let note = format!(
        "the log is damaged at {places} places; what is lost there, and {frames} P frames up to the next I frames, are gaps"
    );
    if places > 0 { vec![note] } else { Vec::new() }
}
