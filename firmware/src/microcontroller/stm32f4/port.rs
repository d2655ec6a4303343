//! The serial port to the host, byte by byte in its interrupt.

use crate::microcontroller::{Line, Port};
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::USART2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Rx, RxListen, Serial, Tx, TxISR, TxListen};

/// USART2 and its queues.
pub struct SerialPort {
    tx: Tx<USART2>,
    rx: Rx<USART2>,
    line: Line,
}

impl SerialPort {
    /// Begins to listen.
    pub fn new(usart: Serial<USART2>, line: Line) -> Self {
        let (tx, mut rx) = usart.split();
        rx.listen();
        Self { tx, rx, line }
    }
}

impl Port for SerialPort {
    fn serve(&mut self) -> u32 {
        // Read whatever the flags say: an overrun raises the interrupt too, and only a read clears it.
        let lost = match self.rx.read() {
            Ok(byte) => self.line.incoming.enqueue(byte).is_err(),
            Err(nb::Error::Other(_)) => true,
            Err(nb::Error::WouldBlock) => false,
        };
        if self.tx.is_tx_empty() {
            match self.line.outgoing.dequeue() {
                Some(byte) => {
                    let _empty_was_checked = self.tx.write(byte);
                    self.tx.listen();
                }
                None => self.tx.unlisten(),
            }
        }
        u32::from(lost)
    }
}
