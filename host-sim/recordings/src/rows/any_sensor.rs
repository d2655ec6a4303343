//! How a recording of any inertial sensor is read.

use crate::columns::column_selection::{AvailableColumn, ChosenColumn, ColumnSelection, SelectionError};
use adis16405_driver::GyroRange;
use measurement::{SensorProfile, adis16405};

/// What the user says of a recording.
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
    /// Of a table of register counts of an ADIS16405 whose rates were taken in `range`.
    pub(crate) fn of_counts(range: GyroRange) -> Self {
        let (selection, topic) = (ColumnSelection::default(), None);
        Self { sensor: adis16405::profile(range.lsb()), selection, topic }
    }

    pub(crate) fn choose(&self, available: &[AvailableColumn]) -> Result<Vec<ChosenColumn>, SelectionError> {
        self.selection.choose(available, &self.sensor)
    }
}
