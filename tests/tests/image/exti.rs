//! The external interrupt controller, RM0090 chapter 12, lines 0 to 4: the emulator has none for the STM32F427.

use rigless::device::{Device, DeviceContext, Level, RegisterFile};
use rigless::soc::stm32f427::generated::exti::Register;

const LINES: usize = 5;
/// Position of EXTI0 among the interrupts that the emulator's table gives the instance, EXTI1 and so on after it.
const FIRST_INTERRUPT: usize = 1;

#[derive(Debug, Default)]
pub(crate) struct Exti {
    levels: [bool; LINES],
    pending: u64,
}

impl Exti {
    /// The pin that is routed to `line` has a level.
    pub(crate) fn drive(
        &mut self,
        line: usize,
        high: bool,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let selection = if high { Register::Rtsr } else { Register::Ftsr };
        if self.levels[line] != high {
            self.pending |= registers.get(selection) & 1 << line;
        }
        self.levels[line] = high;
        self.request(registers, context);
    }

    fn request(&self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        registers.set(Register::Pr, self.pending);
        let requested = self.pending & registers.get(Register::Imr);
        for line in 0..LINES {
            let level = if requested >> line & 1 != 0 { Level::High } else { Level::Low };
            context.interrupt(FIRST_INTERRUPT + line, level);
        }
    }
}

impl Device for Exti {
    type Register = Register;

    fn write(&mut self, register: Register, value: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if register == Register::Pr {
            self.pending &= !value; // section 12.3.6: cleared by writing ones
        }
        self.request(registers, context);
    }
}
