//! How validated values are stored: as plain ones, and checked again when they are loaded.

use crate::clock::SamplePeriod;
use crate::config::{ConfigError, GyroRange};
use crate::pin::DacLevel;

#[derive(serde::Serialize, serde::Deserialize)]
#[serde(rename = "Config")]
pub(crate) struct Config {
    range: GyroRange,
    filter_taps_log2: u8,
    sample_period: SamplePeriod,
    external_clock: bool,
}

impl From<crate::Config> for Config {
    fn from(config: crate::Config) -> Self {
        Self {
            range: config.range(),
            filter_taps_log2: config.filter_taps_log2(),
            sample_period: config.sample_period(),
            external_clock: config.smpl_prd() == 0,
        }
    }
}

impl TryFrom<Config> for crate::Config {
    type Error = ConfigError;

    fn try_from(stored: Config) -> Result<Self, ConfigError> {
        let config = Self::new(stored.range, stored.filter_taps_log2, stored.sample_period)?;
        Ok(if stored.external_clock { config.with_external_clock() } else { config })
    }
}

impl From<SamplePeriod> for u8 {
    fn from(period: SamplePeriod) -> Self {
        period.register()
    }
}

impl TryFrom<u8> for SamplePeriod {
    type Error = &'static str;

    fn try_from(smpl_prd: u8) -> Result<Self, Self::Error> {
        Self::from_register(smpl_prd).ok_or("SMPL_PRD 0 is the external clock, not a period")
    }
}

impl From<DacLevel> for u16 {
    fn from(level: DacLevel) -> Self {
        level.counts()
    }
}

impl TryFrom<u16> for DacLevel {
    type Error = &'static str;

    fn try_from(counts: u16) -> Result<Self, Self::Error> {
        Self::from_counts(counts).ok_or("AUX_DAC has 12 bits")
    }
}
