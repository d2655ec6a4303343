//! The part's pins: DIO1 to DIO4 and the analog output, as a harness sees them.

use super::VirtualAdis16405;
use crate::registers;

/// Length of a data-ready pulse, ns. No source at hand tells; all that matters is that it is shorter than a sample period.
const PULSE_NS: u64 = 100_000;

impl VirtualAdis16405 {
    /// Level of DIO`line`, 1 to 4: data ready, else the alarm output, else what the part drives or the harness set. Other
    /// numbers are low.
    pub fn pin(&self, line: u8) -> bool {
        let signal = |control: u16, active: bool| {
            let here = control & 0b100 != 0 && control & 1 == u16::from(line == 2) && (line == 1 || line == 2);
            here.then_some((control & 0b010 != 0) == active)
        };
        let pulse = self.sampled_at_ns.is_some_and(|at| self.now_ns < at + PULSE_NS);
        let alarm = self.diagnosis & 0x0300 != 0;
        signal(self.registers.read(registers::MSC_CTRL), pulse)
            .or_else(|| signal(self.registers.read(registers::ALM_CTRL), alarm))
            .unwrap_or_else(|| (1..=4).contains(&line) && self.levels() >> (line - 1) & 1 != 0)
    }

    /// Drives DIO`line`, 1 to 4, from outside. A line that the part drives itself does not care.
    pub fn drive_pin(&mut self, line: u8, high: bool) {
        if let 1..=4 = line {
            let bit = 1 << (line - 1);
            self.driven = if high { self.driven | bit } else { self.driven & !bit };
        }
    }

    /// An edge of the external sample clock. Takes a sample if SMPL_PRD selects that clock.
    pub fn external_clock_edge(&mut self) {
        if self.registers.read(registers::SMPL_PRD) == 0 {
            self.sample_externally();
        }
    }

    /// Voltage of the auxiliary analog output: AUX_DAC when it was last latched, V.
    pub fn aux_output_v(&self) -> f64 {
        f64::from(self.latched_dac) * 0.8059e-3
    }

    /// Bit 0 is DIO1: driven by the part where GPIO_CTRL says so, else from outside.
    pub(super) fn levels(&self) -> u16 {
        let control = self.registers.read(registers::GPIO_CTRL);
        let outputs = control & 0xF;
        control >> 8 & outputs | self.driven & !outputs & 0xF
    }
}
