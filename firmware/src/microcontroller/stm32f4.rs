//! STM32F4: SPI1 with DMA2, a USART, USB, TIM2 as the clock, the independent watchdog, flash memory for the settings.

pub mod bus;
pub mod flash;
pub mod port;
pub mod start;
#[cfg(feature = "feather-usb")]
pub mod usb;
mod watchdog;
pub mod wires;
