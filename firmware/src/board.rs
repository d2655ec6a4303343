//! What a board lends the application.

use crate::estimators::Estimators;
use crate::outbox::Outbox;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;

/// The board as the main loop sees it; a [`Desk`](crate::Desk) over a microcontroller, or over a virtual sensor on the
/// host.
pub trait Board {
    /// The sensor's bus, for registers, while it is not sampled.
    type Bus<'a>: SpiDevice<u8>
    where
        Self: 'a;
    /// Pauses between frames, long ones too.
    type Pause<'a>: DelayNs
    where
        Self: 'a;

    /// Time since the start in microseconds.
    fn now_us(&mut self) -> u64;
    /// The bus, and what waits between frames. Nothing must be sent while the sensor is sampled.
    fn bus(&mut self) -> (Self::Bus<'_>, Self::Pause<'_>);
    /// Starts or stops sampling; when it has returned after a stop, no burst is under way and the sensor's stall is over.
    fn sample(&mut self, on: bool);
    /// The estimators, which rest meanwhile: it must not take long.
    fn estimators<R>(&mut self, look: impl FnOnce(&mut Estimators<'static>) -> R) -> R;
    /// The way out. Only what was queued is guaranteed to leave.
    fn outbox<R>(&mut self, send: impl FnOnce(&mut Outbox<'static>) -> R) -> R;
    /// The next byte that a person or a program sent.
    fn received(&mut self) -> Option<u8>;
    /// What the board measures of itself.
    fn meters(&mut self) -> Meters;
    /// Feeds the watchdog: the main loop is alive.
    fn alive(&mut self);
    /// Restarts the microcontroller; memory is retained.
    fn restart(&mut self);
}

/// What a board measures of itself, since it started.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Meters {
    /// Time that the processor slept, in microseconds.
    pub asleep_us: u64,
    /// Bytes that came faster than they were read.
    pub serial_overruns: u32,
    /// Longest sampling interrupt in processor cycles.
    pub sampling_cycles: u32,
    /// Longest turn of the estimators in processor cycles, interruptions included.
    pub estimator_cycles: u32,
    /// Most bytes of stack ever used.
    pub stack_bytes: u32,
    /// Bytes of stack that there are.
    pub stack_size: u32,
}
