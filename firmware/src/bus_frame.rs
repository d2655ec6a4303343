//! Frames on the sensor's bus: the timing of chip select, and the operations between its edges.

use crate::board::{BusTiming, FrameTimes};
use crate::sensor::LOW_POWER_LIMIT_HZ;
use core::convert::Infallible;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{self, Operation};

/// The microsecond counter of a microcontroller.
pub trait MicrosecondCounter {
    /// The counter's value, which wraps at 2³².
    fn counter() -> u32;
}

/// The reason for which a register access over the bus failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BusFault {
    /// The SPI peripheral did not transfer a byte in ten times the time that it takes.
    Timeout,
    /// A received byte was lost.
    Overrun,
}

impl spi::Error for BusFault {
    fn kind(&self) -> spi::ErrorKind {
        match self {
            Self::Timeout => spi::ErrorKind::Other,
            Self::Overrun => spi::ErrorKind::Overrun,
        }
    }
}

/// Readings of a flag before [`wait_for`] gives up: 0.4 ms at 168 MHz; a byte takes 49 µs at the slowest clock.
const READINGS: u32 = 25_000;

/// Waits for a flag; false if it is not set after [`READINGS`] readings.
pub(crate) fn wait_for(mut flag: impl FnMut() -> bool) -> bool {
    (0..READINGS).any(|_| flag())
}

pub(crate) fn flag_in_time(flag: impl FnMut() -> bool) -> Result<(), BusFault> {
    if wait_for(flag) { Ok(()) } else { Err(BusFault::Timeout) }
}

/// Waits for at least `ns`; the wait is bounded even if the counter stands still.
pub(crate) fn wait_ns<M: MicrosecondCounter>(ns: u32) {
    if ns > 0 {
        let (start, us) = (M::counter(), ns.div_ceil(1000));
        // A reading takes at least three cycles of 6 ns.
        let readings = us.saturating_mul(64).saturating_add(64);
        let _elapsed = (0..readings).any(|_| M::counter().wrapping_sub(start) > us);
    }
}

/// Exchanges single bytes with the sensor, without chip select.
pub trait ByteExchange {
    /// Sends a byte and returns the one received meanwhile.
    fn exchange(&mut self, byte: u8) -> Result<u8, BusFault>;
    /// Waits until the last clock period of the last byte has ended.
    fn finish(&mut self) -> Result<(), BusFault>;
}

/// The chip-select pin, active low, with minimum times high and between falling edges.
pub(crate) struct ChipSelect<S> {
    pin: S,
    pub(crate) timing: BusTiming,
    low_power: bool,
    /// Counter values at the last falling and rising edge.
    fallen_at: u32,
    risen_at: u32,
    times: FrameTimes,
}

impl<S: OutputPin<Error = Infallible>> ChipSelect<S> {
    pub(crate) fn new(pin: S, timing: BusTiming) -> Self {
        Self { pin, timing, low_power: true, fallen_at: 0, risen_at: 0, times: FrameTimes::NONE }
    }

    pub(crate) fn set_clock_limit(&mut self, limit_hz: u32) {
        self.low_power = limit_hz <= LOW_POWER_LIMIT_HZ;
    }

    pub(crate) fn select<M: MicrosecondCounter>(&mut self) {
        let times = if self.low_power { self.timing.low_power } else { self.timing.normal };
        let now = M::counter();
        let rest_ns = |since: u32, least_ns: u32| {
            // A difference of two readings may be almost 1 µs too long.
            let elapsed_us = now.wrapping_sub(since).saturating_sub(1);
            least_ns.saturating_sub(elapsed_us.saturating_mul(1000))
        };
        wait_ns::<M>(rest_ns(self.risen_at, times.high_ns).max(rest_ns(self.fallen_at, times.read_ns)));
        let Ok(()) = self.pin.set_low();
        let now = M::counter();
        let times = &mut self.times;
        times.shortest_high_us = times.shortest_high_us.min(now.wrapping_sub(self.risen_at));
        times.shortest_period_us = times.shortest_period_us.min(now.wrapping_sub(self.fallen_at));
        self.fallen_at = now;
    }

    pub(crate) fn deselect<M: MicrosecondCounter>(&mut self) {
        let Ok(()) = self.pin.set_high();
        self.risen_at = M::counter();
        self.times.low_us = self.risen_at.wrapping_sub(self.fallen_at);
    }

    pub(crate) fn take_times(&mut self) -> FrameTimes {
        let low_us = self.times.low_us;
        core::mem::replace(&mut self.times, FrameTimes { low_us, ..FrameTimes::NONE })
    }
}

/// Performs the operations of a frame. A frame with only a delay wakes a sleeping sensor.
pub(crate) fn transfer<M: MicrosecondCounter, S: OutputPin<Error = Infallible>>(
    bytes: &mut impl ByteExchange,
    select: &mut ChipSelect<S>,
    operations: &mut [Operation<'_, u8>],
) -> Result<(), BusFault> {
    select.select::<M>();
    let done = operations.iter_mut().try_for_each(|operation| perform::<M>(bytes, operation));
    let done = done.and_then(|()| bytes.finish());
    select.deselect::<M>();
    done
}

fn perform<M: MicrosecondCounter>(
    bytes: &mut impl ByteExchange,
    operation: &mut Operation<'_, u8>,
) -> Result<(), BusFault> {
    match operation {
        Operation::Read(read) => {
            read.iter_mut().try_for_each(|byte| bytes.exchange(0).map(|received| *byte = received))
        }
        Operation::Write(write) => write.iter().try_for_each(|&byte| bytes.exchange(byte).map(|_| ())),
        Operation::Transfer(read, write) => (0..read.len().max(write.len())).try_for_each(|index| {
            let received = bytes.exchange(write.get(index).copied().unwrap_or(0))?;
            if let Some(byte) = read.get_mut(index) {
                *byte = received;
            }
            Ok(())
        }),
        Operation::TransferInPlace(words) => {
            words.iter_mut().try_for_each(|byte| bytes.exchange(*byte).map(|received| *byte = received))
        }
        Operation::DelayNs(ns) => {
            wait_ns::<M>(*ns);
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::cell::{Cell, RefCell};
    use std::vec::Vec;

    std::thread_local! {
        static COUNTER: Cell<u32> = const { Cell::new(u32::MAX - 300) };
        static EDGES: RefCell<Vec<(u32, bool)>> = const { RefCell::new(Vec::new()) };
    }

    struct Clock;

    impl MicrosecondCounter for Clock {
        fn counter() -> u32 {
            COUNTER.set(COUNTER.get().wrapping_add(1));
            COUNTER.get()
        }
    }

    struct Pin;

    impl embedded_hal::digital::ErrorType for Pin {
        type Error = Infallible;
    }

    impl OutputPin for Pin {
        fn set_low(&mut self) -> Result<(), Infallible> {
            EDGES.with_borrow_mut(|edges| edges.push((COUNTER.get(), false)));
            Ok(())
        }

        fn set_high(&mut self) -> Result<(), Infallible> {
            EDGES.with_borrow_mut(|edges| edges.push((COUNTER.get(), true)));
            Ok(())
        }
    }

    /// A bus on which each byte takes this many µs and is echoed.
    struct Bytes(u32);

    impl ByteExchange for Bytes {
        fn exchange(&mut self, byte: u8) -> Result<u8, BusFault> {
            COUNTER.set(COUNTER.get().wrapping_add(self.0));
            Ok(byte)
        }

        fn finish(&mut self) -> Result<(), BusFault> {
            Ok(())
        }
    }

    /// The low time of chip select and the period of its falling edges, for each frame.
    fn frames() -> Vec<(u32, u32)> {
        let edges = EDGES.take();
        let fallen: Vec<u32> = edges.iter().step_by(2).map(|&(at, _)| at).collect();
        assert!(edges.iter().enumerate().all(|(k, &(_, high))| high == (k % 2 == 1)), "{edges:?}");
        let before = fallen.iter().zip(fallen.iter().skip(1)).map(|(a, b)| b.wrapping_sub(*a));
        edges.chunks(2).map(|pair| pair[1].0.wrapping_sub(pair[0].0)).zip([0].into_iter().chain(before)).collect()
    }

    /// The waking pulse of 20 µs (data sheet Rev. B, Table 1) requires that chip select is low.
    #[test]
    fn a_delay_is_kept_while_chip_select_is_low() {
        let mut select = ChipSelect::new(Pin, BusTiming::USUAL);
        let pulse = |select: &mut ChipSelect<Pin>| {
            transfer::<Clock, _>(&mut Bytes(1), select, &mut [Operation::DelayNs(20_000)])
        };
        assert_eq!((pulse(&mut select), pulse(&mut select)), (Ok(()), Ok(())));
        for (low_us, _) in frames() {
            assert!((20..30).contains(&low_us), "{low_us} us");
        }
    }

    /// The read rate is 40 µs, or 150 µs in low-power mode (data sheet Rev. B, Table 2); a frame takes 8 µs at 2 MHz,
    /// 54 µs at 297 kHz.
    #[test]
    fn frames_keep_the_read_rate_at_every_serial_clock() {
        for (limit_hz, byte_us, least_us) in
            [(2_000_000, 4, 40), (1_000_000, 8, 40), (300_000, 27, 150), (300_000, 60, 150)]
        {
            let mut select = ChipSelect::new(Pin, BusTiming::USUAL);
            select.set_clock_limit(limit_hz);
            for byte in 0..4 {
                let mut answer = [0; 2];
                let mut frame = [Operation::Transfer(&mut answer, &[byte, 7])];
                assert_eq!(transfer::<Clock, _>(&mut Bytes(byte_us), &mut select, &mut frame), Ok(()));
                assert_eq!(answer, [byte, 7]);
            }
            let frames = frames();
            // The limit allows a stall of 16 or 75 µs and readings of the counter.
            let most_us = (least_us + 10).max(2 * byte_us + 85);
            for &(_, period_us) in &frames[1..] {
                assert!((least_us..most_us).contains(&period_us), "{limit_hz} Hz: {frames:?}");
            }
        }
    }
}
