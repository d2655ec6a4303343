//! Tables from logs of messages: the choice of a topic, and rows from messages of a gyroscope, an accelerometer or both.

use crate::columns::column_selection::AvailableColumn;
use crate::input::input_error::{InputError, Reason};
use crate::tables::any_sensor::ReadOptions;
use crate::tables::sensor_table::{Number, SensorTable, TableBuilder};
use std::path::Path;

/// Fields of a message, each with its unit.
pub(crate) type Fields = &'static [(&'static str, &'static str)];
/// Of a gyroscope, as ROS, PX4 and ArduPilot have them.
pub(crate) const GYROSCOPE: Fields = &[("gyro_x", "rad/s"), ("gyro_y", "rad/s"), ("gyro_z", "rad/s")];
/// Of an accelerometer, as ROS, PX4 and ArduPilot have them.
pub(crate) const ACCELEROMETER: Fields = &[("accl_x", "m/s^2"), ("accl_y", "m/s^2"), ("accl_z", "m/s^2")];

/// The topic to read of `topics`, each with its number of messages where that is known: the one that the user names, else
/// the only one.
pub(crate) fn choose_topic<'a, T>(
    format: &'static str,
    topics: &'a [(String, T)],
    wanted: Option<&str>,
) -> Result<&'a (String, T), Reason> {
    let names = || topics.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
    match (wanted, topics) {
        (_, []) => Err(Reason::NoTopic { format }),
        (Some(wanted), topics) => topics
            .iter()
            .find(|(name, _)| name == wanted)
            .ok_or_else(|| Reason::UnknownTopic(Box::new((wanted.to_owned(), names())))),
        (None, [only]) => Ok(only),
        (None, _) => Err(Reason::SeveralTopics(names())),
    }
}

/// Builds the table of one topic.
pub(crate) struct MessageTable<'a> {
    file: &'a Path,
    builder: TableBuilder,
    row: Vec<Number>,
    rows: u64,
}

impl<'a> MessageTable<'a> {
    /// Of messages that have a time, in `time_unit`, and then these fields.
    pub(crate) fn new(
        file: &'a Path,
        time_unit: &str,
        fields: &[Fields],
        options: &ReadOptions,
    ) -> Result<Self, InputError> {
        let fields = std::iter::once(("time", time_unit)).chain(fields.iter().copied().flatten().copied());
        let available: Vec<AvailableColumn> = fields.map(|(name, unit)| AvailableColumn::known(name, unit)).collect();
        let chosen =
            options.choose(&available).map_err(|error| InputError::file(file, Reason::Selection(Box::new(error))))?;
        Ok(Self { file, row: Vec::with_capacity(chosen.len()), builder: TableBuilder::new(chosen), rows: 0 })
    }

    /// Adds a message: a number for each field.
    pub(crate) fn push(&mut self, fields: &[Number]) -> Result<(), InputError> {
        self.rows += 1;
        self.row.clear();
        let number = |position: usize| fields.get(position).copied().unwrap_or(Number::Real(f64::NAN));
        self.row.extend(self.builder.chosen().iter().map(|column| number(column.position)));
        self.builder.push(&self.row).map_err(|(at, reason)| {
            let label = self.builder.chosen().get(at).map_or("", |column| column.label.as_str());
            InputError::row(self.file, self.rows, label, reason)
        })
    }

    /// The table of all messages. `damage` says why there are no more, where the file ends early: what came before is used.
    pub(crate) fn finish(self, damage: Option<Reason>) -> Result<SensorTable, InputError> {
        let fail = |reason| InputError::file(self.file, reason);
        match damage {
            Some(reason) if self.rows == 0 => Err(fail(reason)),
            damage => {
                let mut table = self.builder.finish().map_err(fail)?;
                let note = |reason| format!("{reason}; the {} messages before that are used", self.rows);
                table.notes.extend(damage.map(note));
                Ok(table)
            }
        }
    }
}
