//! The serial port to the host on a USART.

use crate::microcontroller::UartQueues;
use crate::receive::ServedPort;
use stm32f4xx_hal::gpio::PushPull;
use stm32f4xx_hal::nb;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::serial::config::Config;
use stm32f4xx_hal::serial::{Instance, Rx, RxListen, Serial, Tx, TxISR, TxListen};

/// Baud rate; the format is 8N1.
const BAUD: u32 = 460_800;

/// A USART, served in its interrupt.
pub struct UsartPort<U: Instance> {
    tx: Tx<U>,
    rx: Rx<U>,
    queues: UartQueues,
}

impl<U: Instance> UsartPort<U> {
    /// Starts the port. The pull-up makes an unconnected receiver idle.
    pub fn new(
        usart: U,
        pins: (impl Into<U::Tx<PushPull>>, impl Into<U::Rx<PushPull>>),
        queues: UartQueues,
        rcc: &mut Rcc,
    ) -> Self {
        let settings = Config::default().baudrate(BAUD.bps());
        let usart: Serial<U> = usart.serial(pins, settings, rcc).expect("the baud rate is in range");
        let (tx, mut rx) = usart.split();
        rx.listen();
        Self { tx, rx, queues }
    }
}

impl<U: Instance> ServedPort for UsartPort<U> {
    fn serve(&mut self, _now_us: u32) -> u32 {
        // An overrun also raises the interrupt, and only a read clears it.
        let lost = match self.rx.read() {
            Ok(byte) => self.queues.receive.push(Some(byte)),
            Err(nb::Error::Other(_)) => self.queues.receive.push(None),
            Err(nb::Error::WouldBlock) => 0,
        };
        if self.tx.is_tx_empty() {
            match self.queues.transmit.dequeue() {
                Some(byte) => {
                    let _empty_was_checked = self.tx.write(byte);
                    self.tx.listen();
                }
                None => self.tx.unlisten(),
            }
        }
        lost
    }
}
