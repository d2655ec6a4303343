//! The serial port to the host, in its interrupt.

use crate::chip::SERIAL_OVERRUNS;
use core::sync::atomic::Ordering::Relaxed;
use heapless::spsc::{Consumer, Producer, Queue};
use rp2040_hal::gpio::bank0::{Gpio0, Gpio1};
use rp2040_hal::gpio::{FunctionUart, Pin, PullDown};
use rp2040_hal::pac::UART0;
use rp2040_hal::uart::{Enabled, UartPeripheral};

pub(crate) type Incoming = Queue<u8, 64>;

type Wires = (Pin<Gpio0, FunctionUart, PullDown>, Pin<Gpio1, FunctionUart, PullDown>);

pub(crate) struct Port {
    uart: UartPeripheral<Enabled, UART0, Wires>,
    outgoing: Consumer<'static, u8>,
    incoming: Producer<'static, u8>,
}

impl Port {
    pub(crate) fn new(
        mut uart: UartPeripheral<Enabled, UART0, Wires>,
        outgoing: Consumer<'static, u8>,
        incoming: Producer<'static, u8>,
    ) -> Self {
        uart.enable_rx_interrupt();
        Self { uart, outgoing, incoming }
    }

    pub(crate) fn serve(&mut self) {
        let mut byte = [0];
        let mut lost = 0;
        while self.uart.uart_is_readable() {
            let taken = self.uart.read_raw(&mut byte).is_ok() && self.incoming.enqueue(byte[0]).is_ok();
            lost += u32::from(!taken);
        }
        SERIAL_OVERRUNS.store(SERIAL_OVERRUNS.load(Relaxed).saturating_add(lost), Relaxed);
        while self.uart.uart_is_writable()
            && let Some(byte) = self.outgoing.dequeue()
        {
            let _writable_was_checked = self.uart.write_raw(&[byte]);
        }
        if self.outgoing.ready() {
            self.uart.enable_tx_interrupt();
        } else {
            self.uart.disable_tx_interrupt();
        }
    }
}
