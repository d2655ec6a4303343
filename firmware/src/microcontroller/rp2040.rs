//! RP2040: SPI0 with two DMA channels, UART0, USB, the timer as the clock, the watchdog, flash memory for the settings.

pub mod bus;
pub mod flash;
pub mod port;
pub mod start;
pub mod usb;
pub mod wires;
