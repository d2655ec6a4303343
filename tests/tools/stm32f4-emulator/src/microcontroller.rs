//! The emulated STM32F427, extended by parts without a model in the emulator: the external interrupt controller, resets
//! by the supply, and damage to memory and registers.

use rigless::device::{Device, DeviceContext, ErasedDevice, Level, RegisterFile, ResetCause};
use rigless::emulator::{Access, AccessKind, Host};
use rigless::machine::Board;
use rigless::mcu::Mcu;
use rigless::session::Session;
use rigless::soc::stm32f427::generated::exti::Register;
use rigless::soc::stm32f427::generated::rcc;
use rigless::soc::stm32f427::{Stm32f427, peripherals::gpio::Pin};
use rigless::soc::{Bus, Error, Width};
use rigless::time::VirtualNanos;

/// Addresses of SRAM1 and SRAM2, and of the core-coupled memory (RM0090 section 2.3.1).
pub(crate) const RAM: std::ops::Range<u64> = 0x2000_0000..0x2002_0000;
const CORE_COUPLED: std::ops::Range<u64> = 0x1000_0000..0x1001_0000;
const LINES: usize = 5;
/// Position of EXTI0 among the interrupts of the instance in the emulator's table; EXTI1 and so on follow it.
const FIRST_INTERRUPT: usize = 1;

#[derive(Debug)]
pub(crate) struct Microcontroller {
    pub(crate) part: Stm32f427,
    exti: Exti,
    exti_slot: usize,
    rcc_slot: usize,
    /// True if the next reset is reported as a reset by the supply.
    pub(crate) brown_out: bool,
    /// True if the crystal oscillator never becomes ready.
    pub(crate) crystal_fails: bool,
}

impl Microcontroller {
    pub(crate) fn new(part: Stm32f427) -> Result<Self, Error> {
        let (exti_slot, rcc_slot) = (part.bus().slot("EXTI")?, part.bus().slot("RCC")?);
        Ok(Self { part, exti: Exti::default(), exti_slot, rcc_slot, brown_out: false, crystal_fails: false })
    }

    /// Sets the level of a pin of a port, and of the interrupt line with its number.
    pub(crate) fn drive_pin(&mut self, at: VirtualNanos, port: usize, pin: u8, high: bool) {
        let level = if high { Level::High } else { Level::Low };
        self.part.drive_port(at, port, |port, registers, context| {
            port.drive(Pin::new(pin).unwrap(), Some(level), registers, context);
        });
        let (registers, mut context) = self.part.bus_mut().drive(at, self.exti_slot);
        self.exti.drive(usize::from(pin), high, registers, &mut context);
    }
}

impl Mcu for Microcontroller {
    fn bus(&self) -> &Bus {
        self.part.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.part.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.part.reset(at, cause);
        self.exti = Exti::default();
        if std::mem::take(&mut self.brown_out) {
            let (registers, _) = self.part.bus_mut().drive(at, self.rcc_slot);
            let flags = registers.get(rcc::Register::Csr);
            registers.set(rcc::Register::Csr, rcc::csr::BORRSTF.set(flags, 1));
        }
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.part.poll(now);
        if self.crystal_fails {
            let (registers, _) = self.part.bus_mut().drive(now, self.rcc_slot);
            let control = registers.get(rcc::Register::Cr);
            registers.set(rcc::Register::Cr, rcc::cr::HSERDY.set(control, 0));
        }
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        if slot == self.exti_slot {
            return (self.part.bus_mut(), Some(&mut self.exti));
        }
        self.part.split(slot)
    }
}

/// Lines 0 to 4 of the external interrupt controller, RM0090 chapter 12.
#[derive(Debug, Default)]
struct Exti {
    levels: [bool; LINES],
    pending: u64,
}

impl Exti {
    /// Sets the level of the pin that is routed to `line`.
    fn drive(&mut self, line: usize, high: bool, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
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

/// Fills the memory with the output of a linear congruential generator (Knuth's MMIX constants).
pub(crate) fn fill_memory_with_noise(host: &mut dyn Host) {
    let mut state = 1_u64;
    for address in RAM.chain(CORE_COUPLED).step_by(4) {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        host.write(address, Width::W32, state >> 32).expect("memory");
    }
}

/// Sets every aligned pair of words that holds `value` to 0. There must be one.
pub(crate) fn clear_in_memory(host: &mut dyn Host, value: u64) {
    let mut cleared = 0;
    for address in RAM.step_by(8) {
        let word = |host: &mut dyn Host, at| host.read(at, Width::W32).expect("memory");
        if word(host, address) | word(host, address + 4) << 32 == value {
            host.write(address, Width::W32, 0).expect("memory");
            host.write(address + 4, Width::W32, 0).expect("memory");
            cleared += 1;
        }
    }
    assert!(cleared > 0, "{value} is not in memory");
}

/// Reads a peripheral's register, as a debugger would.
pub(crate) fn read<D: Board>(session: &mut Session<D>, host: &mut dyn Host, address: u64) -> u64 {
    session.access(Access::new(AccessKind::Read, address, Width::W32, 0), host).0
}

/// Writes a peripheral's register, as a debugger would.
pub(crate) fn write<D: Board>(session: &mut Session<D>, host: &mut dyn Host, address: u64, value: u64) {
    session.access(Access::new(AccessKind::Write, address, Width::W32, value), host);
}

/// Clears bits of a peripheral's register, as a debugger would.
pub(crate) fn clear_bits<D: Board>(session: &mut Session<D>, host: &mut dyn Host, address: u64, bits: u64) {
    let value = read(session, host, address);
    write(session, host, address, value & !bits);
}
