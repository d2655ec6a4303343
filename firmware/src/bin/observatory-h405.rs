//! The image for an Olimex STM32-H405: STM32F405RG, 8 MHz crystal, LED on PC12.
//!
//! | pin | signal | at the sensor |
//! |---|---|---|
//! | PA4 | chip select, active low | CS |
//! | PA5, PA6, PA7 | SPI1 SCK, MISO, MOSI, mode 3 | SCLK, DOUT, DIN |
//! | PB0 | data ready, rising edge | DIO1 |
//! | PA2, PA3 | USART2 TX, RX, 460 800 Bd 8N1 | to the host |
//!
//! The sensor runs from 5 V and drives its outputs from an internal 3.3 V: connect every signal directly, without a divider or a level
//! shifter (data sheet Rev. B, page 5).
#![no_std]
#![no_main]

use firmware::microcontroller::stm32f4::port::UsartPort;
use firmware::microcontroller::stm32f4::start::Stm32f4;
use firmware::microcontroller::stm32f4::wires::{SensorWires, WiredStm32f4};
use firmware::microcontroller::{BoardParts, UartQueues};
use stm32f4xx_hal::pac::{self, USART2};
use stm32f4xx_hal::prelude::*;

const CRYSTAL_HZ: u32 = 8_000_000;

/// The board.
type H405 = WiredStm32f4<'B', 0, USART2>;

fn start(device: pac::Peripherals, queues: UartQueues) -> BoardParts<H405> {
    let mut started = Stm32f4::start((device.RCC, device.FLASH, device.TIM2, device.IWDG), CRYSTAL_HZ);
    let rcc = &mut started.rcc;
    let (a, b, c) = (device.GPIOA.split(rcc), device.GPIOB.split(rcc), device.GPIOC.split(rcc));
    let uart = UsartPort::new(device.USART2, (a.pa2, a.pa3.into_pull_up_input()), queues, rcc);
    let sensor = SensorWires {
        spi: (device.SPI1, device.DMA2),
        pins: (a.pa4, a.pa5, a.pa6, a.pa7),
        data_ready: b.pb0,
        edges: (device.EXTI, device.SYSCFG),
    };
    started.board(sensor, uart, None, c.pc12.into_push_pull_output().erase())
}

firmware::observatory! {
    microcontroller: H405;
    start: start;
    device: stm32f4xx_hal::pac;
    data_ready: EXTI0;
    end_of_burst: DMA2_STREAM0;
    uart: USART2;
    estimators: CAN1_TX; // software-triggered: the interrupt of CAN1, a peripheral that is not used
}
