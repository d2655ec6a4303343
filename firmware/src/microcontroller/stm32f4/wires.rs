//! The sensor's wires to an STM32F4: bus and data-ready input.

use super::bus::{Spi1, spi1_bus};
use super::port::UsartPort;
use super::start::{Started, Stm32f4};
use crate::microcontroller::{BoardParts, DataReadyPin, Microcontroller, UsbParts};
use stm32f4xx_hal::gpio::{Edge, ErasedPin, ExtiPin, Input, Output, PA4, PA5, PA6, PA7, Pin};
use stm32f4xx_hal::pac::{DMA2, EXTI, SPI1, SYSCFG};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::serial::Instance;

/// An STM32F4 with the sensor on SPI1 and PA4, DIO1 at a pin of port `P`, and the USART `U`.
pub type WiredStm32f4<const P: char, const N: u8, U> = Stm32f4<Pin<P, N, Input>, Spi1, PA4<Output>, UsartPort<U>>;

/// The wires of the sensor on a board.
pub struct SensorWires<const P: char, const N: u8> {
    /// SPI1, and the controller of its DMA transfers.
    pub spi: (SPI1, DMA2),
    /// Chip select, SCK, MISO and MOSI.
    pub pins: (PA4, PA5, PA6, PA7),
    /// The pin at DIO1.
    pub data_ready: Pin<P, N>,
    /// The peripherals that turn edges of that pin into interrupts.
    pub edges: (EXTI, SYSCFG),
}

impl Started {
    /// The parts of a board with these wires, without a reset line.
    pub fn board<const P: char, const N: u8, U: Instance>(
        self,
        sensor: SensorWires<P, N>,
        uart: UsartPort<U>,
        usb: Option<UsbParts<<WiredStm32f4<P, N, U> as Microcontroller>::Usb>>,
        led: ErasedPin<Output>,
    ) -> BoardParts<WiredStm32f4<P, N, U>> {
        let Self { cause, clock, mut rcc } = self;
        let bus = spi1_bus(sensor.spi, sensor.pins, &mut rcc);
        let data_ready = data_ready_input(sensor.data_ready, sensor.edges, &mut rcc);
        let core_hz = rcc.clocks.hclk().raw();
        BoardParts { cause, clock, core_hz, data_ready, bus, uart, usb, led, reset_line: None }
    }
}

/// The data-ready input, pulled down, so that an unplugged sensor gives no edges.
fn data_ready_input<const P: char, const N: u8>(
    pin: Pin<P, N>,
    (mut exti, syscfg): (EXTI, SYSCFG),
    rcc: &mut Rcc,
) -> Pin<P, N, Input>
where
    Pin<P, N, Input>: ExtiPin,
{
    let mut pin = pin.into_pull_down_input();
    pin.make_interrupt_source(&mut syscfg.constrain(rcc));
    pin.trigger_on_edge(&mut exti, Edge::Rising);
    pin.enable_interrupt(&mut exti);
    pin
}

impl<const P: char, const N: u8> DataReadyPin for Pin<P, N, Input> {
    fn clear(&mut self) {
        self.clear_interrupt_pending_bit();
    }

    fn set_masked(&mut self, masked: bool) {
        // SAFETY: the line of this pin in a register that the interrupt of the pin alone uses too, which waits meanwhile.
        let mask = unsafe { (*EXTI::ptr()).imr() };
        let is_masked = mask.read().bits() >> N & 1 == 0;
        if masked != is_masked {
            self.clear_interrupt_pending_bit();
            // SAFETY: a bit of the mask.
            mask.modify(|r, w| unsafe { w.bits(r.bits() & !(1 << N) | u32::from(!masked) << N) });
        }
    }

    fn is_active(&mut self) -> bool {
        self.is_high()
    }
}
