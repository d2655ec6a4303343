//! The main loop's view of what it shares with interrupts.

use crate::acquisition::Sampler;
use crate::board::{Board, Meters};
use crate::estimators::Estimators;
use crate::outbox::Outbox;
use crate::uptime::Uptime;
use crate::{App, Start};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use heapless::spsc;
use rtic_core::Mutex;

/// Before the first frame after a burst, µs.
const STALL_US: u32 = 16;

/// What differs from one microcontroller to the next.
pub trait Chip {
    /// A counter of microseconds that wraps at 2³².
    fn microseconds(&mut self) -> u32;
    /// Sleeps until an interrupt is pending, and returns before it is served, so that the time can be told.
    ///
    /// The closure is to be called right before and right after, with interrupts held back.
    fn sleep(&mut self, clock: impl FnMut(u32));
    /// Has the serial port look at its queue.
    fn transmit(&mut self);
    /// Feeds the watchdog.
    fn feed(&mut self);
    /// Restarts.
    fn restart(&mut self);
    /// What it measures of itself; the time asleep is not its own.
    fn meters(&mut self) -> Meters;
}

/// What the main loop shares with the interrupts, each behind a lock that holds back no more than those who share it.
pub struct Locks<T, B, S, E, O> {
    /// [`Uptime`], shared with sampling.
    pub uptime: T,
    /// The sensor's bus, shared with sampling.
    pub bus: B,
    /// [`Sampler`], shared with sampling.
    pub sampler: S,
    /// [`Estimators`], shared with the estimating interrupt.
    pub estimators: E,
    /// [`Outbox`], shared with the estimating interrupt.
    pub outbox: O,
}

/// A [`Board`] made of a chip and what it shares with its interrupts.
pub struct Desk<'r, C, T, B, S, E, O> {
    chip: C,
    locks: Locks<T, B, S, E, O>,
    received: &'r mut spsc::Consumer<'static, u8>,
    asleep_us: u64,
    fed: Fed,
}

/// The counter's value when the watchdog was last fed: without a clock nothing that waits would ever end, so nobody feeds
/// it then.
#[derive(Clone, Copy)]
struct Fed(u32);

impl Fed {
    fn feed(&mut self, chip: &mut impl Chip) {
        let now = chip.microseconds();
        if now != self.0 {
            self.0 = now;
            chip.feed();
        }
    }
}

/// The application, for ever.
pub fn run<'r, C, T, B, S, E, O>(
    chip: C,
    locks: Locks<T, B, S, E, O>,
    received: &'r mut spsc::Consumer<'static, u8>,
    start: Start,
) -> !
where
    Desk<'r, C, T, B, S, E, O>: Board,
    C: Chip,
{
    let mut desk = Desk { chip, locks, received, asleep_us: 0, fed: Fed(0) };
    let mut app = App::new(start, &mut desk);
    loop {
        if !app.turn(&mut desk) {
            desk.sleep();
        }
    }
}

impl<C: Chip, T, B, S, E, O> Desk<'_, C, T, B, S, E, O> {
    fn sleep(&mut self) {
        let mut fell_asleep = None;
        let asleep_us = &mut self.asleep_us;
        self.chip.sleep(|now| match fell_asleep {
            None => fell_asleep = Some(now),
            Some(then) => *asleep_us += u64::from(now.wrapping_sub(then)),
        });
    }
}

impl<C, T, B, S, E, O> Board for Desk<'_, C, T, B, S, E, O>
where
    C: Chip,
    T: Mutex<T = Uptime>,
    B: Mutex,
    B::T: SpiDevice<u8>,
    S: Mutex<T = Sampler<'static>>,
    E: Mutex<T = Estimators<'static>>,
    O: Mutex<T = Outbox<'static>>,
{
    type Bus<'a>
        = LockedBus<'a, B>
    where
        Self: 'a;

    type Pause<'a>
        = Pause<'a, C>
    where
        Self: 'a;

    fn now_us(&mut self) -> u64 {
        let chip = &mut self.chip;
        self.locks.uptime.lock(|uptime| uptime.at(chip.microseconds()))
    }

    fn bus(&mut self) -> (Self::Bus<'_>, Self::Pause<'_>) {
        (LockedBus(&mut self.locks.bus), Pause { chip: &mut self.chip, fed: &mut self.fed })
    }

    fn sample(&mut self, on: bool) {
        self.locks.sampler.lock(|sampler| sampler.run(on));
        if !on {
            // A burst takes 0.4 ms at most.
            while self.locks.sampler.lock(|sampler| sampler.is_reading()) {}
            Pause { chip: &mut self.chip, fed: &mut self.fed }.delay_us(STALL_US);
        }
    }

    fn estimators<R>(&mut self, look: impl FnOnce(&mut Estimators<'static>) -> R) -> R {
        self.locks.estimators.lock(look)
    }

    fn outbox<R>(&mut self, send: impl FnOnce(&mut Outbox<'static>) -> R) -> R {
        let sent = self.locks.outbox.lock(send);
        self.chip.transmit();
        sent
    }

    fn received(&mut self) -> Option<u8> {
        self.received.dequeue()
    }

    fn meters(&mut self) -> Meters {
        Meters { asleep_us: self.asleep_us, ..self.chip.meters() }
    }

    fn alive(&mut self) {
        self.fed.feed(&mut self.chip);
    }

    fn restart(&mut self) {
        self.chip.restart();
    }
}

/// Waits by the chip's counter, and keeps the watchdog quiet as long as that counts.
pub struct Pause<'a, C> {
    chip: &'a mut C,
    fed: &'a mut Fed,
}

impl<C: Chip> DelayNs for Pause<'_, C> {
    fn delay_ns(&mut self, ns: u32) {
        self.delay_us(ns.div_ceil(1000));
    }

    fn delay_us(&mut self, us: u32) {
        let start = self.chip.microseconds();
        while self.chip.microseconds().wrapping_sub(start) <= us {
            self.fed.feed(self.chip);
        }
    }
}

/// The shared bus, locked for one transaction at a time.
pub struct LockedBus<'a, B>(&'a mut B);

impl<B: Mutex<T: SpiDevice<u8>>> ErrorType for LockedBus<'_, B> {
    type Error = <B::T as ErrorType>::Error;
}

impl<B: Mutex<T: SpiDevice<u8>>> SpiDevice<u8> for LockedBus<'_, B> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Self::Error> {
        self.0.lock(|bus| bus.transaction(operations))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A counter that stands still for its first readings, and the feedings until then and after.
    #[derive(Default)]
    struct Stopped {
        readings: u32,
        feedings: [u32; 2],
    }

    const STILL: u32 = 10_000;

    impl Chip for Stopped {
        fn microseconds(&mut self) -> u32 {
            self.readings += 1;
            self.readings.saturating_sub(STILL)
        }

        fn feed(&mut self) {
            self.feedings[usize::from(self.readings > STILL)] += 1;
        }

        fn sleep(&mut self, _: impl FnMut(u32)) {}
        fn transmit(&mut self) {}
        fn restart(&mut self) {}
        fn meters(&mut self) -> Meters {
            Meters::default()
        }
    }

    #[test]
    fn without_a_clock_nobody_feeds_the_watchdog() {
        let (mut chip, mut fed) = (Stopped::default(), Fed(0));
        Pause { chip: &mut chip, fed: &mut fed }.delay_us(50);
        let [still, going] = chip.feedings;
        assert_eq!(still, 0);
        assert!(going > 20, "{going} times in 50 us");
    }
}
