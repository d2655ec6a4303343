//! The image for a Raspberry Pi Pico: RP2040, 12 MHz crystal, LED on GP25, wired as [`wires`] says. RST of the sensor is not connected.
#![no_std]
#![no_main]

use firmware::microcontroller::rp2040::start::Rp2040;
use firmware::microcontroller::rp2040::wires;
use firmware::microcontroller::{BoardParts, BoardSupport, UartQueues};
use rp2040_hal::pac;

/// The second stage of the boot loader, for the Pico's flash.
#[unsafe(link_section = ".boot2")]
#[unsafe(no_mangle)]
#[used]
static BOOT2_FIRMWARE: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

/// The board.
pub struct Pico;

impl BoardSupport for Pico {
    type Device = pac::Peripherals;
    type Microcontroller = Rp2040;
    type DataReady = wires::DataReady;
    type Spi = wires::SensorSpi0;
    type Select = wires::Select;
    type Uart = wires::Uart;

    fn start(device: pac::Peripherals, queues: UartQueues) -> BoardParts<Self> {
        wires::start(device, queues, cfg!(feature = "pico-usb"), false)
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
