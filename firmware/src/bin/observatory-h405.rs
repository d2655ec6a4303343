//! The image for an Olimex STM32-H405: STM32F405RG, 8 MHz crystal, LED on PC12.
//!
//! | pin | signal | at the sensor |
//! |---|---|---|
//! | PA4 | chip select, active low | CS |
//! | PA5, PA6, PA7 | SPI1 SCK, MISO, MOSI, mode 3 | SCLK, DOUT, DIN |
//! | PB0 | data ready, rising edge | DIO1 |
//! | PA2, PA3 | USART2 TX, RX, 460 800 Bd 8N1 | to the host |
//!
//! The sensor runs from 5 V; its outputs are connected to 5 V tolerant pins without a pull, and its inputs accept 3.3 V.
#![no_std]
#![no_main]

use firmware::BusTiming;
use firmware::microcontroller::stm32f4::bus::{Spi1Bus, spi1_bus};
use firmware::microcontroller::stm32f4::port::{BAUD, UsartPort};
use firmware::microcontroller::stm32f4::start::{Started, Stm32f4, data_ready_input};
use firmware::microcontroller::{BoardParts, BoardSupport, NotConnected, UartQueues};
use stm32f4xx_hal::gpio::{Input, Output, PA4, PB0, PC12};
use stm32f4xx_hal::pac::{self, USART2};
use stm32f4xx_hal::{prelude::*, serial};

const CRYSTAL_HZ: u32 = 8_000_000;

/// The board.
pub struct H405;

impl BoardSupport for H405 {
    type Device = pac::Peripherals;
    type Microcontroller = Stm32f4;
    type DataReady = PB0<Input>;
    type Bus = Spi1Bus<PA4<Output>>;
    type Uart = UsartPort<USART2>;
    type Usb = NotConnected;
    type Led = PC12<Output>;
    type ResetLine = NotConnected;

    fn start(device: pac::Peripherals, queues: UartQueues) -> BoardParts<Self> {
        let Started { cause, clock, mut rcc, microcontroller } =
            Stm32f4::start((device.RCC, device.FLASH, device.TIM2, device.IWDG), CRYSTAL_HZ);
        let (gpioa, gpiob, gpioc) =
            (device.GPIOA.split(&mut rcc), device.GPIOB.split(&mut rcc), device.GPIOC.split(&mut rcc));

        let settings = serial::Config::default().baudrate(BAUD.bps());
        let usart =
            device.USART2.serial((gpioa.pa2, gpioa.pa3), settings, &mut rcc).expect("the baud rate is in range");
        let wires = (gpioa.pa4, gpioa.pa5, gpioa.pa6, gpioa.pa7);
        let bus = spi1_bus((device.SPI1, device.DMA2), wires, &mut rcc, BusTiming::SAFE);
        let data_ready = data_ready_input(gpiob.pb0, (device.EXTI, device.SYSCFG), &mut rcc);
        let led = gpioc.pc12.into_push_pull_output();

        let (core_hz, uart) = (rcc.clocks.hclk().raw(), UsartPort::new(usart, queues));
        let (usb, reset_line) = (None, None);
        BoardParts { cause, clock, core_hz, microcontroller, data_ready, bus, uart, usb, led, reset_line }
    }
}

firmware::observatory! {
    board: H405;
    device: stm32f4xx_hal::pac;
    data_ready: EXTI0;
    end_of_burst: DMA2_STREAM0;
    uart: USART2;
    estimators: CAN1_TX; // software-triggered: the interrupt of CAN1, a peripheral that is not used
}
