//! The bits of DIAG_STAT, and the checks of each sample that set them: the supply voltage and the two alarms.

use crate::registers::{self, OutputRegister, RegisterFile};
use std::collections::VecDeque;

const SUPPLY_LOW: u16 = 1 << 0;
const SUPPLY_HIGH: u16 = 1 << 1;
pub(crate) const FLASH_UPDATE: u16 = 1 << 2;
pub(crate) const SPI: u16 = 1 << 3;
pub(crate) const SELF_TEST: u16 = 1 << 5;
pub(crate) const FLASH_CHECKSUM: u16 = 1 << 6;
const ALARM_1: u16 = 1 << 8;
/// The bits of both alarms.
pub(crate) const ALARMS: u16 = ALARM_1 | ALARM_1 << 1;
/// Self-test failure of gyro x; gyros y and z and the accelerometers follow.
pub(crate) const GYRO_X: u16 = 1 << 10;

/// A flag of DIAG_STAT. Bit 7 is unused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum DiagnosisFlag {
    /// Supply below 4.75 V.
    SupplyLow = 0,
    /// Supply above 5.25 V.
    SupplyHigh = 1,
    /// A flash or control update failed.
    FlashUpdate = 2,
    /// A frame had a wrong number of clocks.
    SpiCommunication = 3,
    /// A sensor is beyond its range.
    OverRange = 4,
    /// A self-test failed.
    SelfTest = 5,
    /// The checksum of the flash is wrong.
    FlashChecksum = 6,
    /// Alarm 1.
    Alarm1 = 8,
    /// Alarm 2.
    Alarm2 = 9,
    /// Self-test of gyro x.
    GyroX = 10,
    /// Self-test of gyro y.
    GyroY = 11,
    /// Self-test of gyro z.
    GyroZ = 12,
    /// Self-test of accelerometer x.
    AcclX = 13,
    /// Self-test of accelerometer y.
    AcclY = 14,
    /// Self-test of accelerometer z.
    AcclZ = 15,
}

impl DiagnosisFlag {
    /// All flags.
    pub const ALL: [Self; 15] = [
        Self::SupplyLow,
        Self::SupplyHigh,
        Self::FlashUpdate,
        Self::SpiCommunication,
        Self::OverRange,
        Self::SelfTest,
        Self::FlashChecksum,
        Self::Alarm1,
        Self::Alarm2,
        Self::GyroX,
        Self::GyroY,
        Self::GyroZ,
        Self::AcclX,
        Self::AcclY,
        Self::AcclZ,
    ];

    /// The bit in DIAG_STAT.
    pub const fn bit(self) -> u16 {
        1 << self as u8
    }
}

/// Limits of the supply voltage, V.
const SUPPLY_RANGE_V: (f64, f64) = (4.75, 5.25);
/// Size of a count of SUPPLY_OUT, V.
const SUPPLY_LSB: f64 = OutputRegister::Supply.lsb(0.0);

/// The bits of DIAG_STAT that follow the supply without a read (data sheet Rev. B, page 15).
pub(crate) const SUPPLY_FLAGS: u16 = SUPPLY_LOW | SUPPLY_HIGH;

/// The bit of DIAG_STAT that the latest sample sets for its supply voltage.
pub(crate) fn check_supply(counts: &[i16; 12]) -> u16 {
    let supply_v = f64::from(counts[OutputRegister::Supply as usize]) * SUPPLY_LSB;
    if supply_v < SUPPLY_RANGE_V.0 {
        SUPPLY_LOW
    } else if supply_v > SUPPLY_RANGE_V.1 {
        SUPPLY_HIGH
    } else {
        0
    }
}

/// ALM_MAG: alarm above the threshold, not below it.
const ABOVE: u16 = 1 << 15;
/// ALM_CTRL: compare filtered outputs.
const COMPARE_FILTERED: u16 = 1 << 4;
/// Length of the history: the latest output and as many earlier ones as ALM_SMPL can select.
const HISTORY: usize = 256;

/// The two alarms on the level or the rate of change of any output (data sheet Rev. B, Tables 24 to 26).
#[derive(Clone, Debug, Default)]
pub(crate) struct Alarms {
    /// The latest outputs of each alarm's source, newest first.
    history: [VecDeque<i16>; 2],
}

impl Alarms {
    /// Compares the latest sample, in counts, with the thresholds; returns the bits of DIAG_STAT that it sets.
    pub(crate) fn check(&mut self, registers: &RegisterFile, filtered: &[i16; 12], unfiltered: &[i16; 12]) -> u16 {
        let control = registers.read(registers::ALM_CTRL);
        let counts = if control & COMPARE_FILTERED != 0 { filtered } else { unfiltered };
        let mut raised = 0;
        for (index, history) in self.history.iter_mut().enumerate() {
            let source = usize::from(control >> (8 + 4 * index) & 0xF);
            let Some(&value) = source.checked_sub(1).and_then(|output| counts.get(output)) else {
                history.clear();
                continue;
            };
            history.push_front(value);
            history.truncate(HISTORY);
            let rate_of_change = control >> (6 + index) & 1 != 0;
            let address = 2 * index as u8;
            // Both 0x00 and 0x01 mean one sample (Table 26).
            let back = usize::from(registers.read(registers::ALM_SMPL1 + address)).max(1);
            let watched = match (rate_of_change, history.get(back)) {
                (false, _) => Some(i32::from(value)),
                (true, Some(&before)) => Some(i32::from(value) - i32::from(before)),
                (true, None) => None,
            };
            let magnitude = registers.read(registers::ALM_MAG1 + address);
            let threshold = threshold(magnitude, source - 1);
            let beyond = |watched| if magnitude & ABOVE != 0 { watched > threshold } else { watched < threshold };
            if watched.is_some_and(beyond) {
                raised |= ALARM_1 << index;
            }
        }
        raised
    }
}

/// Bits 13:0 of ALM_MAG in the format of the output: two's complement or binary, of 14 or 12 bits.
fn threshold(magnitude: u16, output: usize) -> i32 {
    let field = i32::from(magnitude & 0x3FFF);
    match output {
        0 => field,
        11 => field & 0x0FFF,
        10 => (field & 0x0FFF) - (field & 0x0800) * 2,
        _ => field - (field & 0x2000) * 2,
    }
}
