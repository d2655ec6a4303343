//! Example of a custom board, outside of the package `firmware`. It is an RP2040 wired as a Raspberry Pi Pico, whose GP21 is connected to
//! RST of the sensor, so that the recovery can reset the sensor by its pin. The system tests build and run it; take it as a template. A
//! board with other pins starts them itself, as [`wires::start`] does.
#![no_std]
#![no_main]

use firmware::microcontroller::rp2040::wires::{self, WiredRp2040};
use firmware::microcontroller::{BoardParts, UartQueues};
use rp2040_hal::pac;

/// The second stage of the boot loader, for the Pico's flash.
#[unsafe(link_section = ".boot2")]
#[unsafe(no_mangle)]
#[used]
static BOOT2_FIRMWARE: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

fn start(device: pac::Peripherals, queues: UartQueues) -> BoardParts<WiredRp2040> {
    wires::start(device, queues, true, true)
}

firmware::observatory! {
    microcontroller: WiredRp2040;
    start: start;
    device: rp2040_hal::pac;
    data_ready: IO_IRQ_BANK0;
    end_of_burst: DMA_IRQ_0;
    uart: UART0_IRQ;
    usb: USBCTRL_IRQ;
    estimators: SW0_IRQ;
}
