//! The image for a Raspberry Pi Pico (RP2040).
//!
//! | pin | signal | at the sensor |
//! |---|---|---|
//! | GP17 | chip select, active low | CS |
//! | GP18, GP16, GP19 | SPI0 SCK, MISO, MOSI, mode 3 | SCLK, DOUT, DIN |
//! | GP20 | data ready, rising edge | DIO1 |
//! | GP0, GP1 | UART0 TX, RX, 460 800 Bd 8N1 | to the host |
//!
//! The sensor runs from 5 V. The RP2040's pins accept 3.3 V at most: outputs of the sensor above that need a divider or level
//! shifter.
#![no_std]
#![no_main]

use firmware::microcontroller::rp2040::{Rp2040, Spi0Bus, Uart0Port, boot_cause};
use firmware::microcontroller::{BoardParts, UartQueues};
use firmware::sensor::BURST_LIMIT_HZ;
use rp2040_hal::clocks::{Clock, init_clocks_and_plls};
use rp2040_hal::fugit::RateExtU32;
use rp2040_hal::gpio::bank0::{Gpio0, Gpio1, Gpio16, Gpio17, Gpio18, Gpio19, Gpio20};
use rp2040_hal::gpio::{self, FunctionSioInput, FunctionSioOutput, FunctionSpi, FunctionUart, PullDown};
use rp2040_hal::{Sio, Spi, Watchdog, pac, spi, uart};

/// The second stage of the boot loader, for the Pico's flash.
#[unsafe(link_section = ".boot2")]
#[unsafe(no_mangle)]
#[used]
static BOOT2_FIRMWARE: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

const CRYSTAL_HZ: u32 = 12_000_000;
const BAUD: u32 = 460_800;

type Pin<I, F> = gpio::Pin<I, F, PullDown>;
type DataReady = Pin<Gpio20, FunctionSioInput>;
type Wires = (Pin<Gpio19, FunctionSpi>, Pin<Gpio16, FunctionSpi>, Pin<Gpio18, FunctionSpi>);
type Bus = Spi0Bus<Wires, Pin<Gpio17, FunctionSioOutput>>;
type Port = Uart0Port<(Pin<Gpio0, FunctionUart>, Pin<Gpio1, FunctionUart>)>;

fn start(device: pac::Peripherals, queues: UartQueues) -> BoardParts<Rp2040, DataReady, Bus, Port> {
    let cause = boot_cause(&device.VREG_AND_CHIP_RESET, &device.WATCHDOG);
    let mut resets = device.RESETS;
    let mut watchdog = Watchdog::new(device.WATCHDOG);
    let Ok(clocks) = init_clocks_and_plls(
        CRYSTAL_HZ,
        device.XOSC,
        device.CLOCKS,
        device.PLL_SYS,
        device.PLL_USB,
        &mut resets,
        &mut watchdog,
    ) else {
        panic!("the clocks do not start");
    };
    let microcontroller = Rp2040::start(device.TIMER, watchdog, &mut resets, &clocks);
    let sio = Sio::new(device.SIO);
    let pins = gpio::Pins::new(device.IO_BANK0, device.PADS_BANK0, sio.gpio_bank0, &mut resets);
    let peripheral = clocks.peripheral_clock.freq();

    let settings = uart::UartConfig::new(BAUD.Hz(), uart::DataBits::Eight, None, uart::StopBits::One);
    let lines = (pins.gpio0.into_function(), pins.gpio1.into_function());
    let serial = uart::UartPeripheral::new(device.UART0, lines, &mut resets)
        .enable(settings, peripheral)
        .expect("the baud rate is in range");

    let wires = (pins.gpio19.into_function(), pins.gpio16.into_function(), pins.gpio18.into_function());
    let spi = Spi::<_, _, _, 8>::new(device.SPI0, wires);
    let request = BURST_LIMIT_HZ.Hz();
    let spi = spi.init(&mut resets, peripheral, request, spi::FrameFormat::MotorolaSpi(embedded_hal::spi::MODE_3));
    let select = pins.gpio17.into_push_pull_output_in_state(gpio::PinState::High);
    let bus = Spi0Bus::new(spi, select, device.DMA, &mut resets);
    let spi_clock_hz = bus.clock_hz(peripheral.to_Hz());

    let data_ready = pins.gpio20.into_pull_down_input();
    data_ready.set_interrupt_enabled(gpio::Interrupt::EdgeHigh, true);

    let port = Uart0Port::new(serial, queues);
    let core_hz = clocks.system_clock.freq().to_Hz();
    BoardParts { cause, core_hz, spi_clock_hz, microcontroller, data_ready, bus, port }
}

firmware::observatory! {
    device: rp2040_hal::pac;
    start: start;
    microcontroller: Rp2040;
    data_ready: DataReady, IO_IRQ_BANK0;
    bus: Bus, DMA_IRQ_0;
    port: Port, UART0_IRQ;
    estimators: SW0_IRQ;
}
