//! Gyro range, filter and sample clock; only accepted values can be constructed.

use crate::channel::GyroRange;
use crate::clock::{ConfigError, SampleClock, SamplePeriod};

/// An accepted combination; the default is that after reset: ±300 °/s, M = 2 (four samples an average), 819.2 samples
/// per second.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "SerializedConfig", into = "SerializedConfig"))]
pub struct Config {
    range: GyroRange,
    filter_taps_log2: u8,
    sample_period: SamplePeriod,
    external_clock: bool,
}

impl Config {
    /// `filter_taps_log2` is M in SENS_AVG bits 2:0, 0 to 6: two cascaded averages of 2^M samples.
    ///
    /// # Errors
    /// [`ConfigError::FilterTaps`] if M is above 6 or below the minimum of `range`.
    pub const fn new(range: GyroRange, filter_taps_log2: u8, sample_period: SamplePeriod) -> Result<Self, ConfigError> {
        if filter_taps_log2 > 6 || filter_taps_log2 < range.min_filter_taps_log2() {
            return Err(ConfigError::FilterTaps { range, filter_taps_log2 });
        }
        Ok(Self { range, filter_taps_log2, sample_period, external_clock: false })
    }

    /// Returns this configuration with another range.
    ///
    /// # Errors
    /// [`ConfigError::FilterTaps`] if the range needs more filter taps than are set.
    pub const fn with_range(mut self, range: GyroRange) -> Result<Self, ConfigError> {
        self.range = range;
        self.checked()
    }

    /// Returns this configuration with another filter.
    ///
    /// # Errors
    /// [`ConfigError::FilterTaps`] if M is above 6 or below the minimum of the range.
    pub const fn with_filter_taps_log2(mut self, filter_taps_log2: u8) -> Result<Self, ConfigError> {
        self.filter_taps_log2 = filter_taps_log2;
        self.checked()
    }

    /// Returns this configuration with the internal clock and another sample period.
    #[must_use]
    pub const fn with_sample_period(mut self, sample_period: SamplePeriod) -> Self {
        self.sample_period = sample_period;
        self.external_clock = false;
        self
    }

    /// Returns this configuration with [`SampleClock::External`]. The part takes no samples without a clock at its pin.
    #[must_use]
    pub const fn with_external_clock(mut self) -> Self {
        self.external_clock = true;
        self
    }

    const fn checked(self) -> Result<Self, ConfigError> {
        match Self::new(self.range, self.filter_taps_log2, self.sample_period) {
            Ok(_) => Ok(self),
            Err(error) => Err(error),
        }
    }

    /// Gyro range.
    pub const fn range(self) -> GyroRange {
        self.range
    }

    /// M: each filter stage averages 2^M samples.
    pub const fn filter_taps_log2(self) -> u8 {
        self.filter_taps_log2
    }

    /// The filter.
    pub const fn filter(self) -> BartlettFilter {
        BartlettFilter::new(self.filter_taps_log2)
    }

    /// Period of the internal clock, kept while an external one is selected.
    pub const fn sample_period(self) -> SamplePeriod {
        self.sample_period
    }

    /// The source of the sample clock.
    pub const fn sample_clock(self) -> SampleClock {
        if self.external_clock { SampleClock::External } else { SampleClock::Internal(self.sample_period) }
    }

    /// The value of SMPL_PRD.
    pub const fn smpl_prd(self) -> u8 {
        match self.sample_clock() {
            SampleClock::Internal(period) => period.register(),
            SampleClock::External => 0,
        }
    }

    /// The value of SENS_AVG.
    pub const fn sens_avg(self) -> u16 {
        self.range.sens_avg_code() << 8 | self.filter_taps_log2 as u16
    }
}

impl Default for Config {
    fn default() -> Self {
        Self {
            range: GyroRange::Dps300,
            filter_taps_log2: 2,
            sample_period: SamplePeriod::RESET,
            external_clock: false,
        }
    }
}

/// The serialised form of a [`Config`]; [`Config::new`] checks it when it is deserialised.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(rename = "Config")]
struct SerializedConfig {
    range: GyroRange,
    filter_taps_log2: u8,
    sample_period: SamplePeriod,
    external_clock: bool,
}

#[cfg(feature = "serde")]
impl From<Config> for SerializedConfig {
    fn from(config: Config) -> Self {
        Self {
            range: config.range(),
            filter_taps_log2: config.filter_taps_log2(),
            sample_period: config.sample_period(),
            external_clock: config.smpl_prd() == 0,
        }
    }
}

#[cfg(feature = "serde")]
impl TryFrom<SerializedConfig> for Config {
    type Error = ConfigError;

    fn try_from(stored: SerializedConfig) -> Result<Self, ConfigError> {
        let config = Self::new(stored.range, stored.filter_taps_log2, stored.sample_period)?;
        Ok(if stored.external_clock { config.with_external_clock() } else { config })
    }
}

/// The digital filter of gyroscopes, accelerometers and magnetometers: a Bartlett window of 2N + 1 taps (two averages
/// of N = 2^M samples) with a phase of N samples (data sheet Rev. B, Figure 15). Its amplitude response at f/fs cycles
/// per sample is |sin(πNf/fs) / (N·sin(πf/fs))|²; the analog poles before it are not included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BartlettFilter {
    taps_log2: u8,
}

impl BartlettFilter {
    /// `taps_log2` is M, 0 (no filter) to 6; larger values are taken as 6.
    pub const fn new(taps_log2: u8) -> Self {
        Self { taps_log2: if taps_log2 > 6 { 6 } else { taps_log2 } }
    }

    /// N, the number of samples that each stage averages.
    pub const fn taps(self) -> u32 {
        1 << self.taps_log2
    }

    /// Number of taps, 2N + 1. The first and the last are 0, so that an output depends on 2N − 1 samples.
    pub const fn length(self) -> u32 {
        2 * self.taps() + 1
    }

    /// Group delay in samples, N, at every frequency.
    pub const fn group_delay(self) -> u32 {
        self.taps()
    }
}
