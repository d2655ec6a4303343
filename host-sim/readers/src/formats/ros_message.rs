//! Rows of ROS messages: inertial columns and times.

use crate::columns::{ACCELEROMETER, AvailableColumn, GYROSCOPE, ReadingNote};
use crate::formats::message_layout::{Encoding, MessageColumn, MessageLayout};
use crate::formats::topics::Topic;
use crate::rows::{Number, TopicSensor};

/// Fields of `sensor_msgs/Imu` in any message, with channels and units (REP 103).
const VECTORS: [(&str, [&str; 3], &str); 2] =
    [("angular_velocity", GYROSCOPE, "rad/s"), ("linear_acceleration", ACCELEROMETER, "m/s^2")];
/// -1 if not measured (`sensor_msgs/Imu`).
const COVARIANCE: &str = "_covariance[0]";
const NOT_MEASURED: f64 = -1.0;
const RECORD_TIME: &str = "record_time";

pub(crate) fn topic(name: &str, kind: &str, layout: &MessageLayout, rows: Option<u64>) -> Topic {
    let columns = layout.columns();
    let available = |column: &MessageColumn| {
        if column.is_time {
            AvailableColumn::known(&column.name, "ns")
        } else {
            AvailableColumn { name: column.name.clone(), unit: None }
        }
    };
    Topic {
        name: name.to_owned(),
        kind: kind.to_owned(),
        rows,
        columns: columns.iter().map(available).chain([AvailableColumn::known(RECORD_TIME, "ns")]).collect(),
        sensors: sensors(kind, columns),
        ..Topic::default()
    }
}

fn sensors(kind: &str, columns: &[MessageColumn]) -> Vec<TopicSensor> {
    let at = |name: &str| columns.iter().position(|column| column.name == name);
    let axes = |path: &str| -> Option<[usize; 3]> {
        let fields = ["x", "y", "z"].map(|axis| at(&format!("{path}.{axis}")));
        let elements = [0, 1, 2].map(|axis| at(&format!("{path}[{axis}]")));
        let found = [fields, elements].into_iter().find_map(|[x, y, z]| Some([x?, y?, z?]))?;
        found.iter().all(|&at| columns[at].is_float).then_some(found)
    };
    let mut prefixes: Vec<&str> = Vec::new();
    for column in columns {
        for (name, ..) in VECTORS {
            let end = column.name.find(name).filter(|&end| end == 0 || column.name[..end].ends_with('.'));
            if let Some(prefix) = end.map(|end| &column.name[..end]).filter(|prefix| !prefixes.contains(prefix))
                && axes(&format!("{prefix}{name}")).is_some()
            {
                prefixes.push(prefix);
            }
        }
    }
    let is_single = prefixes.len() == 1;
    let sensor = |prefix: &&str| {
        let name = if is_single { "" } else { prefix.trim_end_matches('.') };
        let mut sensor = TopicSensor { name: name.to_owned(), ..TopicSensor::default() };
        sensor.columns.push(("time", time_column(columns, prefix), None));
        for (name, channels, unit) in VECTORS {
            if let Some(axes) = axes(&format!("{prefix}{name}")) {
                sensor.add_axes(channels, axes, unit);
            }
        }
        // Units of `sensor_msgs/Imu`; others follow by convention.
        let is_imu = VECTORS.iter().any(|(name, ..)| at(&format!("{prefix}{name}{COVARIANCE}")).is_some());
        if !is_imu {
            sensor.note = Some(format!(
                "angular_velocity and linear_acceleration of {kind} are taken to be in rad/s and m/s^2, as is usual in ROS (REP 103); \
                 --units says otherwise"
            ));
        }
        sensor
    };
    prefixes.iter().map(sensor).collect()
}

/// The innermost header's stamp around `prefix`, else one beside it, else the time of recording.
fn time_column(columns: &[MessageColumn], prefix: &str) -> usize {
    let of = |endings: &[&str]| {
        let mut scope = prefix;
        loop {
            let is_wanted = |column: &MessageColumn| {
                let own = column.name.strip_prefix(scope).map(str::to_lowercase);
                column.is_time && own.is_some_and(|own| endings.contains(&own.as_str()))
            };
            if let Some(at) = columns.iter().position(is_wanted) {
                return Some(at);
            }
            let outer = scope.strip_suffix('.')?;
            scope = &outer[..outer.rfind('.').map_or(0, |dot| dot + 1)];
        }
    };
    of(&["header.stamp"]).or_else(|| of(&["stamp", "time", "timestamp"])).unwrap_or(columns.len())
}

pub(crate) struct RosRows<'a> {
    layout: MessageLayout,
    encoding: Encoding,
    /// One beyond the last is the time of recording.
    columns: &'a [usize],
    /// Covariance that marks an absent quantity.
    guards: Vec<Option<usize>>,
    /// A zero first stamp is replaced by the time of recording.
    is_unset: Option<bool>,
    decoded: Vec<Number>,
    row: Vec<Number>,
}

impl<'a> RosRows<'a> {
    pub(crate) fn new(layout: &MessageLayout, encoding: Encoding, columns: &'a [usize]) -> Self {
        let known = layout.columns();
        let guard = |&column: &usize| {
            let name = &known.get(column)?.name;
            let path = name.rfind(['.', '[']).map(|end| &name[..end])?;
            let guard = format!("{path}{COVARIANCE}");
            known.iter().position(|column| column.name == guard)
        };
        let guards: Vec<Option<usize>> = columns.iter().map(guard).collect();
        let layout = layout.only(|column| columns.contains(&column) || guards.contains(&Some(column)));
        Self { layout, encoding, columns, guards, is_unset: None, decoded: Vec::new(), row: Vec::new() }
    }

    /// NaN for what is missing.
    pub(crate) fn row(&mut self, message: &[u8], record_ns: Option<i64>) -> &[Number] {
        let Self { layout, encoding, columns, guards, is_unset, decoded, row } = self;
        // Columns before damage are used; a missing time ends the reading.
        let _ = layout.decode(message, *encoding, decoded);
        let record = record_ns.map_or(Number::Real(f64::NAN), Number::Integer);
        row.clear();
        for (&column, guard) in columns.iter().zip(guards) {
            let is_measured = guard.is_none_or(|guard| decoded[guard].value() != NOT_MEASURED);
            let number = decoded.get(column).copied().unwrap_or(record);
            let is_stamp = layout.columns().get(column).is_some_and(|column| column.is_time);
            let unset = is_stamp && *is_unset.get_or_insert(number == Number::Integer(0));
            row.push(match (is_measured, unset) {
                (false, _) => Number::Real(f64::NAN),
                (true, true) => record,
                (true, false) => number,
            });
        }
        row
    }

    pub(crate) fn notes(&self) -> Vec<ReadingNote> {
        let unset = "the stamps of the messages are not set; the times at which they were recorded stand for them";
        self.is_unset.filter(|unset| *unset).map(|_| unset.to_owned().into()).into_iter().collect()
    }
}
