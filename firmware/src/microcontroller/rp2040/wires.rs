//! An RP2040 that is wired to the sensor as a Raspberry Pi Pico: its pins, and the start of the peripherals at them.
//!
//! | pin | signal | at the sensor |
//! |---|---|---|
//! | GP17 | chip select, active low | CS |
//! | GP18, GP16, GP19 | SPI0 SCK, MISO, MOSI, mode 3 | SCLK, DOUT, DIN |
//! | GP20 | data ready, rising edge | DIO1 |
//! | GP21 | reset, active low, on a board that connects it | RST |
//! | GP0, GP1 | UART0 TX, RX, 460 800 Bd 8N1 | to the host |
//! | USB | serial port (CDC-ACM), the same messages | to the host |
//! | GP25 | LED | |
//!
//! The sensor runs from 5 V and drives its outputs from an internal 3.3 V: connect every signal directly, without a divider or a level
//! shifter (data sheet Rev. B, page 5). VBUS gives the 5 V. GP16 and GP20 are pulled down, so that an unplugged
//! sensor gives neither edges nor bits.

use super::bus::Spi0;
use super::port::Uart0Port;
use super::start::{CRYSTAL_HZ, Rp2040, boot_cause, start_crystal, start_watchdog};
use super::usb::usb_port;
use crate::microcontroller::sensor_spi::SensorSpi;
use crate::microcontroller::{BoardParts, UartQueues};
use crate::sensor::BURST_LIMIT_HZ;
use link::ClockSource;
use rp2040_hal::clocks::{Clock, init_clocks_and_plls};
use rp2040_hal::fugit::RateExtU32;
use rp2040_hal::gpio::bank0::{Gpio0, Gpio1, Gpio16, Gpio17, Gpio18, Gpio19, Gpio20};
use rp2040_hal::gpio::{self, FunctionSioInput, FunctionSioOutput, FunctionSpi, FunctionUart, PullDown, PullUp};
use rp2040_hal::{Sio, Spi, Timer, pac, spi, uart};

const BAUD: u32 = 460_800;

type Pin<I, F, P = PullDown> = gpio::Pin<I, F, P>;
type SpiPins = (Pin<Gpio19, FunctionSpi>, Pin<Gpio16, FunctionSpi>, Pin<Gpio18, FunctionSpi>);
/// SPI of the sensor.
pub type SensorSpi0 = Spi0<SpiPins>;
/// Chip select of the sensor.
pub type Select = Pin<Gpio17, FunctionSioOutput>;
/// The data-ready input.
pub type DataReady = Pin<Gpio20, FunctionSioInput>;
/// The serial port on pins.
pub type Uart = Uart0Port<(Pin<Gpio0, FunctionUart>, Pin<Gpio1, FunctionUart, PullUp>)>;

/// An RP2040 with these wires.
pub type WiredRp2040 = Rp2040<DataReady, SensorSpi0, Select, Uart>;

/// Starts a board. `has_usb` starts USB, `has_reset_line` drives RST high.
pub fn start(
    device: pac::Peripherals,
    queues: UartQueues,
    has_usb: bool,
    has_reset_line: bool,
) -> BoardParts<WiredRp2040> {
    let cause = boot_cause(&device.VREG_AND_CHIP_RESET, &device.WATCHDOG);
    let mut resets = device.RESETS;
    let sio = Sio::new(device.SIO);
    let pins = gpio::Pins::new(device.IO_BANK0, device.PADS_BANK0, sio.gpio_bank0, &mut resets);
    // Chip select must be high before SCK rises: the sensor would count that as a clock edge.
    let select = pins.gpio17.into_push_pull_output_in_state(gpio::PinState::High);
    let reset = pins.gpio21;
    let reset_line = has_reset_line.then(|| reset.into_push_pull_output_in_state(gpio::PinState::High).into_dyn_pin());
    let mut led = pins.gpio25.into_push_pull_output().into_dyn_pin();
    let mut watchdog = start_watchdog(device.WATCHDOG, &device.VREG_AND_CHIP_RESET);
    start_crystal(&device.XOSC, &mut led, &watchdog);
    let clocks = init_clocks_and_plls(
        CRYSTAL_HZ,
        device.XOSC,
        device.CLOCKS,
        device.PLL_SYS,
        device.PLL_USB,
        &mut resets,
        &mut watchdog,
    );
    let Ok(clocks) = clocks else { panic!("the clocks do not start") };
    let _timer_runs_on = Timer::new(device.TIMER, &mut resets, &clocks);
    let (peripheral, core_hz) = (clocks.peripheral_clock.freq(), clocks.system_clock.freq().to_Hz());

    let settings = uart::UartConfig::new(BAUD.Hz(), uart::DataBits::Eight, None, uart::StopBits::One);
    // The pull-up makes an unconnected receiver idle.
    let lines = (pins.gpio0.into_function(), pins.gpio1.reconfigure());
    let serial = uart::UartPeripheral::new(device.UART0, lines, &mut resets)
        .enable(settings, peripheral)
        .expect("the baud rate is in range");

    let wires = (pins.gpio19.into_function(), pins.gpio16.into_function(), pins.gpio18.into_function());
    let spi = Spi::<_, _, _, 8>::new(device.SPI0, wires);
    let mode = spi::FrameFormat::MotorolaSpi(embedded_hal::spi::MODE_3);
    let spi = spi.init(&mut resets, peripheral, BURST_LIMIT_HZ.Hz(), mode);
    let usb_registers = (device.USBCTRL_REGS, device.USBCTRL_DPRAM);
    let usb = if has_usb { usb_port(usb_registers, clocks.usb_clock, &mut resets) } else { None };
    let bus = SensorSpi::new(Spi0::new(spi, peripheral, device.DMA, &mut resets), select);

    let data_ready = pins.gpio20.into_pull_down_input();
    data_ready.set_interrupt_enabled(gpio::Interrupt::EdgeHigh, true);

    let (uart, clock) = (Uart0Port::new(serial, queues), ClockSource::Crystal);
    BoardParts { cause, clock, core_hz, data_ready, bus, uart, usb, led, reset_line }
}
