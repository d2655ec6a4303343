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
//! SCK, MO and MI of the board are SPI2 and not used. The sensor runs from 5 V, which USB gives; its outputs are connected to
//! 5 V tolerant pins without a pull, and its inputs accept 3.3 V.
#![no_std]
#![no_main]

use firmware::BusTiming;
use firmware::microcontroller::stm32f4::bus::{Spi1Bus, spi1_bus};
use firmware::microcontroller::stm32f4::port::{BAUD, UsartPort};
use firmware::microcontroller::stm32f4::start::{Started, Stm32f4, data_ready_input};
#[cfg(feature = "feather-usb")]
use firmware::microcontroller::stm32f4::usb::{Stm32UsbPort, usb_port};
use firmware::microcontroller::{BoardParts, BoardSupport, NotConnected, UartQueues};
use stm32f4xx_hal::gpio::{Input, Output, PA4, PC1, PC4};
use stm32f4xx_hal::pac::{self, USART3};
use stm32f4xx_hal::{prelude::*, serial};

const CRYSTAL_HZ: u32 = 12_000_000;

/// The board.
pub struct Feather;

impl BoardSupport for Feather {
    type Device = pac::Peripherals;
    type Microcontroller = Stm32f4;
    type DataReady = PC4<Input>;
    type Bus = Spi1Bus<PA4<Output>>;
    type Uart = UsartPort<USART3>;
    #[cfg(feature = "feather-usb")]
    type Usb = Stm32UsbPort;
    #[cfg(not(feature = "feather-usb"))]
    type Usb = NotConnected;
    type Led = PC1<Output>;
    type ResetLine = NotConnected;

    fn start(device: pac::Peripherals, queues: UartQueues) -> BoardParts<Self> {
        let Started { cause, clock, mut rcc, microcontroller } =
            Stm32f4::start((device.RCC, device.FLASH, device.TIM2, device.IWDG), CRYSTAL_HZ);
        let (gpioa, gpiob, gpioc) =
            (device.GPIOA.split(&mut rcc), device.GPIOB.split(&mut rcc), device.GPIOC.split(&mut rcc));

        let settings = serial::Config::default().baudrate(BAUD.bps());
        let usart =
            device.USART3.serial((gpiob.pb10, gpiob.pb11), settings, &mut rcc).expect("the baud rate is in range");
        let wires = (gpioa.pa4, gpioa.pa5, gpioa.pa6, gpioa.pa7);
        let bus = spi1_bus((device.SPI1, device.DMA2), wires, &mut rcc, BusTiming::SAFE);
        let data_ready = data_ready_input(gpioc.pc4, (device.EXTI, device.SYSCFG), &mut rcc);
        let led = gpioc.pc1.into_push_pull_output();

        #[cfg(not(feature = "feather-usb"))]
        let usb = None;
        #[cfg(feature = "feather-usb")]
        let usb = {
            let registers = (device.OTG_FS_GLOBAL, device.OTG_FS_DEVICE, device.OTG_FS_PWRCLK);
            usb_port(registers, (gpioa.pa11, gpioa.pa12), &rcc.clocks)
        };
        let (core_hz, uart) = (rcc.clocks.hclk().raw(), UsartPort::new(usart, queues));
        BoardParts { cause, clock, core_hz, microcontroller, data_ready, bus, uart, usb, led, reset_line: None }
    }
}

firmware::observatory! {
    board: Feather;
    device: stm32f4xx_hal::pac;
    data_ready: EXTI4;
    end_of_burst: DMA2_STREAM0;
    uart: USART3;
    usb: OTG_FS;
    estimators: CAN1_TX; // software-triggered: the interrupt of CAN1, a peripheral that is not used
}
