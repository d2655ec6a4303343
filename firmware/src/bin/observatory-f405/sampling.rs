//! The data-ready interrupt and the sensor that it alone talks to.

use core::cell::RefCell;
use critical_section::Mutex;
use embedded_hal::delay::DelayNs;
use embedded_hal_bus::spi::ExclusiveDevice;
use firmware::{Acquisition, Arrival, spi_clock};
use stm32f4xx_hal::gpio::{ExtiPin, Input, Output, PA4, PB0};
use stm32f4xx_hal::{interrupt, pac, spi::Spi, timer::DelayUs};

pub(crate) type Bus = ExclusiveDevice<Spi<pac::SPI1>, PA4<Output>, Stall>;

/// Pauses on the bus, rounded up to microseconds. The `delay_ns` of stm32f4xx-hal 0.23 takes its argument for
/// microseconds and would wait a thousand times too long.
pub(crate) struct Stall(pub(crate) DelayUs<pac::TIM5>);

impl DelayNs for Stall {
    fn delay_ns(&mut self, ns: u32) {
        DelayNs::delay_us(&mut self.0, ns.div_ceil(1000));
    }
}

struct Sampling {
    acquisition: Acquisition<'static, Bus>,
    data_ready: PB0<Input>,
}

/// On its way from the main program to the interrupt.
static HANDOVER: Mutex<RefCell<Option<Sampling>>> = Mutex::new(RefCell::new(None));

/// Below the serial port, so that a burst cannot make it lose a byte.
const PRIORITY: u8 = 2 << 4;

pub(crate) fn start(
    sensor: adis16405_driver::Adis16405<Bus>,
    queue: heapless::spsc::Producer<'static, Arrival>,
    data_ready: PB0<Input>,
    nvic: &mut pac::NVIC,
) {
    let sampling = Sampling { acquisition: Acquisition::new(sensor, queue), data_ready };
    critical_section::with(|section| HANDOVER.borrow_ref_mut(section).replace(sampling));
    // SAFETY: no critical section relies on priorities, and the interrupt finds its data in place.
    unsafe {
        nvic.set_priority(pac::Interrupt::EXTI0, PRIORITY);
        pac::NVIC::unmask(pac::Interrupt::EXTI0);
    }
}

/// The serial clock that the prescaler in CR1 makes of the bus clock.
pub(crate) fn spi_clock_hz(bus_hz: u32) -> u32 {
    // SAFETY: a read of a control register without side effects.
    let control = unsafe { (*pac::SPI1::ptr()).cr1().read() };
    spi_clock::of_prescaler(bus_hz, control.br().bits())
}

#[interrupt]
fn EXTI0() {
    static mut SAMPLING: Option<Sampling> = None;
    if SAMPLING.is_none() {
        *SAMPLING = critical_section::with(|section| HANDOVER.borrow_ref_mut(section).take());
    }
    if let Some(sampling) = SAMPLING {
        sampling.data_ready.clear_interrupt_pending_bit();
        sampling.acquisition.on_data_ready();
    }
}
