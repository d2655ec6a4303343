//! The serial port to the host, in its interrupt.

use crate::microcontroller::{Line, Port};
use rp2040_hal::pac::UART0;
use rp2040_hal::uart::{Enabled, UartPeripheral, ValidUartPinout};

/// UART0 and its queues.
pub struct SerialPort<W: ValidUartPinout<UART0>> {
    uart: UartPeripheral<Enabled, UART0, W>,
    line: Line,
}

impl<W: ValidUartPinout<UART0>> SerialPort<W> {
    /// Begins to listen.
    pub fn new(mut uart: UartPeripheral<Enabled, UART0, W>, line: Line) -> Self {
        uart.enable_rx_interrupt();
        Self { uart, line }
    }
}

impl<W: ValidUartPinout<UART0>> Port for SerialPort<W> {
    fn serve(&mut self) -> u32 {
        let mut byte = [0];
        let mut lost = 0;
        while self.uart.uart_is_readable() {
            let taken = self.uart.read_raw(&mut byte).is_ok() && self.line.incoming.enqueue(byte[0]).is_ok();
            lost += u32::from(!taken);
        }
        while self.uart.uart_is_writable()
            && let Some(byte) = self.line.outgoing.dequeue()
        {
            let _writable_was_checked = self.uart.write_raw(&[byte]);
        }
        if self.line.outgoing.ready() {
            self.uart.enable_tx_interrupt();
        } else {
            self.uart.disable_tx_interrupt();
        }
        lost
    }
}
