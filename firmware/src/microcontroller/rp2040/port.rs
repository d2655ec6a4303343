//! The serial port to the host on UART0.

use crate::microcontroller::UartQueues;
use crate::receive::ServedPort;
use rp2040_hal::pac::UART0;
use rp2040_hal::uart::{self, UartPeripheral, ValidUartPinout};

/// UART0, served in its interrupt.
pub struct Uart0Port<W: ValidUartPinout<UART0>> {
    uart: UartPeripheral<uart::Enabled, UART0, W>,
    queues: UartQueues,
}

impl<W: ValidUartPinout<UART0>> Uart0Port<W> {
    /// Makes the port and enables its receive interrupt.
    pub fn new(mut uart: UartPeripheral<uart::Enabled, UART0, W>, queues: UartQueues) -> Self {
        uart.enable_rx_interrupt();
        Self { uart, queues }
    }
}

impl<W: ValidUartPinout<UART0>> ServedPort for Uart0Port<W> {
    fn serve(&mut self, _now_us: u32) -> u32 {
        let mut byte = [0];
        let mut lost = 0;
        while self.uart.uart_is_readable() {
            let received = self.uart.read_raw(&mut byte).is_ok().then_some(byte[0]);
            lost += self.queues.receive.push(received);
        }
        while self.uart.uart_is_writable()
            && let Some(byte) = self.queues.transmit.dequeue()
        {
            let _writable_was_checked = self.uart.write_raw(&[byte]);
        }
        if self.queues.transmit.ready() {
            self.uart.enable_tx_interrupt();
        } else {
            self.uart.disable_tx_interrupt();
        }
        lost
    }
}
