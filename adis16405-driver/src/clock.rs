//! When the part samples, and which SPI limits that brings.

use crate::config::ConfigError;

/// Time base of the sample period, SMPL_PRD bit 7.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum TimeBase {
    /// 0.61035 ms = 1/1638.4 s.
    Fast,
    /// 18.921 ms = 31/1638.4 s.
    Slow,
}

/// Which SPI clock and stall limits hold. The data sheet (Rev. B, page 10) sets the border at SMPL_PRD = 0x08; Linux
/// sets it at 0x0A. The stricter is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ClockMode {
    /// SMPL_PRD ≤ 0x08: SCK up to 2 MHz (1 MHz in a burst), stall at least 9 µs.
    Normal,
    /// SMPL_PRD > 0x08: SCK up to 300 kHz; a stall of 75 µs, which no source at hand confirms.
    LowPower,
}

impl ClockMode {
    /// Highest SCK for single frames, Hz.
    pub const fn max_sck_hz(self) -> u32 {
        match self {
            ClockMode::Normal => 2_000_000,
            ClockMode::LowPower => 300_000,
        }
    }

    /// Highest SCK for a burst read, Hz.
    pub const fn max_burst_sck_hz(self) -> u32 {
        match self {
            ClockMode::Normal => 1_000_000,
            ClockMode::LowPower => 300_000,
        }
    }
}

/// Internal sample period: `time base · divisor`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "u8", into = "u8"))]
pub struct SamplePeriod {
    smpl_prd: u8,
}

impl SamplePeriod {
    /// 819.2 samples per second, what the part does after reset (SMPL_PRD = 0x0001).
    pub const RESET: Self = Self { smpl_prd: 0x01 };

    /// `divisor` = NS + 1 time bases per sample.
    ///
    /// # Errors
    /// If `divisor` is outside 2…128 (fast; 1 would select the external clock) or 1…128 (slow).
    pub const fn from_divisor(base: TimeBase, divisor: u8) -> Result<Self, ConfigError> {
        let (least, flag) = match base {
            TimeBase::Fast => (2, 0x00),
            TimeBase::Slow => (1, 0x80),
        };
        if divisor < least || divisor > 128 {
            return Err(ConfigError::Divisor { base, divisor });
        }
        Ok(Self { smpl_prd: flag | (divisor - 1) })
    }

    /// The period whose rate is nearest to `hz`, clamped to 0.4129…819.2 samples per second; [`hz`](Self::hz) tells
    /// what became of it.
    ///
    /// # Errors
    /// If `hz` is not finite and positive.
    pub fn nearest(hz: f64) -> Result<Self, ConfigError> {
        if !(hz.is_finite() && hz > 0.0) {
            return Err(ConfigError::Rate);
        }
        let mut best = Self::RESET;
        for smpl_prd in 0x01..=0xFF {
            let candidate = Self { smpl_prd };
            if (candidate.hz() - hz).abs() < (best.hz() - hz).abs() {
                best = candidate;
            }
        }
        Ok(best)
    }

    /// From the value of SMPL_PRD; `None` for 0x00, which means an external clock.
    pub const fn from_register(smpl_prd: u8) -> Option<Self> {
        if smpl_prd == 0 { None } else { Some(Self { smpl_prd }) }
    }

    /// The value of SMPL_PRD.
    pub const fn register(self) -> u8 {
        self.smpl_prd
    }

    /// Length in ticks of 1/1638.4 s, an exact integer.
    pub const fn ticks(self) -> u32 {
        let divisor = (self.smpl_prd & 0x7F) as u32 + 1;
        if self.smpl_prd & 0x80 == 0 { divisor } else { 31 * divisor }
    }

    /// Samples per second.
    pub const fn hz(self) -> f64 {
        1638.4 / self.ticks() as f64
    }

    /// The SPI limits that this period brings.
    pub const fn clock_mode(self) -> ClockMode {
        if self.smpl_prd <= 0x08 { ClockMode::Normal } else { ClockMode::LowPower }
    }
}

/// What makes the part take a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SampleClock {
    /// Its own clock.
    Internal(SamplePeriod),
    /// A clock at pin DIO4/CLKIN, SMPL_PRD = 0. Known of sibling parts (up to 1.1 kHz); no source at hand confirms it
    /// for this one.
    External,
}

impl Default for SamplePeriod {
    fn default() -> Self {
        Self::RESET
    }
}
