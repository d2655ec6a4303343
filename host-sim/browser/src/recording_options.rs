//! The options of the command `imunoise` for reading a recording, as the page sends them.

use adis16405_driver::GyroRange;
use anyhow::{Context, Result, bail};
use measurement::{SensorProfile, profile_file};
use recordings::Printable;
use recordings::time_base::TimeRange;
use reports::reading::ReadingOptions;
use serde::Deserialize;

/// The options; those not given are absent.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
pub(crate) struct RecordingOptions {
    pub(crate) topic: Option<String>,
    /// Assignments such as `gyro_x=wx`.
    pub(crate) columns: Vec<String>,
    pub(crate) units: Vec<String>,
    /// Sample rate, Hz.
    pub(crate) rate: Option<f64>,
    /// Name of an included profile.
    pub(crate) sensor: Option<String>,
    /// Full scale of the gyros of an ADIS16405, °/s; absent for 300.
    pub(crate) range: Option<u32>,
    /// Start of the part that is read, s from the first sample.
    pub(crate) from: Option<f64>,
    /// End of the part that is read, s from the first sample.
    pub(crate) to: Option<f64>,
}

impl RecordingOptions {
    /// The options as words of a command line.
    pub(crate) fn words(&self) -> Vec<String> {
        let Self { topic, columns, units, rate, sensor, range, from, to } = self;
        let (topic, sensor) = (topic.as_deref(), sensor.as_deref());
        ReadingOptions { topic, columns, units, rate: *rate, sensor, range: *range, from_s: *from, to_s: *to }.words()
    }

    /// The part of the recording that is read; `None` for all of it.
    pub(crate) fn time_range(&self) -> Option<TimeRange> {
        TimeRange::between(self.from, self.to)
    }

    /// The range of the gyros of an ADIS16405.
    ///
    /// # Errors
    /// An ADIS16405 does not have this range.
    pub(crate) fn gyro_range(&self) -> Result<GyroRange> {
        Ok(match self.range {
            None | Some(300) => GyroRange::Dps300,
            Some(150) => GyroRange::Dps150,
            Some(75) => GyroRange::Dps75,
            Some(other) => bail!("range {other} °/s: none of 300, 150 and 75"),
        })
    }

    /// The profile of the sensor if one is named.
    ///
    /// # Errors
    /// There is no such profile.
    pub(crate) fn profile(&self) -> Result<Option<SensorProfile>> {
        let Some(sensor) = &self.sensor else { return Ok(None) };
        let profile = profile_file::by_name(sensor, self.gyro_range()?.lsb());
        Ok(Some(profile.with_context(|| format!("sensor {}: not known", Printable(sensor)))?))
    }
}
