//! Example of a custom board, outside of the package `firmware`. It is an RP2040 wired as a Raspberry Pi Pico, whose GP21 is connected to
//! RST of the sensor, so that the recovery can reset the sensor by its pin. The system tests build and run it; take it as a template. A
//! board with other pins starts them itself, as [`wires::start`] does.
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
pub struct ExampleBoard;

impl BoardSupport for ExampleBoard {
    type Device = pac::Peripherals;
    type Microcontroller = Rp2040;
    type DataReady = wires::DataReady;
    type Spi = wires::SensorSpi0;
    type Select = wires::Select;
    type Uart = wires::Uart;

    fn start(device: pac::Peripherals, queues: UartQueues) -> BoardParts<Self> {
        wires::start(device, queues, true, true)
    }
}

firmware::observatory! {
    board: ExampleBoard;
    device: rp2040_hal::pac;
    data_ready: IO_IRQ_BANK0;
    end_of_burst: DMA_IRQ_0;
    uart: UART0_IRQ;
    usb: USBCTRL_IRQ;
    estimators: SW0_IRQ;
}
