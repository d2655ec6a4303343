//! The serial port to the host, byte by byte in its interrupt.

use crate::chip::SERIAL_OVERRUNS;
use core::sync::atomic::Ordering::Relaxed;
use heapless::spsc::{Consumer, Producer, Queue};
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::USART2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Rx, RxListen, Serial, Tx, TxISR, TxListen};

pub(crate) type Incoming = Queue<u8, 64>;

pub(crate) struct Port {
    tx: Tx<USART2>,
    rx: Rx<USART2>,
    outgoing: Consumer<'static, u8>,
    incoming: Producer<'static, u8>,
}

impl Port {
    pub(crate) fn new(usart: Serial<USART2>, outgoing: Consumer<'static, u8>, incoming: Producer<'static, u8>) -> Self {
        let (tx, mut rx) = usart.split();
        rx.listen();
        Self { tx, rx, outgoing, incoming }
    }

    pub(crate) fn serve(&mut self) {
        // Read whatever the flags say: an overrun raises the interrupt too, and only a read clears it.
        let lost = match self.rx.read() {
            Ok(byte) => self.incoming.enqueue(byte).is_err(),
            Err(nb::Error::Other(_)) => true,
            Err(nb::Error::WouldBlock) => false,
        };
        if lost {
            SERIAL_OVERRUNS.store(SERIAL_OVERRUNS.load(Relaxed).saturating_add(1), Relaxed);
        }
        if self.tx.is_tx_empty() {
            match self.outgoing.dequeue() {
                Some(byte) => {
                    let _empty_was_checked = self.tx.write(byte);
                    self.tx.listen();
                }
                None => self.tx.unlisten(),
            }
        }
    }
}
