//! Blackbox logs of Betaflight and INAV (`.bbl`, `.bfl`): gyroscope and accelerometer with the scales of their header, and every other
//! field of the main frames. A file has a log for each flight.

use crate::columns::axes::{ACCELEROMETER, GYROSCOPE};
use crate::columns::column_selection::AvailableColumn;
use crate::formats::topics::{EachRow, Ending, Source, Topic, TopicSensor};
use crate::input::input_error::{InputError, Reason};
use crate::tables::sensor_table::Number;

use blackbox_log::frame::{FieldDef, Frame, FrameDef};
use blackbox_log::prelude::ParserEvent;
use blackbox_log::{File as Blackbox, Headers};
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
            match headers(&bytes[range.clone()]) {
                Ok(headers) => {
                    let name = format!("log:{}", source.topics.len());
                    source.topics.push(topic(name, &headers));
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

/// The headers of a log.
fn headers(log: &[u8]) -> Result<Headers<'_>, Reason> {
    let damaged = |error: String| Reason::Format { format: FORMAT, error: error.into() };
    let first = Blackbox::new(log).parse(0);
    let headers = first.ok_or_else(|| damaged("it has no header".to_owned()))?;
    headers.map_err(|error| damaged(error.to_string()))
}

/// Fields of the main frames, each with the size of 1 in its unit, and the unit.
fn topic(name: String, headers: &Headers) -> Topic {
    let fields: Vec<&str> = headers.main_frame_def().iter().map(|FieldDef { name, .. }| name).collect();
    let at = |name: &str| fields.iter().position(|field| *field == name);
    let unit = |name: &str| match name {
        name if RATES.contains(&name) => "deg/s",
        name if FORCES.contains(&name) => "g",
        _ => "",
    };
    let own = fields.iter().map(|name| AvailableColumn::known(name, unit(name)));
    let columns = own.chain([AvailableColumn::known(TIME, "us"), AvailableColumn::known(NUMBER, "")]).collect();
    let mut sensor = TopicSensor {
        columns: vec![("time", fields.len(), None), ("sample", fields.len() + 1, None)],
        ..TopicSensor::default()
    };
    for (names, channels, unit) in [(RATES, GYROSCOPE, "deg/s"), (FORCES, ACCELEROMETER, "g")] {
        if let [Some(x), Some(y), Some(z)] = names.map(at) {
            sensor.add_axes(channels, [x, y, z], unit);
        }
    }
    sensor.note = Some("gyroADC is what the flight controller has filtered and rounded".to_owned());
    let sensors = Some(sensor).filter(|sensor| sensor.has(GYROSCOPE[0])).into_iter().collect();
    let kind = headers.firmware_revision().split(" (").next().unwrap_or_default().to_owned();
    Topic { name, kind, columns, sensors, ..Topic::default() }
}

/// The value of a line such as `H acc_1G:2048` in the header of a log.
fn header<'a>(log: &'a [u8], name: &str) -> Option<&'a str> {
    let lines = log.split(|byte| *byte == b'\n').take_while(|line| line.starts_with(b"H "));
    let value =
        |line: &'a [u8]| std::str::from_utf8(line).ok()?.strip_prefix("H ")?.strip_prefix(name)?.strip_prefix(':');
    lines.filter_map(value).next().map(str::trim)
}

/// deg/s in a count of the gyroscope: `gyro_scale` is the bits of a float, and a log of high resolution has tenths of it.
fn rate_scale(log: &[u8]) -> f64 {
    let bits = header(log, "gyro_scale").and_then(|text| u32::from_str_radix(text.trim_start_matches("0x"), 16).ok());
    let scale = bits.map_or(1.0, |bits| f64::from(f32::from_bits(bits)));
    if header(log, "blackbox_high_resolution") == Some("1") { scale / 10.0 } else { scale }
}

/// Part of the median by which the steps between neighbours differ at most.
const JITTER: f64 = 0.1;

/// The usual time between two frames, us: the mean of the steps near the median. `None` of fewer than two frames.
fn usual_step(headers: &Headers) -> Option<f64> {
    let mut frames = headers.data_parser();
    let (mut steps, mut last) = (Vec::new(), None);
    while let Some(event) = frames.next() {
        if let ParserEvent::Main(frame) = event {
            let time = frame.time_raw();
            steps.extend(last.filter(|last| *last < time).map(|last| (time - last) as f64));
            last = Some(time);
        }
    }
    let middle = steps.len() / 2;
    let median = (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)?;
    steps.retain(|step| (step / median - 1.0).abs() <= JITTER);
    Some(steps.iter().sum::<f64>() / steps.len() as f64)
}

/// g in a count of the accelerometer.
fn force_scale(log: &[u8]) -> f64 {
    let counts = header(log, "acc_1G").and_then(|text| text.parse::<f64>().ok()).filter(|counts| *counts > 0.0);
    counts.map_or(f64::NAN, f64::recip)
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
        let log = &self.bytes[self.ranges[topic].clone()];
        let headers = headers(log).map_err(fail)?;
        let fields: Vec<(&str, bool)> =
            headers.main_frame_def().iter().map(|FieldDef { name, signed, .. }| (name, signed)).collect();
        let (rate, force) = (rate_scale(log), force_scale(log));
        let scale = |&column: &usize| match fields.get(column) {
            Some((name, _)) if RATES.contains(name) => Some(rate),
            Some((name, _)) if FORCES.contains(name) => Some(force),
            _ => None,
        };
        let scales: Vec<Option<f64>> = columns.iter().map(scale).collect();
        // The clock of the samples is regular: a frame is at the nearest of its ticks, and later than the one before.
        let step = usual_step(&headers).unwrap_or(1.0);
        let (mut number, mut first) = (-1i64, None);
        let mut frames = headers.data_parser();
        let mut row = Vec::with_capacity(columns.len());
        while let Some(event) = frames.next() {
            let ParserEvent::Main(frame) = event else { continue };
            let time = frame.time_raw();
            let ticks = (time.saturating_sub(*first.get_or_insert(time)) as f64 / step).round() as i64;
            number = ticks.max(number.saturating_add(1));
            row.clear();
            for (&column, scale) in columns.iter().zip(&scales) {
                let field = match (fields.get(column), frame.get_raw(column)) {
                    (Some((_, true)), Some(raw)) => Number::Integer(i64::from(raw.cast_signed())),
                    (Some((_, false)), Some(raw)) => Number::Integer(i64::from(raw)),
                    _ if column == fields.len() + 1 => Number::Integer(number),
                    _ => i64::try_from(time).map_or(Number::Real(f64::NAN), Number::Integer),
                };
                row.push(scale.map_or(field, |scale| Number::Real(scale * field.value())));
            }
            each(&row)?;
        }
        Ok(Ending::default())
    }
}
