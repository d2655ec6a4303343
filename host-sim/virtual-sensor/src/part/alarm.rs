//! The two alarms: level or rate of change of any output. The layout is that of the older ADIS16203; no source at hand
//! confirms it for this part.

use std::collections::VecDeque;

use crate::registers::{self, RegisterFile};

const DIAG_ALARM_1: u16 = 1 << 8;
const ABOVE: u16 = 1 << 15;
const COMPARE_FILTERED: u16 = 1 << 4;
/// Outputs kept for the rate of change: as many as ALM_SMPL can count back, and the latest.
const KEPT: usize = 256;

/// What the alarms remember of the outputs that they watch.
#[derive(Clone, Debug, Default)]
pub(super) struct Alarms {
    past: [VecDeque<i16>; 2],
}

impl Alarms {
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Looks at the latest sample; returns the bits of DIAG_STAT that it raises.
    pub(super) fn observe(&mut self, registers: &RegisterFile, filtered: &[i16; 12], unfiltered: &[i16; 12]) -> u16 {
        let control = registers.read(registers::ALM_CTRL);
        let counts = if control & COMPARE_FILTERED != 0 { filtered } else { unfiltered };
        let mut raised = 0;
        for (index, past) in self.past.iter_mut().enumerate() {
            let source = usize::from(control >> (8 + 4 * index) & 0xF);
            let Some(&value) = source.checked_sub(1).and_then(|output| counts.get(output)) else {
                past.clear();
                continue;
            };
            past.push_front(value);
            past.truncate(KEPT);
            let rate_of_change = control >> (6 + index) & 1 != 0;
            let address = 2 * index as u8;
            let back = usize::from(registers.read(registers::ALM_SMPL1 + address));
            let watched = match (rate_of_change, past.get(back)) {
                (false, _) => Some(i32::from(value)),
                (true, Some(&before)) => Some(i32::from(value) - i32::from(before)),
                (true, None) => None,
            };
            let magnitude = registers.read(registers::ALM_MAG1 + address);
            let threshold = threshold(magnitude, source - 1);
            let beyond = |watched| if magnitude & ABOVE != 0 { watched > threshold } else { watched < threshold };
            if watched.is_some_and(beyond) {
                raised |= DIAG_ALARM_1 << index;
            }
        }
        raised
    }
}

/// Bits 13:0 of ALM_MAG in the format of the output: two's complement of 14 or 12 bits, or offset binary of 12.
fn threshold(magnitude: u16, output: usize) -> i32 {
    let field = i32::from(magnitude & 0x3FFF);
    match output {
        0 | 11 => field & 0x0FFF,
        10 => (field & 0x0FFF) - (field & 0x0800) * 2,
        _ => field - (field & 0x2000) * 2,
    }
}
