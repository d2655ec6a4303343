//! STM32F4: SPI1 with DMA2, a USART, TIM2 as the clock, the independent watchdog.

pub mod bus;
pub mod port;
pub mod start;
