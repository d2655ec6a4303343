//! Recordings of any inertial sensor, in files of any known format.

use crate::columns::column_selection::{AvailableColumn, ChosenColumn, ColumnSelection, SelectionError};
use crate::tables::sensor_measurement;
use crate::tables::sensor_table::SensorTable;
use crate::tables::sensor_table_writer;
use crate::time_base::{EstimatedTimeBase, TimeBaseError, TimeRange};
use measurement::SensorProfile;
use std::io;
use std::path::Path;

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
    pub(crate) fn choose(&self, available: &[AvailableColumn]) -> Result<Vec<ChosenColumn>, SelectionError> {
        self.selection.choose(available, &self.sensor)
    }
}

/// The rows of a recording and their sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorRecording {
    table: SensorTable,
    sensor: SensorProfile,
}

impl SensorRecording {
    pub(crate) fn new(table: SensorTable, sensor: &SensorProfile) -> Self {
        Self { table, sensor: sensor.clone() }
    }

    /// The usable samples on their time base; and what the user should know, one sentence each.
    ///
    /// `stated_hz` overrides the rate that the time stamps show. Values become counts of the file's own step where they are
    /// multiples of one, else of a step that adds at most 1e-4 to the variance of the noise.
    ///
    /// # Errors
    /// There is no usable rate or the stated one contradicts the stamps, there are fewer than 4 usable samples, no two of them
    /// are neighbours, or the gaps are more than 64 times as long as the samples.
    pub fn time_base(self, stated_hz: Option<f64>) -> Result<(EstimatedTimeBase, Vec<String>), TimeBaseError> {
        sensor_measurement::time_base(self.table, &self.sensor, stated_hz)
    }

    /// The rows in a range, by their time stamps; without, by their number and the rate that is stated.
    ///
    /// # Errors
    /// There is neither a time nor a rate, or no row in the range.
    pub fn within(self, range: TimeRange, stated_hz: Option<f64>) -> Result<Self, TimeBaseError> {
        let Self { mut table, sensor } = self;
        let rows = table.columns.first().map_or(0, |column| column.values.len());
        let stated_hz = stated_hz.or(table.rate_hz);
        let kept = range.kept(rows, table.times_s.as_deref(), table.indices.as_deref(), stated_hz)?;
        table.retain(&kept);
        // How often the time went back is not known of a part.
        table.dropped.clear();
        Ok(Self { table, sensor })
    }

    /// What the user should know of the rows, one sentence each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.table.notes
    }

    /// Writes the rows as CSV, gzip if the name of `file` ends in `.gz`: `sample` and `time_s`, where the recording has them, and
    /// the channels with their units in the header, as in `gyro_x [deg/s]`.
    ///
    /// # Errors
    /// The file cannot be created or written.
    pub fn write_table(&self, file: &Path) -> io::Result<()> {
        sensor_table_writer::write_table(&self.table, file)
    }

    /// Writes the rows as a NumPy array of doubles in SI units, the time in s first, if there is one. Returns the names of the
    /// columns.
    ///
    /// # Errors
    /// The file cannot be created or written.
    pub fn write_array(&self, file: &Path) -> io::Result<Vec<String>> {
        sensor_table_writer::write_array(&self.table, file)
    }
}
