//! Time: the sample period, the SPI clock limits that follow from it, and the times that the driver keeps.

use core::fmt;

use crate::channel::GyroRange;
use crate::spacing::SelectDuringStall;

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

/// The power mode of the part, which sets the limits of SPI clock and stall.
///
/// Normal mode ends at SMPL_PRD = 0x09 by Tables 1 and 2 of the data sheet (Rev. B), at 0x08 by Table 7. The driver
/// takes the safe side unless [`Timing::normal_mode_max_smpl_prd`] is set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ClockMode {
    /// SMPL_PRD ≤ 0x08: SCK up to 2 MHz (1 MHz in a burst), stall at least 9 µs, a frame every 40 µs at most (Table 2).
    Normal,
    /// SMPL_PRD > 0x08: SCK up to 300 kHz, stall at least 75 µs, a frame every 150 µs at most (Table 2).
    LowPower,
}

impl ClockMode {
    /// Maximum SCK for single frames, Hz.
    pub const fn max_sck_hz(self) -> u32 {
        match self {
            ClockMode::Normal => 2_000_000,
            ClockMode::LowPower => 300_000,
        }
    }

    /// Maximum SCK for a burst read, Hz.
    pub const fn max_burst_sck_hz(self) -> u32 {
        match self {
            ClockMode::Normal => 1_000_000,
            ClockMode::LowPower => 300_000,
        }
    }
}

/// Units of 1/1638.4 s in 1000 s.
const TICKS_PER_1000_S: u32 = 1_638_400;

/// Period of the internal sample clock: time base · divisor.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "u8", into = "u8"))]
pub struct SamplePeriod {
    smpl_prd: u8,
}

impl SamplePeriod {
    /// The period after a reset, SMPL_PRD = 0x0001: 819.2 samples per second.
    pub const RESET: Self = Self { smpl_prd: 0x01 };

    /// A period of `divisor` (NS + 1 in the data sheet) time bases.
    ///
    /// # Errors
    /// [`ConfigError::Divisor`] outside 2…128 (fast; 1 is the external clock) or 1…128 (slow).
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

    /// The period with the rate nearest to `hz`, samples per second, within 0.4129…819.2; [`hz`](Self::hz) returns it.
    ///
    /// # Errors
    /// [`ConfigError::Rate`] if `hz` is not finite and positive.
    pub fn nearest(hz: f64) -> Result<Self, ConfigError> {
        if !(hz.is_finite() && hz > 0.0) {
            return Err(ConfigError::Rate);
        }
        Ok(Self::least(|period| (period.hz() - hz).abs()))
    }

    /// [`nearest`](Self::nearest) in `f32`, for single-precision FPUs.
    ///
    /// # Errors
    /// [`ConfigError::Rate`] if `hz` is not finite and positive.
    pub fn nearest_f32(hz: f32) -> Result<Self, ConfigError> {
        if !(hz.is_finite() && hz > 0.0) {
            return Err(ConfigError::Rate);
        }
        Ok(Self::least(|period| (period.hz_f32() - hz).abs()))
    }

    /// The period with the least `error`, the shortest if several have it.
    fn least<T: PartialOrd>(error: impl Fn(Self) -> T) -> Self {
        let periods = (0x02..=0xFF).map(|smpl_prd| Self { smpl_prd });
        periods.fold(Self::RESET, |best, period| if error(period) < error(best) { period } else { best })
    }

    /// [`nearest`](Self::nearest) for 10⁻³ samples per second in exact integers, for constants and targets without an
    /// FPU.
    ///
    /// # Errors
    /// [`ConfigError::Rate`] if `millihz` is 0.
    pub const fn nearest_millihz(millihz: u32) -> Result<Self, ConfigError> {
        if millihz == 0 {
            return Err(ConfigError::Rate);
        }
        // The fastest rate is the nearest to any higher one. This limit keeps rate · ticks below 2³².
        let millihz = if millihz > 819_200 { 819_200 } else { millihz };
        let mut best = Self::RESET;
        let mut smpl_prd = 0x01;
        loop {
            let candidate = Self { smpl_prd };
            // |rate of the candidate − millihz| · ticks of both
            let (of_candidate, of_best) = (candidate.ticks(), best.ticks());
            let candidate_off = TICKS_PER_1000_S.abs_diff(millihz * of_candidate) as u64 * of_best as u64;
            let best_off = TICKS_PER_1000_S.abs_diff(millihz * of_best) as u64 * of_candidate as u64;
            if candidate_off < best_off {
                best = candidate;
            }
            if smpl_prd == 0xFF {
                return Ok(best);
            }
            smpl_prd += 1;
        }
    }

    /// The period that a value of SMPL_PRD selects; `None` for 0x00, the external clock.
    pub const fn from_register(smpl_prd: u8) -> Option<Self> {
        if smpl_prd == 0 { None } else { Some(Self { smpl_prd }) }
    }

    /// The value of SMPL_PRD.
    pub const fn register(self) -> u8 {
        self.smpl_prd
    }

    /// Length in units of 1/1638.4 s, an exact integer.
    pub const fn ticks(self) -> u32 {
        let divisor = (self.smpl_prd & 0x7F) as u32 + 1;
        if self.smpl_prd & 0x80 == 0 { divisor } else { 31 * divisor }
    }

    /// Sample rate in samples per second.
    pub const fn hz(self) -> f64 {
        1638.4 / self.ticks() as f64
    }

    /// Sample rate in samples per second.
    pub const fn hz_f32(self) -> f32 {
        1638.4 / self.ticks() as f32
    }

    /// Sample rate in 10⁻³ samples per second, rounded to the nearest integer.
    pub const fn millihz(self) -> u32 {
        (TICKS_PER_1000_S + self.ticks() / 2) / self.ticks()
    }

    /// The power mode that this period selects by the data sheet.
    pub const fn clock_mode(self) -> ClockMode {
        if self.smpl_prd <= 0x08 { ClockMode::Normal } else { ClockMode::LowPower }
    }
}

impl fmt::Debug for SamplePeriod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SamplePeriod({:#04x}: {} mHz)", self.smpl_prd, self.millihz())
    }
}

impl Default for SamplePeriod {
    fn default() -> Self {
        Self::RESET
    }
}

#[cfg(feature = "serde")]
impl From<SamplePeriod> for u8 {
    fn from(period: SamplePeriod) -> Self {
        period.register()
    }
}

#[cfg(feature = "serde")]
impl TryFrom<u8> for SamplePeriod {
    type Error = &'static str;

    fn try_from(smpl_prd: u8) -> Result<Self, Self::Error> {
        Self::from_register(smpl_prd).ok_or("SMPL_PRD 0 is the external clock, not a period")
    }
}

/// The source of the sample clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SampleClock {
    /// The internal clock.
    Internal(SamplePeriod),
    /// A clock at DIO4/CLKIN, with SMPL_PRD = 0: pulses of at least 5 µs, at most 1.2 kHz; data ready 600 µs later
    /// (data sheet Rev. B, Table 2, Figure 4, page 14).
    External,
}

/// The reason for which a sample period or a [`Config`](crate::Config) was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ConfigError {
    /// The sample rate is not finite and positive.
    Rate,
    /// The divisor is outside the limits of the time base.
    Divisor {
        /// The requested time base.
        base: TimeBase,
        /// The requested divisor.
        divisor: u8,
    },
    /// The number of filter taps, 2^M, is above 2⁶ or below the minimum of the range.
    FilterTaps {
        /// The requested range.
        range: GyroRange,
        /// The requested M.
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

/// A time that depends on the power mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PerClockMode {
    /// The time in [`ClockMode::Normal`].
    pub normal: u32,
    /// The time in [`ClockMode::LowPower`].
    pub low_power: u32,
}

impl PerClockMode {
    /// The time in the given mode.
    pub const fn get(self, mode: ClockMode) -> u32 {
        match mode {
            ClockMode::Normal => self.normal,
            ClockMode::LowPower => self.low_power,
        }
    }
}

/// The times that the driver keeps, by the data sheet Rev. B; [`Timing::DEFAULT`] takes the safe side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Timing {
    /// Least stall after a frame or burst, ns: 9 µs in normal, 75 µs in low-power mode (Table 2); Analog Devices' tool
    /// keeps 16 µs. Longer after single frames by [`read_rate_ns`](Self::read_rate_ns).
    pub stall_ns: PerClockMode,
    /// Least time between falling edges of chip select, ns: 40 µs, or 150 µs in low-power mode (Table 2, Figure 3),
    /// kept by [`frame_stall_ns`](Self::frame_stall_ns).
    pub read_rate_ns: PerClockMode,
    /// SCK of single frames, Hz, for the stall after them; `None` is the mode's fastest ([`ClockMode::max_sck_hz`]),
    /// with the longest stall.
    pub sck_hz: Option<u32>,
    /// Level of chip select during the stall.
    pub stall_select: SelectDuringStall,
    /// Least time of chip select high, ns; the ADIS16470 needs 1 µs.
    pub select_high_ns: u32,
    /// Pause between the words of a burst, ns. The data sheet asks for one SCK period (Table 2, page 10); the default
    /// is 0, as in Linux and PX4: one transfer instead of 13.
    pub word_gap_ns: u32,
    /// Largest SMPL_PRD value in normal mode: 0x08 by Table 7, 0x09 by Tables 1 and 2 and by page 13.
    pub normal_mode_max_smpl_prd: u8,
    /// Time from power-on to the first answer, µs: 220 ms, or 290 ms in low-power mode (Table 1), the default.
    pub start_up_us: u32,
    /// Time from a reset to the first answer, µs: 100 ms, or 170 ms in low-power mode (Table 1), the default.
    pub reset_us: u32,
    /// Length of the low pulse on the reset line, µs. The data sheet gives none; 10 µs are usual in the family.
    pub reset_pulse_us: u32,
    /// Chip-select pulse that wakes the part, ns: at least 20 µs (Table 1), and 5 µs for the microcontroller's clock.
    pub wake_pulse_ns: u32,
    /// Time from wake-up until the part answers, µs: 4 ms, or 15 ms in low-power mode (Table 1).
    pub wake_us: PerClockMode,
    /// Duration of a flash memory test, µs: 17 ms, or 90 ms in low-power mode (Table 1).
    pub flash_test_us: PerClockMode,
    /// Duration of the internal self-test at 819.2 samples per second, µs: 12 ms (Table 1).
    pub self_test_us: u32,
    /// Silence after a flash update, µs: twice the 50 ms of page 10, since a part addressed too soon may lose it.
    pub flash_update_us: u32,
    /// Silence after a factory restore, µs: twice the 50 ms of page 13.
    pub factory_restore_us: u32,
    /// Silence after an auto-null, µs: twice the 50 ms of its flash update (page 13).
    pub auto_null_us: u32,
    /// Silence after a precision auto-null, µs: 30 s offline, 50 ms of flash update (page 13), and 3 % for the clock
    /// (Table 1).
    pub precision_auto_null_us: u32,
    /// Interval at which a self-clearing bit is polled, µs.
    pub poll_us: u32,
}

impl Timing {
    /// The times of a new driver.
    pub const DEFAULT: Self = Self {
        stall_ns: PerClockMode { normal: 16_000, low_power: 75_000 },
        read_rate_ns: PerClockMode { normal: 40_000, low_power: 150_000 },
        sck_hz: None,
        stall_select: SelectDuringStall::High,
        select_high_ns: 1_000,
        word_gap_ns: 0,
        normal_mode_max_smpl_prd: 0x08,
        start_up_us: 290_000,
        reset_us: 170_000,
        reset_pulse_us: 100,
        wake_pulse_ns: 25_000,
        wake_us: PerClockMode { normal: 4_000, low_power: 15_000 },
        flash_test_us: PerClockMode { normal: 17_000, low_power: 90_000 },
        self_test_us: 12_000,
        flash_update_us: 100_000,
        factory_restore_us: 100_000,
        auto_null_us: 100_000,
        precision_auto_null_us: 31_000_000,
        poll_us: 1_000,
    };

    /// The power mode that a value of SMPL_PRD selects.
    pub const fn clock_mode(&self, smpl_prd: u8) -> ClockMode {
        if smpl_prd <= self.normal_mode_max_smpl_prd { ClockMode::Normal } else { ClockMode::LowPower }
    }

    /// Stall after a single frame, ns: the rest of [`read_rate_ns`](Self::read_rate_ns) after 16 periods of
    /// [`sck_hz`](Self::sck_hz), at least [`stall_ns`](Self::stall_ns). By default 32 µs, or 96.8 µs in low-power mode;
    /// 24 µs at 1 MHz.
    pub const fn frame_stall_ns(&self, mode: ClockMode) -> u32 {
        let sck_hz = match self.sck_hz {
            Some(hz) => hz,
            None => mode.max_sck_hz(),
        };
        // The clock is rounded up to whole kHz, so that the stall is not too short.
        let sck_khz = if sck_hz > 1_000 { sck_hz.div_ceil(1_000) } else { 1 };
        let stall_ns = self.read_rate_ns.get(mode).saturating_sub(16_000_000 / sck_khz);
        let least_ns = self.stall_ns.get(mode);
        if stall_ns > least_ns { stall_ns } else { least_ns }
    }
}

impl Default for Timing {
    fn default() -> Self {
        Self::DEFAULT
    }
}
