//! A mock bus that checks every byte, every pause and the level of chip select during it, and the same call through the blocking and the asynchronous
//! driver.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

/// Default stall after a frame in normal mode: 16 periods of the fastest SCK, 2 MHz, take 8 µs of the 40 µs from one frame
/// to the next (data sheet Rev. B, Table 2).
pub(crate) const STALL_NS: u32 = 32_000;
/// Default stall after a burst in normal mode.
pub(crate) const BURST_STALL_NS: u32 = 16_000;
/// The same after a frame in low-power mode: 16 periods of 300 kHz take 53.3 µs of 150 µs.
pub(crate) const SLOW_STALL_NS: u32 = 96_667;

/// Longest delay that every HAL can keep: with cycles in 32 bits 25 s at 168 MHz.
const LONGEST_DELAY_US: u32 = 1_000_000;

/// The driver as the part and a stop watch see it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// Chip select falls.
    Select,
    /// Bytes sent, and the answer.
    Exchange { sent: Vec<u8>, answer: Vec<u8> },
    /// A delay in ns, with chip select low or high.
    Delay(u32),
    /// Chip select rises.
    Deselect,
}

pub(crate) type Frames = Vec<Step>;

/// A transaction of one transfer, and a stall after it with chip select high.
pub(crate) fn frame_with(stall_ns: u32, sent: &[u8], answer: &[u8]) -> Frames {
    let exchange = Step::Exchange { sent: sent.to_vec(), answer: answer.to_vec() };
    vec![Step::Select, exchange, Step::Deselect, Step::Delay(stall_ns)]
}

pub(crate) fn frame(sent: [u8; 2], answer: u16) -> Frames {
    frame_with(STALL_NS, &sent, &answer.to_be_bytes())
}

/// Steps on the bus that the driver still has to do, and pauses in µs between them.
#[derive(Clone)]
pub(crate) struct Bench(Rc<RefCell<(VecDeque<Step>, VecDeque<u32>)>>);

impl Bench {
    pub(crate) fn new(steps: impl IntoIterator<Item = Step>, pauses_us: impl IntoIterator<Item = u32>) -> Self {
        Self(Rc::new(RefCell::new((steps.into_iter().collect(), pauses_us.into_iter().collect()))))
    }

    fn step(&self) -> Option<Step> {
        self.0.borrow_mut().0.pop_front()
    }

    /// The driver has done all.
    pub(crate) fn done(&self) {
        assert_eq!(*self.0.borrow(), (VecDeque::new(), VecDeque::new()), "not done");
    }
}

impl ErrorType for Bench {
    type Error = Infallible;
}

impl SpiDevice for Bench {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        assert_eq!(self.step(), Some(Step::Select));
        for operation in operations {
            match (self.step(), operation) {
                (Some(Step::Exchange { sent, answer }), Operation::Transfer(read, write)) => {
                    assert_eq!(write, &sent);
                    read.copy_from_slice(&answer);
                }
                (Some(Step::Delay(expected)), Operation::DelayNs(ns)) => assert_eq!(*ns, expected),
                (expected, operation) => panic!("{operation:?} instead of {expected:?}"),
            }
        }
        assert_eq!(self.step(), Some(Step::Deselect));
        Ok(())
    }
}

impl DelayNs for Bench {
    fn delay_ns(&mut self, ns: u32) {
        assert_eq!(self.step(), Some(Step::Delay(ns)), "with chip select high");
    }

    /// A part of the next pause, or all of it.
    fn delay_us(&mut self, us: u32) {
        assert!(us <= LONGEST_DELAY_US, "a delay of {us} us");
        let mut bench = self.0.borrow_mut();
        let pause_us = bench.1.front_mut().expect("a pause");
        *pause_us = pause_us.checked_sub(us).expect("no longer than the pause");
        if *pause_us == 0 {
            bench.1.pop_front();
        }
    }
}

#[cfg(feature = "async")]
impl embedded_hal_async::spi::SpiDevice for Bench {
    async fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        SpiDevice::transaction(self, operations)
    }
}

#[cfg(feature = "async")]
impl embedded_hal_async::delay::DelayNs for Bench {
    async fn delay_ns(&mut self, ns: u32) {
        DelayNs::delay_ns(self, ns);
    }

    async fn delay_us(&mut self, us: u32) {
        DelayNs::delay_us(self, us);
    }
}

/// The answer of the part where the data sheet defines none.
const UNDEFINED: u16 = 0xA55A;

/// A read: the address, then 0x0000, during which the answer comes.
pub(crate) fn read(address: u8, answer: u16) -> Frames {
    [frame([address, 0], UNDEFINED), frame([0, 0], answer)].concat()
}

/// Overlapping reads: each frame brings the answer to the one before.
pub(crate) fn read_all(reads: &[(u8, u16)]) -> Frames {
    let asked = reads.iter().map(|read| read.0).chain([0]);
    let answers = [UNDEFINED].into_iter().chain(reads.iter().map(|read| read.1));
    asked.zip(answers).flat_map(|(address, answer)| frame([address, 0], answer)).collect()
}

/// A write of one byte: bit 15, the address of the byte, the byte.
pub(crate) fn write(address: u8, byte: u8) -> Frames {
    frame([0x80 | address, byte], UNDEFINED)
}

/// The last reads of an `init`: XGYRO_OFF, YGYRO_OFF, ZGYRO_OFF.
pub(crate) fn gyro_offsets(x: u16, y: u16, z: u16) -> Frames {
    read_all(&[(0x1A, x), (0x1C, y), (0x1E, z)])
}

/// The same frames with the stall of low-power mode.
pub(crate) fn slow(frames: Frames) -> Frames {
    let slower = |step| if step == Step::Delay(STALL_NS) { Step::Delay(SLOW_STALL_NS) } else { step };
    frames.into_iter().map(slower).collect()
}

/// The frames of an `init` on a part that is already configured, but not by this driver: until SMPL_PRD was read, the stall is
/// that of low-power mode.
pub(crate) fn init(smpl_prd: u16, sens_avg: u16) -> Frames {
    let known = [read(0x38, sens_avg), gyro_offsets(0, 0, 0)].concat();
    [slow([read(0x56, 16405), read(0x36, smpl_prd)].concat()), known].concat()
}

#[cfg(feature = "async")]
pub(crate) fn block_on<T>(future: impl Future<Output = T>) -> T {
    use std::task::{Context, Poll, Waker};
    match std::pin::pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(output) => output,
        Poll::Pending => panic!("a mock is never pending"),
    }
}

/// `both!(config; frames; pauses in µs; |imu| call)`: makes the call on the blocking and on the asynchronous driver and
/// returns its result, which must be the same. The bus must see exactly these frames and stalls, the delay these pauses.
/// `with` sets options of the driver.
macro_rules! both {
    ($config:expr; $frames:expr; $pauses:expr; |$imu:ident| $call:expr) => {
        both!($config, with []; $frames; $pauses; |$imu| $call)
    };
    ($config:expr, with [$($change:tt)*]; $frames:expr; $pauses:expr; |$imu:ident| $call:expr) => {{
        let frames: Vec<crate::bus::harness::Step> = $frames.into_iter().flatten().collect();
        let pauses: Vec<u32> = $pauses.into_iter().collect();

        let bench = crate::bus::harness::Bench::new(frames.clone(), pauses.clone());
        #[allow(unused_mut)]
        let mut $imu = adis16405_driver::Adis16405::new(bench.clone(), bench.clone(), $config)$($change)*;
        let blocking = $call;
        bench.done();

        #[cfg(feature = "async")]
        {
            let bench = crate::bus::harness::Bench::new(frames, pauses);
            let mut $imu = adis16405_driver::Adis16405::new_async(bench.clone(), bench.clone(), $config)$($change)*;
            let asynchronous = crate::bus::harness::block_on(async { $call.await });
            bench.done();
            assert_eq!(asynchronous, blocking, "the blocking and the asynchronous driver differ");
        }
        blocking
    }};
}

/// No pauses.
pub(crate) const NONE: [u32; 0] = [];
