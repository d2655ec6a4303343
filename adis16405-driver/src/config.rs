//! What the part is told to do: gyro range, filter, sample clock. Values that it would not accept cannot be built.

use core::fmt;

use crate::clock::{SampleClock, SamplePeriod, TimeBase};
use crate::filter::Filter;

/// Full scale of the gyroscopes, SENS_AVG bits 10:8.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum GyroRange {
    /// ±300 °/s, 0.05 °/s per count.
    #[default]
    Dps300,
    /// ±150 °/s, 0.025 °/s per count; needs at least 2² filter taps.
    Dps150,
    /// ±75 °/s, 0.0125 °/s per count; needs at least 2⁴ filter taps.
    Dps75,
}

impl GyroRange {
    /// Size of one count in °/s.
    pub const fn lsb(self) -> f64 {
        match self {
            GyroRange::Dps300 => 0.05,
            GyroRange::Dps150 => 0.025,
            GyroRange::Dps75 => 0.0125,
        }
    }

    /// Size of one count in 10⁻⁶ °/s.
    pub const fn lsb_udps(self) -> i32 {
        match self {
            GyroRange::Dps300 => 50_000,
            GyroRange::Dps150 => 25_000,
            GyroRange::Dps75 => 12_500,
        }
    }

    /// The least number of filter taps (log2) with which the part accepts this range.
    pub const fn min_filter_taps_log2(self) -> u8 {
        match self {
            GyroRange::Dps300 => 0,
            GyroRange::Dps150 => 2,
            GyroRange::Dps75 => 4,
        }
    }

    /// The range that a value of SENS_AVG selects; `None` for codes that the data sheet does not define.
    pub const fn from_sens_avg(sens_avg: u16) -> Option<Self> {
        match sens_avg >> 8 & 0b111 {
            0b100 => Some(GyroRange::Dps300),
            0b010 => Some(GyroRange::Dps150),
            0b001 => Some(GyroRange::Dps75),
            _ => None,
        }
    }

    const fn field(self) -> u16 {
        match self {
            GyroRange::Dps300 => 0b100,
            GyroRange::Dps150 => 0b010,
            GyroRange::Dps75 => 0b001,
        }
    }
}

/// A configuration that the part accepts. The default is that of the part after reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "crate::stored::Config", into = "crate::stored::Config"))]
pub struct Config {
    range: GyroRange,
    filter_taps_log2: u8,
    sample_period: SamplePeriod,
    external_clock: bool,
}

impl Config {
    /// `filter_taps_log2` is M of SENS_AVG: two cascaded averages of 2^M samples each, none for M = 0.
    ///
    /// # Errors
    /// If M is above 6 or below what `range` needs.
    pub const fn new(range: GyroRange, filter_taps_log2: u8, sample_period: SamplePeriod) -> Result<Self, ConfigError> {
        if filter_taps_log2 > 6 || filter_taps_log2 < range.min_filter_taps_log2() {
            return Err(ConfigError::FilterTaps { range, filter_taps_log2 });
        }
        Ok(Self { range, filter_taps_log2, sample_period, external_clock: false })
    }

    /// The same with another range.
    ///
    /// # Errors
    /// If the range needs more filter taps than there are.
    pub const fn with_range(mut self, range: GyroRange) -> Result<Self, ConfigError> {
        self.range = range;
        self.checked()
    }

    /// The same with another filter.
    ///
    /// # Errors
    /// If M is above 6 or below what the range needs.
    pub const fn with_filter_taps_log2(mut self, filter_taps_log2: u8) -> Result<Self, ConfigError> {
        self.filter_taps_log2 = filter_taps_log2;
        self.checked()
    }

    /// The same with the internal clock and another sample period.
    #[must_use]
    pub const fn with_sample_period(mut self, sample_period: SamplePeriod) -> Self {
        self.sample_period = sample_period;
        self.external_clock = false;
        self
    }

    /// The same with [`SampleClock::External`]: without a clock at its pin the part takes no samples.
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

    /// What the filter does.
    pub const fn filter(self) -> Filter {
        Filter::new(self.filter_taps_log2)
    }

    /// Period of the internal clock, also while an external one is selected.
    pub const fn sample_period(self) -> SamplePeriod {
        self.sample_period
    }

    /// What makes the part take a sample.
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
        self.range.field() << 8 | self.filter_taps_log2 as u16
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

/// Why a configuration was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ConfigError {
    /// The sample rate is not finite and positive.
    Rate,
    /// The divisor does not fit the time base.
    Divisor {
        /// Time base asked for.
        base: TimeBase,
        /// Divisor asked for.
        divisor: u8,
    },
    /// The number of filter taps is above 2⁶ or too small for the range.
    FilterTaps {
        /// Range asked for.
        range: GyroRange,
        /// M asked for.
        filter_taps_log2: u8,
    },
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            ConfigError::Rate => write!(f, "the sample rate must be a finite number above 0"),
            ConfigError::Divisor { base: TimeBase::Fast, divisor } => {
                write!(f, "divisor {divisor} of the 0.61035 ms time base is outside 2 to 128")
            }
            ConfigError::Divisor { base: TimeBase::Slow, divisor } => {
                write!(f, "divisor {divisor} of the 18.921 ms time base is outside 1 to 128")
            }
            ConfigError::FilterTaps { range, filter_taps_log2 } => write!(
                f,
                "filter taps 2^{filter_taps_log2} are outside 2^{} to 2^6 for {range:?}",
                range.min_filter_taps_log2()
            ),
        }
    }
}

impl core::error::Error for ConfigError {}
