//! Units of counts and of sample numbers.

use adis16405_driver::{Channel, Config};

/// Configuration and sample rate of a stream of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReportScale {
    config: Config,
    rate_hz: f64,
}

impl ReportScale {
    /// The scale with the measured rate in Hz, or else the programmed one. Clocks are within 3 % (ADIS16400/ADIS16405
    /// data sheet Rev. B, Table 1).
    pub fn new(config: Config, measured_hz: Option<f64>) -> Self {
        Self { config, rate_hz: measured_hz.unwrap_or(config.sample_period().hz()) }
    }

    /// Samples per second.
    pub fn rate_hz(self) -> f64 {
        self.rate_hz
    }

    /// Time between two samples in s.
    pub fn period_s(self) -> f64 {
        1.0 / self.rate_hz
    }

    /// Size of one count of a channel in its unit.
    pub fn lsb(self, channel: Channel) -> f64 {
        channel.lsb(self.config.range())
    }
}
