//! The image for a Raspberry Pi Pico: RP2040, 12 MHz crystal, LED on GP25.
//!
//! | pin | signal | at the sensor |
//! |---|---|---|
//! | GP17 | chip select, active low | CS |
//! | GP18, GP16, GP19 | SPI0 SCK, MISO, MOSI, mode 3 | SCLK, DOUT, DIN |
//! | GP20 | data ready, rising edge | DIO1 |
//! | GP0, GP1 | UART0 TX, RX, 460 800 Bd 8N1 | to the host |
//! | USB | serial port (CDC-ACM), the same messages | to the host |
//!
//! The sensor runs from 5 V and drives its outputs from an internal 3.3 V: connect every signal directly, without a divider
//! or a level shifter (data sheet Rev. B, page 5).
#![no_std]
#![no_main]

use firmware::BusTiming;
use firmware::microcontroller::rp2040::bus::Spi0Bus;
use firmware::microcontroller::rp2040::port::Uart0Port;
use firmware::microcontroller::rp2040::start::{ClockParts, Rp2040, boot_cause};
#[cfg(feature = "pico-usb")]
use firmware::microcontroller::rp2040::usb::{Rp2040UsbPort, usb_port};
use firmware::microcontroller::{BoardParts, BoardSupport, NotConnected, UartQueues};
use firmware::sensor::BURST_LIMIT_HZ;
use link::ClockSource;
use rp2040_hal::clocks::Clock;
use rp2040_hal::fugit::RateExtU32;
use rp2040_hal::gpio::bank0::{Gpio0, Gpio1, Gpio16, Gpio17, Gpio18, Gpio19, Gpio20, Gpio25};
use rp2040_hal::gpio::{
    self, FunctionSioInput, FunctionSioOutput, FunctionSpi, FunctionUart, PullDown, PullNone, PullUp,
};
use rp2040_hal::{Sio, Spi, pac, spi, uart};

/// The second stage of the boot loader, for the Pico's flash.
#[unsafe(link_section = ".boot2")]
#[unsafe(no_mangle)]
#[used]
static BOOT2_FIRMWARE: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

const BAUD: u32 = 460_800;

type Pin<I, F, P = PullDown> = gpio::Pin<I, F, P>;
type Wires = (Pin<Gpio19, FunctionSpi>, Pin<Gpio16, FunctionSpi, PullNone>, Pin<Gpio18, FunctionSpi>);

/// The board.
pub struct Pico;

impl BoardSupport for Pico {
    type Device = pac::Peripherals;
    type Microcontroller = Rp2040;
    type DataReady = Pin<Gpio20, FunctionSioInput, PullNone>;
    type Bus = Spi0Bus<Wires, Pin<Gpio17, FunctionSioOutput>>;
    type Uart = Uart0Port<(Pin<Gpio0, FunctionUart>, Pin<Gpio1, FunctionUart, PullUp>)>;
    #[cfg(feature = "pico-usb")]
    type Usb = Rp2040UsbPort;
    #[cfg(not(feature = "pico-usb"))]
    type Usb = NotConnected;
    type Led = Pin<Gpio25, FunctionSioOutput>;
    type ResetLine = NotConnected;

    fn start(device: pac::Peripherals, queues: UartQueues) -> BoardParts<Self> {
        let cause = boot_cause(&device.VREG_AND_CHIP_RESET, &device.WATCHDOG);
        let mut resets = device.RESETS;
        let sio = Sio::new(device.SIO);
        let pins = gpio::Pins::new(device.IO_BANK0, device.PADS_BANK0, sio.gpio_bank0, &mut resets);
        let mut led = pins.gpio25.into_push_pull_output();
        let parts = ClockParts {
            crystal: device.XOSC,
            clocks: device.CLOCKS,
            plls: (device.PLL_SYS, device.PLL_USB),
            timer: device.TIMER,
        };
        let supervision = (device.WATCHDOG, &device.VREG_AND_CHIP_RESET);
        let Ok((microcontroller, clocks)) = Rp2040::start(parts, supervision, &mut resets, &mut led) else {
            panic!("the clocks do not start");
        };
        let (peripheral, core_hz) = (clocks.peripheral_clock.freq(), clocks.system_clock.freq().to_Hz());

        let settings = uart::UartConfig::new(BAUD.Hz(), uart::DataBits::Eight, None, uart::StopBits::One);
        // Nothing may be connected to the receiver: pulled up it is idle.
        let lines = (pins.gpio0.into_function(), pins.gpio1.reconfigure());
        let serial = uart::UartPeripheral::new(device.UART0, lines, &mut resets)
            .enable(settings, peripheral)
            .expect("the baud rate is in range");

        let wires = (pins.gpio19.into_function(), pins.gpio16.reconfigure(), pins.gpio18.into_function());
        let spi = Spi::<_, _, _, 8>::new(device.SPI0, wires);
        let mode = spi::FrameFormat::MotorolaSpi(embedded_hal::spi::MODE_3);
        let spi = spi.init(&mut resets, peripheral, BURST_LIMIT_HZ.Hz(), mode);
        let select = pins.gpio17.into_push_pull_output_in_state(gpio::PinState::High);
        #[cfg(not(feature = "pico-usb"))]
        let usb = None;
        #[cfg(feature = "pico-usb")]
        let usb = usb_port((device.USBCTRL_REGS, device.USBCTRL_DPRAM), clocks.usb_clock, &mut resets);
        let bus = Spi0Bus::new((spi, peripheral), select, device.DMA, &mut resets, BusTiming::SAFE);

        let data_ready = pins.gpio20.into_floating_input();
        data_ready.set_interrupt_enabled(gpio::Interrupt::EdgeHigh, true);

        let (uart, clock) = (Uart0Port::new(serial, queues), ClockSource::Crystal);
        BoardParts { cause, clock, core_hz, microcontroller, data_ready, bus, uart, usb, led, reset_line: None }
    }
}

firmware::observatory! {
    board: Pico;
    device: rp2040_hal::pac;
    data_ready: IO_IRQ_BANK0;
    end_of_burst: DMA_IRQ_0;
    uart: UART0_IRQ;
    usb: USBCTRL_IRQ;
    estimators: SW0_IRQ;
}
