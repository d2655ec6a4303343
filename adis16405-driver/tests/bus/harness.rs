//! A mock bus that checks every byte and every pause, and the same call through the blocking and the asynchronous
//! driver.

use embedded_hal_mock::eh1::spi::Transaction;

/// Default stall in normal mode.
pub(crate) const STALL_NS: u32 = 16_000;

pub(crate) type Frames = Vec<Transaction<u8>>;

pub(crate) fn frame_with(stall_ns: u32, sent: &[u8], answer: &[u8]) -> Frames {
    vec![
        Transaction::transaction_start(),
        Transaction::transfer(sent.to_vec(), answer.to_vec()),
        Transaction::delay(stall_ns),
        Transaction::transaction_end(),
    ]
}

pub(crate) fn frame(sent: [u8; 2], answer: u16) -> Frames {
    frame_with(STALL_NS, &sent, &answer.to_be_bytes())
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

/// The frames of an `init` on a part that is already configured.
pub(crate) fn init(smpl_prd: u16, sens_avg: u16) -> Frames {
    [read(0x56, 16405), read(0x36, smpl_prd), read(0x38, sens_avg), gyro_offsets(0, 0, 0)].concat()
}

#[cfg(feature = "async")]
pub(crate) fn block_on<T>(future: impl Future<Output = T>) -> T {
    use std::task::{Context, Poll, Waker};
    match std::pin::pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(output) => output,
        Poll::Pending => panic!("a mock is never pending"),
    }
}

/// `both!(config; frames; pauses in µs; |imu, delay| call)`: makes the call on the blocking and on the asynchronous
/// driver and returns its result, which must be the same. The bus must see exactly these frames, the delay these
/// pauses. `with` sets options of the driver.
macro_rules! both {
    ($config:expr; $frames:expr; $pauses:expr; |$imu:ident, $delay:ident| $call:expr) => {
        both!($config, with []; $frames; $pauses; |$imu, $delay| $call)
    };
    ($config:expr, with [$($change:tt)*]; $frames:expr; $pauses:expr; |$imu:ident, $delay:ident| $call:expr) => {{
        use embedded_hal_mock::eh1::{delay, spi};
        let frames: Vec<spi::Transaction<u8>> = $frames.into_iter().flatten().collect();
        let pauses: Vec<_> = $pauses.into_iter().map(|us: u32| delay::Transaction::delay_us(us)).collect();

        let mut $imu = adis16405_driver::Adis16405::new(spi::Mock::new(&frames), $config)$($change)*;
        #[allow(unused_mut)]
        let mut $delay = delay::CheckedDelay::new(&pauses);
        let blocking = $call;
        $imu.release().done();
        $delay.done();

        #[cfg(feature = "async")]
        {
            let mut $imu = adis16405_driver::Adis16405::new_async(spi::Mock::new(&frames), $config)$($change)*;
            #[allow(unused_mut)]
            let mut $delay = delay::CheckedDelay::new(&pauses);
            let asynchronous = crate::harness::block_on(async { $call.await });
            $imu.release().done();
            $delay.done();
            assert_eq!(asynchronous, blocking, "the blocking and the asynchronous driver differ");
        }
        blocking
    }};
}

/// No pauses, for methods without a delay.
pub(crate) const NONE: [u32; 0] = [];
