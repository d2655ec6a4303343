//! Options for reading a recording of any inertial sensor.

use crate::columns::column_selection::{AvailableColumn, ChosenColumn, ColumnSelection, SelectionError};
use measurement::SensorProfile;

/// The recording as the user states it.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOptions {
    pub sensor: SensorProfile,
    /// Columns and units.
    pub selection: ColumnSelection,
    pub topic: Option<String>,
}

impl ReadOptions {
    /// Defaults for `sensor`.
    #[must_use]
    pub fn of_sensor(sensor: SensorProfile) -> Self {
        Self { sensor, selection: ColumnSelection::default(), topic: None }
    }

    pub(crate) fn choose(&self, available: &[AvailableColumn]) -> Result<Vec<ChosenColumn>, SelectionError> {
        self.selection.choose(available, &self.sensor)
    }
}
