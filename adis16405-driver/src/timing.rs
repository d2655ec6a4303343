//! How long the part needs for what. Sources disagree on some of these times, so all can be set.

use crate::clock::ClockMode;

/// A time that is longer in low-power mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ByMode {
    /// In [`ClockMode::Normal`].
    pub normal: u32,
    /// In [`ClockMode::LowPower`].
    pub low_power: u32,
}

impl ByMode {
    /// The value for a mode.
    pub const fn get(self, mode: ClockMode) -> u32 {
        match mode {
            ClockMode::Normal => self.normal,
            ClockMode::LowPower => self.low_power,
        }
    }
}

/// Times that the driver keeps. [`Timing::DEFAULT`] is on the safe side of every source.
///
/// Not confirmed by any source at hand, so check them against your data sheet: the low-power stall, the times of a flash
/// update, a factory restore and an auto-null, and where low-power mode begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Timing {
    /// Stall after a frame, ns. The part needs 9 µs in normal mode; Analog Devices' evaluation tool keeps 16 µs. The
    /// 75 µs of low-power mode are unconfirmed.
    pub stall_ns: ByMode,
    /// Pause between the words of a burst, ns. The data sheets of sibling parts ask for one SCK period; Linux, PX4 and
    /// satellites read the part without any, which is the default. With a pause a burst is 13 transfers instead of one.
    pub word_gap_ns: u32,
    /// Greatest SMPL_PRD in normal mode: 0x08 by the data sheet (Rev. B, page 10), 0x09 by Linux.
    pub normal_mode_max_smpl_prd: u8,
    /// From power-on until the part answers, µs: 220 ms, 290 ms in low-power mode. As flash decides which mode the part
    /// starts in, the longer one is kept.
    pub start_up_us: u32,
    /// From a software reset until the part answers, µs: 100 ms, 170 ms in low-power mode, the longer one is kept.
    pub reset_us: u32,
    /// Length of the chip-select pulse that wakes the part, ns; unconfirmed.
    pub wake_pulse_ns: u32,
    /// From waking up until the part answers, µs.
    pub wake_us: ByMode,
    /// Length of a flash memory test, µs.
    pub flash_test_us: ByMode,
    /// Length of the internal self-test at 819.2 samples per second, µs.
    pub self_test_us: u32,
    /// Silence after the command to update the flash, µs. Sources: 50 ms, "at least 100 ms".
    pub flash_update_us: u32,
    /// Silence after the command to restore the factory calibration, µs; unconfirmed.
    pub factory_restore_us: u32,
    /// Silence after the auto-null command, µs; unconfirmed.
    pub auto_null_us: u32,
    /// Silence after the precision auto-null command, µs: 30 s, "about 35 s" on an older part.
    pub precision_auto_null_us: u32,
    /// Pause between two looks at a bit that clears itself, µs.
    pub poll_us: u32,
}

impl Timing {
    /// The times that a new driver keeps.
    pub const DEFAULT: Self = Self {
        stall_ns: ByMode { normal: 16_000, low_power: 75_000 },
        word_gap_ns: 0,
        normal_mode_max_smpl_prd: 0x08,
        start_up_us: 290_000,
        reset_us: 170_000,
        wake_pulse_ns: 10_000,
        wake_us: ByMode { normal: 4_000, low_power: 15_000 },
        flash_test_us: ByMode { normal: 17_000, low_power: 90_000 },
        self_test_us: 12_000,
        flash_update_us: 100_000,
        factory_restore_us: 50_000,
        auto_null_us: 50_000,
        precision_auto_null_us: 30_000_000,
        poll_us: 1_000,
    };

    /// The mode that a value of SMPL_PRD brings.
    pub const fn clock_mode(&self, smpl_prd: u8) -> ClockMode {
        if smpl_prd <= self.normal_mode_max_smpl_prd { ClockMode::Normal } else { ClockMode::LowPower }
    }
}

impl Default for Timing {
    fn default() -> Self {
        Self::DEFAULT
    }
}
