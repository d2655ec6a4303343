//! How a recording of any inertial sensor is read.

use crate::columns::column_selection::{AvailableColumn, ChosenColumn, ColumnSelection, SelectionError};
use measurement::SensorProfile;

/// The user's statements about a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOptions {
    /// The sensor that was recorded.
    pub sensor: SensorProfile,
    /// Which columns are read, and in which units they are.
    pub selection: ColumnSelection,
    /// Topic, message or array of a file with several.
    pub topic: Option<String>,
}

impl ReadOptions {
    /// Options for a recording of `sensor` without further statements.
    #[must_use]
    pub fn of_sensor(sensor: SensorProfile) -> Self {
        Self { sensor, selection: ColumnSelection::default(), topic: None }
    }

    pub(crate) fn choose(&self, available: &[AvailableColumn]) -> Result<Vec<ChosenColumn>, SelectionError> {
        self.selection.choose(available, &self.sensor)
    }
}
