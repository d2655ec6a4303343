//! RP2040: SPI0 with two DMA channels, UART0, the timer as the clock, the watchdog.

pub mod bus;
pub mod flash;
pub mod port;
pub mod start;
pub mod usb;
