//! From the data-ready edge to the queue: what runs in the interrupt.

use adis16405_driver::{Adis16405, Burst, Error, Register};
use embedded_hal::spi::SpiDevice;
use heapless::spsc;

/// Bursts that may wait for the main loop, and the one slot that the queue needs: 1.2 s at 204.8 samples a second.
pub const QUEUE_SLOTS: usize = 256;

/// The queue between the interrupt and the main loop.
pub type Queue = spsc::Queue<Arrival, QUEUE_SLOTS>;

/// One data-ready edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Arrival {
    /// Edges before this one whose bursts found the queue full.
    pub dropped: u32,
    /// The burst, or `None` if the bus refused.
    pub burst: Option<Burst>,
}

/// Reads a burst at each data-ready edge and queues it; never waits for anything but the bus.
pub struct Acquisition<'q, SPI> {
    sensor: Adis16405<SPI>,
    queue: spsc::Producer<'q, Arrival>,
    dropped: u32,
}

impl<'q, SPI: SpiDevice<u8>> Acquisition<'q, SPI> {
    /// Takes a sensor that [`bring_up`] has configured.
    pub fn new(sensor: Adis16405<SPI>, queue: spsc::Producer<'q, Arrival>) -> Self {
        Self { sensor, queue, dropped: 0 }
    }

    /// To be called once at every data-ready edge.
    pub fn on_data_ready(&mut self) {
        let arrival = Arrival { dropped: self.dropped, burst: self.sensor.burst().ok() };
        match self.queue.enqueue(arrival) {
            Ok(()) => self.dropped = 0,
            Err(_full) => self.dropped = self.dropped.saturating_add(1),
        }
    }
}

/// Data ready on DIO1, active high: MSC_CTRL bits 2 and 1 (ADIS16400/ADIS16405 data sheet Rev. B, page 15).
const DATA_READY_ON_DIO1: u16 = 0x0006;

/// Configures the sensor and returns its product identification.
///
/// # Errors
/// What [`Adis16405::init`] says: the bus failed, something else answers, or a register did not take its value.
pub fn bring_up<SPI: SpiDevice<u8>>(sensor: &mut Adis16405<SPI>) -> Result<u16, Error<SPI::Error>> {
    sensor.init()?;
    let data_ready = sensor.read_register(Register::MscCtrl)? & Register::MscCtrl.mask();
    if data_ready & 0x0007 != DATA_READY_ON_DIO1 {
        sensor.write_register(Register::MscCtrl, data_ready & !0x0007 | DATA_READY_ON_DIO1)?;
    }
    sensor.read_register(Register::ProdId)
}
