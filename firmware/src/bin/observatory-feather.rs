//! The image for an Adafruit Feather STM32F405 Express: STM32F405RG, 12 MHz crystal, red LED on PC1 (D13).
//!
//! | board | pin | signal | at the sensor |
//! |---|---|---|---|
//! | A0 | PA4 | chip select, active low | CS |
//! | A1, A2, A3 | PA5, PA6, PA7 | SPI1 SCK, MISO, MOSI, mode 3 | SCLK, DOUT, DIN |
//! | A4 | PC4 | data ready, rising edge | DIO1 |
//! | TX, RX | PB10, PB11 | USART3, 460 800 Bd 8N1 | to the host |
//! | USB | PA11, PA12 | with the feature `feather-usb`, which has not run yet: serial port (CDC-ACM) | to the host |
//!
//! SCK, MO and MI of the board are SPI2 and not used; USB supplies the 5 V.
//!
//! The sensor runs from 5 V and drives its outputs from an internal 3.3 V: connect every signal directly, without a divider or a level
//! shifter (data sheet Rev. B, page 5).
#![no_std]
#![no_main]

use firmware::microcontroller::stm32f4::port::UsartPort;
use firmware::microcontroller::stm32f4::start::Stm32f4;
#[cfg(feature = "feather-usb")]
use firmware::microcontroller::stm32f4::usb::usb_port;
use firmware::microcontroller::stm32f4::wires::{SensorWires, WiredStm32f4};
use firmware::microcontroller::{BoardParts, UartQueues};
use stm32f4xx_hal::pac::{self, USART3};
use stm32f4xx_hal::prelude::*;

const CRYSTAL_HZ: u32 = 12_000_000;

/// The board.
type Feather = WiredStm32f4<'C', 4, USART3>;

fn start(device: pac::Peripherals, queues: UartQueues) -> BoardParts<Feather> {
    let mut started = Stm32f4::start((device.RCC, device.FLASH, device.TIM2, device.IWDG), CRYSTAL_HZ);
    let rcc = &mut started.rcc;
    let (a, b, c) = (device.GPIOA.split(rcc), device.GPIOB.split(rcc), device.GPIOC.split(rcc));
    let uart = UsartPort::new(device.USART3, (b.pb10, b.pb11.into_pull_up_input()), queues, rcc);
    #[cfg(not(feature = "feather-usb"))]
    let usb = None;
    #[cfg(feature = "feather-usb")]
    let usb = {
        let registers = (device.OTG_FS_GLOBAL, device.OTG_FS_DEVICE, device.OTG_FS_PWRCLK);
        usb_port(registers, (a.pa11, a.pa12), &rcc.clocks)
    };
    let sensor = SensorWires {
        spi: (device.SPI1, device.DMA2),
        pins: (a.pa4, a.pa5, a.pa6, a.pa7),
        data_ready: c.pc4,
        edges: (device.EXTI, device.SYSCFG),
    };
    started.board(sensor, uart, usb, c.pc1.into_push_pull_output().erase())
}

firmware::observatory! {
    microcontroller: Feather;
    start: start;
    device: stm32f4xx_hal::pac;
    data_ready: EXTI4;
    end_of_burst: DMA2_STREAM0;
    uart: USART3;
    usb: OTG_FS;
    estimators: CAN1_TX; // software-triggered: the interrupt of CAN1, a peripheral that is not used
}
