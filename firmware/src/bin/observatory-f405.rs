//! The image for an STM32F405 or STM32F427 with an 8 MHz crystal (Olimex STM32-H405 and the like).
//!
//! | pin | signal | at the sensor |
//! |---|---|---|
//! | PA4 | chip select, active low | CS |
//! | PA5, PA6, PA7 | SPI1 SCK, MISO, MOSI, mode 3 | SCLK, DOUT, DIN |
//! | PB0 | data ready, rising edge | DIO1 |
//! | PA2, PA3 | USART2 TX, RX, 460 800 Bd 8N1 | to the host |
//!
//! The sensor runs from 5 V; its outputs are connected to 5 V tolerant pins, and its inputs accept 3.3 V.
#![no_std]
#![no_main]

use firmware::microcontroller::stm32f4::{Spi1Bus, Stm32f4, Usart2Port, boot_cause};
use firmware::microcontroller::{BoardParts, UartQueues};
use firmware::sensor::{BURST_LIMIT_HZ, largest_clock_hz};
use stm32f4xx_hal::gpio::{Edge, ExtiPin, Input, Output, PA4, PB0, PinState};
use stm32f4xx_hal::{pac, prelude::*, rcc, serial, spi};

const CRYSTAL_HZ: u32 = 8_000_000;
const CORE_HZ: u32 = 168_000_000;
const SPI_BUS_HZ: u32 = 84_000_000;
const BAUD: u32 = 460_800;

type DataReady = PB0<Input>;
type Bus = Spi1Bus<PA4<Output>>;

fn start(device: pac::Peripherals, queues: UartQueues) -> BoardParts<Stm32f4, DataReady, Bus, Usart2Port> {
    let cause = boot_cause(&device.RCC);
    let clocks = rcc::Config::hse(CRYSTAL_HZ.Hz()).sysclk(CORE_HZ.Hz()).pclk1(42.MHz()).pclk2(SPI_BUS_HZ.Hz());
    let mut rcc = device.RCC.freeze(clocks);
    let microcontroller = Stm32f4::start(device.TIM2, device.IWDG, &mut rcc);
    let gpioa = device.GPIOA.split(&mut rcc);
    let gpiob = device.GPIOB.split(&mut rcc);

    let settings = serial::Config::default().baudrate(BAUD.bps());
    let usart = device.USART2.serial((gpioa.pa2, gpioa.pa3), settings, &mut rcc).expect("the baud rate is in range");

    let request =
        largest_clock_hz(rcc.clocks.pclk2().raw(), BURST_LIMIT_HZ).expect("a prescaler reaches the burst limit");
    let mode = spi::Mode { polarity: spi::Polarity::IdleHigh, phase: spi::Phase::CaptureOnSecondTransition };
    let wires = (Some(gpioa.pa5), Some(gpioa.pa6), Some(gpioa.pa7));
    let spi = device.SPI1.spi(wires, mode, request.Hz(), &mut rcc);
    let select = gpioa.pa4.into_push_pull_output_in_state(PinState::High);
    let bus = Spi1Bus::new(spi, select, device.DMA2, &mut rcc);
    let spi_clock_hz = bus.clock_hz(rcc.clocks.pclk2().raw());

    let mut data_ready = gpiob.pb0.into_pull_down_input();
    data_ready.make_interrupt_source(&mut device.SYSCFG.constrain(&mut rcc));
    let mut exti = device.EXTI;
    data_ready.trigger_on_edge(&mut exti, Edge::Rising);
    data_ready.enable_interrupt(&mut exti);

    let port = Usart2Port::new(usart, queues);
    BoardParts { cause, core_hz: rcc.clocks.hclk().raw(), spi_clock_hz, microcontroller, data_ready, bus, port }
}

firmware::observatory! {
    device: stm32f4xx_hal::pac;
    start: start;
    microcontroller: Stm32f4;
    data_ready: DataReady, EXTI0;
    bus: Bus, DMA2_STREAM0;
    port: Usart2Port, USART2;
    estimators: CAN1_TX; // software-triggered: the interrupt of CAN1, a peripheral that is not used
}
