//! The sensor's bus: register frames byte by byte, bursts by DMA, the timing of chip select.

use crate::board::BusTiming;
use crate::bus_frame::{BusFault, ByteExchange, ChipSelect, MicrosecondCounter, transfer, wait_ns};
use adis16405_driver::{BURST_BYTES, BURST_REQUEST};
use core::convert::Infallible;
use core::sync::atomic::{Ordering, compiler_fence};
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

/// Bytes that request a burst, in static memory for DMA.
static REQUEST: [u8; BURST_BYTES] = BURST_REQUEST;

/// An SPI peripheral with the two DMA channels that serve it.
pub trait SpiPeripheral: ByteExchange {
    /// The counter that times the bus.
    type Clock: MicrosecondCounter;
    /// Sets the fastest serial clock of at most `limit_hz`, or the slowest one if none is slow enough; returns it in Hz.
    fn set_clock_limit(&mut self, limit_hz: u32) -> u32;
    /// Resets the peripheral and keeps its settings.
    fn reset(&mut self);
    /// Waits for the current byte and drops received ones, which would shift the next burst.
    fn drain(&mut self);
    /// Starts a transfer of `request`, with an interrupt at its end. Both slices must outlive it, and nothing may use
    /// `received` before it is [stopped](Self::stop).
    fn start(&mut self, request: &'static [u8], received: &mut [u8]);
    /// Stops both channels; true if all bytes were received without an error.
    fn stop(&mut self) -> bool;
}

/// The end of a transfer.
pub enum BurstEnd<'a> {
    /// A word was transferred, and the next one was started.
    MoreWords,
    /// The sensor is deselected; these bytes were received.
    Complete(&'a [u8; BURST_BYTES]),
    /// The sensor is deselected after a failure; the bus is ready.
    Failed,
}

/// The sensor on an SPI peripheral, with its chip select.
pub struct SensorSpi<P, S> {
    peripheral: P,
    pub(super) select: ChipSelect<S>,
    received: &'static mut [u8; BURST_BYTES],
    /// Bytes of the burst whose transfer was started.
    started: usize,
}

impl<P: SpiPeripheral, S: OutputPin<Error = Infallible>> SensorSpi<P, S> {
    /// The bus of a sensor whose `select` is high. It may be made only once.
    pub fn new(peripheral: P, select: S) -> Self {
        let received = cortex_m::singleton!(: [u8; BURST_BYTES] = [0; BURST_BYTES]).expect("the bus is created once");
        Self { peripheral, select: ChipSelect::new(select, BusTiming::USUAL), received, started: 0 }
    }

    fn start_bytes(&mut self) {
        let count = if self.select.timing.word_gap_ns == 0 { BURST_BYTES } else { 2 };
        let from = self.started.min(BURST_BYTES - count);
        self.started += count;
        if let (Some(request), Some(received)) =
            (REQUEST.get(from..from + count), self.received.get_mut(from..from + count))
        {
            compiler_fence(Ordering::SeqCst);
            self.peripheral.start(request, received);
        }
    }

    /// Sets the fastest serial clock of at most `limit_hz`, or the slowest one if none is slow enough; returns it in Hz.
    pub fn set_clock_limit(&mut self, limit_hz: u32) -> u32 {
        self.select.set_clock_limit(limit_hz);
        self.peripheral.drain();
        self.peripheral.set_clock_limit(limit_hz)
    }

    /// Drops what was received, and resets the peripheral.
    pub fn reset(&mut self) {
        self.peripheral.drain();
        self.peripheral.reset();
    }

    /// Selects the sensor and starts a burst. An interrupt follows at its end, or at the end of a word.
    pub fn start_burst(&mut self) {
        self.select.select::<P::Clock>();
        self.started = 0;
        self.start_bytes();
    }

    /// Handles that interrupt.
    pub fn end_burst(&mut self) -> BurstEnd<'_> {
        let complete = self.peripheral.stop();
        compiler_fence(Ordering::SeqCst);
        if complete && self.started < BURST_BYTES {
            wait_ns::<P::Clock>(self.select.timing.word_gap_ns);
            self.start_bytes();
            return BurstEnd::MoreWords;
        }
        if !complete {
            self.peripheral.drain();
        }
        self.select.deselect::<P::Clock>();
        if complete { BurstEnd::Complete(self.received) } else { BurstEnd::Failed }
    }
}

impl<P, S> ErrorType for SensorSpi<P, S> {
    type Error = BusFault;
}

impl<P: SpiPeripheral, S: OutputPin<Error = Infallible>> SpiDevice<u8> for SensorSpi<P, S> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusFault> {
        let done = transfer::<P::Clock, _>(&mut self.peripheral, &mut self.select, operations);
        if done.is_err() {
            self.peripheral.drain();
        }
        done
    }
}
