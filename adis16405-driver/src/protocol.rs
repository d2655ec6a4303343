//! The SPI protocol without I/O.
//!
//! A procedure is an `async fn` on [`Protocol`] that awaits only responses to [`BusRequest`]s, which either driver
//! carries out: every sequence of frames exists once.

use core::convert::Infallible;
use core::future::poll_fn;
use core::pin::Pin;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use core::task::{Context, Poll, Waker};

use crate::clock::{ClockMode, Timing};
use crate::config::Config;
use crate::error::Error;
use crate::register::{Access, Register};
use crate::spacing::FramePauses;

/// An operation that a procedure requests from the driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BusRequest {
    /// Exchange a 16-bit frame in a transaction of its own.
    Frame { bytes: [u8; 2], pauses: FramePauses },
    /// Hold chip select low, and then high, without clocking.
    ChipSelectPulse { pauses: FramePauses },
    /// Wait for `us` without bus traffic.
    Pause { us: u32 },
}

/// Passes requests from a procedure to the driver, and responses back; atomic, so that the futures are `Send`.
#[derive(Debug)]
pub(crate) struct RequestSlot {
    /// The two bytes of a frame, or [`PAUSE`](Self::PAUSE), or [`CHIP_SELECT_PULSE`](Self::CHIP_SELECT_PULSE).
    request: AtomicU32,
    /// Time of chip select low in ns, or pause in µs.
    time: AtomicU32,
    /// Time of chip select high in ns.
    high_ns: AtomicU32,
    /// The two bytes received, or [`NO_RESPONSE`](Self::NO_RESPONSE).
    response: AtomicU32,
}

impl RequestSlot {
    const PAUSE: u32 = 1 << 16;
    const CHIP_SELECT_PULSE: u32 = 2 << 16;
    const NO_RESPONSE: u32 = 1 << 16;

    pub(crate) const fn new() -> Self {
        Self {
            request: AtomicU32::new(Self::PAUSE),
            time: AtomicU32::new(0),
            high_ns: AtomicU32::new(0),
            response: AtomicU32::new(Self::NO_RESPONSE),
        }
    }

    /// Called by a procedure: places a request and waits for its response.
    async fn request(&self, request: BusRequest) -> [u8; 2] {
        let (request, FramePauses { low_ns: time, high_ns }) = match request {
            BusRequest::Frame { bytes, pauses } => (u32::from(u16::from_be_bytes(bytes)), pauses),
            BusRequest::ChipSelectPulse { pauses } => (Self::CHIP_SELECT_PULSE, pauses),
            BusRequest::Pause { us } => (Self::PAUSE, FramePauses { low_ns: us, high_ns: 0 }),
        };
        self.request.store(request, Relaxed);
        self.time.store(time, Relaxed);
        self.high_ns.store(high_ns, Relaxed);
        poll_fn(|_| match self.response.load(Relaxed) {
            Self::NO_RESPONSE => Poll::Pending,
            response => {
                self.response.store(Self::NO_RESPONSE, Relaxed);
                Poll::Ready((response as u16).to_be_bytes())
            }
        })
        .await
    }

    /// Called by the driver: the request that the procedure has placed.
    pub(crate) fn placed(&self) -> BusRequest {
        let time = self.time.load(Relaxed);
        let pauses = FramePauses { low_ns: time, high_ns: self.high_ns.load(Relaxed) };
        match self.request.load(Relaxed) {
            Self::PAUSE => BusRequest::Pause { us: time },
            Self::CHIP_SELECT_PULSE => BusRequest::ChipSelectPulse { pauses },
            bytes => BusRequest::Frame { bytes: (bytes as u16).to_be_bytes(), pauses },
        }
    }

    /// Called by the driver: the two bytes that the part sent during a frame, or zeros for other requests.
    pub(crate) fn respond(&self, response: [u8; 2]) {
        self.response.store(u32::from(u16::from_be_bytes(response)), Relaxed);
    }
}

/// Runs a procedure to its end (`Ready`) or up to its next request, which is then in its slot (`Pending`).
pub(crate) fn resume<T>(procedure: Pin<&mut impl Future<Output = T>>) -> Poll<T> {
    // The waker is never used: a procedure can go on only after respond().
    procedure.poll(&mut Context::from_waker(Waker::noop()))
}

/// The error of a procedure, which has no bus that could fail.
pub(crate) type ProtocolError = Error<Infallible>;

/// State of the driver between procedures.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DriverState {
    pub(crate) config: Config,
    pub(crate) timing: Timing,
    /// True if changed registers are read back and compared.
    pub(crate) verify: bool,
    /// The power mode of the part: low-power mode, with the longer stall, while it is unknown or changes.
    pub(crate) mode: ClockMode,
    /// Bias correction of gyro x that the driver adds instead of XGYRO_OFF, in counts of 0.0125 °/s.
    pub(crate) host_bias_x: i16,
    /// True if XGYRO_OFF was negative when it was last read or written.
    pub(crate) x_sign_at_risk: bool,
    /// True from the moment before a stimulus of the manual self-test is switched on until it is known to be off.
    pub(crate) stimulated: bool,
    /// True if the part is known to have `config`.
    pub(crate) configured: bool,
    /// A further answer of PROD_ID that is taken for an ADIS16405.
    pub(crate) prod_id: Option<u16>,
}

impl DriverState {
    pub(crate) const fn new(config: Config) -> Self {
        let timing = Timing::DEFAULT;
        let mode = timing.clock_mode(config.smpl_prd());
        Self {
            config,
            timing,
            verify: true,
            mode,
            host_bias_x: 0,
            x_sign_at_risk: false,
            configured: false,
            stimulated: false,
            prod_id: None,
        }
    }

    /// The part has loaded its registers from flash: until they are read, neither configuration nor power mode is known.
    pub(crate) const fn mark_registers_unknown(&mut self) {
        self.configured = false;
        self.mode = ClockMode::LowPower;
    }

    /// Assumes low-power mode unless configured: flash or an earlier start may have selected it.
    pub(crate) const fn assume_low_power_until_read(&mut self) {
        if !self.configured {
            self.mode = ClockMode::LowPower;
        }
    }

    #[inline(never)]
    pub(crate) fn frame_pauses(&self) -> FramePauses {
        let timing = &self.timing;
        FramePauses::new(timing.stall_select, timing.frame_stall_ns(self.mode), timing.select_high_ns)
    }

    /// The pauses after a burst in the present power mode. A burst takes longer than the least time between frames.
    pub(crate) fn burst_pauses(&self) -> FramePauses {
        let timing = &self.timing;
        FramePauses::new(timing.stall_select, timing.stall_ns.get(self.mode), timing.select_high_ns)
    }
}

/// The byte of a register that is written first; each takes effect at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WriteOrder {
    LowByteFirst,
    HighByteFirst,
}

/// The procedures of the part. This module has those on registers; the modules of the part's functions add theirs.
pub(crate) struct Protocol<'a> {
    slot: &'a RequestSlot,
    pub(crate) state: &'a mut DriverState,
}

impl<'a> Protocol<'a> {
    pub(crate) fn new(slot: &'a RequestSlot, state: &'a mut DriverState) -> Self {
        Self { slot, state }
    }

    /// Sends a frame and returns the 16 bits received during it: the answer to the frame before.
    async fn frame(&self, bytes: [u8; 2]) -> u16 {
        u16::from_be_bytes(self.slot.request(BusRequest::Frame { bytes, pauses: self.state.frame_pauses() }).await)
    }

    pub(crate) async fn pause(&self, us: u32) {
        self.slot.request(BusRequest::Pause { us }).await;
    }

    pub(crate) async fn chip_select_pulse(&self, ns: u32) {
        let pauses = FramePauses { low_ns: ns, high_ns: self.state.timing.select_high_ns };
        self.slot.request(BusRequest::ChipSelectPulse { pauses }).await;
    }

    /// Reads a register in two frames; the second requests FLASH_CNT, which has no side effects.
    pub(crate) async fn read(&self, register: Register) -> u16 {
        self.frame(register.read_frame()).await;
        self.frame(Register::FlashCnt.read_frame()).await
    }

    /// Reads N registers in N + 1 frames: each frame brings the answer to the one before.
    pub(crate) async fn read_all<const N: usize>(&self, registers: [Register; N]) -> [u16; N] {
        let mut answers = [0; N];
        if let Some(first) = registers.first() {
            self.frame(first.read_frame()).await;
        }
        for (index, answer) in answers.iter_mut().enumerate() {
            let next = registers.get(index + 1).copied().unwrap_or(Register::FlashCnt);
            *answer = self.frame(next.read_frame()).await;
        }
        answers
    }

    pub(crate) async fn read_register(&self, register: Register) -> Result<u16, ProtocolError> {
        let [answer] = self.read_registers([register]).await?;
        Ok(answer)
    }

    pub(crate) async fn read_registers<const N: usize>(
        &self,
        registers: [Register; N],
    ) -> Result<[u16; N], ProtocolError> {
        match registers.into_iter().find(|register| register.access() == Access::Write) {
            Some(register) => Err(Error::WriteOnly(register)),
            None => Ok(self.read_all(registers).await),
        }
    }

    pub(crate) async fn write_low(&self, register: Register, value: u16) {
        self.frame(register.write_low_frame(value)).await;
    }

    pub(crate) async fn write_high(&self, register: Register, value: u16) {
        self.frame(register.write_high_frame(value)).await;
    }

    /// Writes the lower byte, then the upper one if the register is wider than 8 bits.
    pub(crate) async fn write_register(&self, register: Register, value: u16) -> Result<(), ProtocolError> {
        if register.access() == Access::Read {
            return Err(Error::ReadOnly(register));
        }
        self.write_low(register, value).await;
        if register.bits() > 8 {
            self.write_high(register, value).await;
        }
        Ok(())
    }

    /// Sets the bits of `mask`: reads, writes changed bytes, and reads back if verification is on.
    pub(crate) async fn update_register(&self, register: Register, mask: u16, value: u16) -> Result<(), ProtocolError> {
        match register.access() {
            Access::Read => return Err(Error::ReadOnly(register)),
            Access::Write => return Err(Error::WriteOnly(register)),
            Access::ReadWrite => {}
        }
        let before = self.read(register).await;
        self.update_from(register, before, mask, value, WriteOrder::LowByteFirst).await
    }

    /// Sets the bits of `mask` in a register that was just read as `before`.
    pub(crate) async fn update_from(
        &self,
        register: Register,
        before: u16,
        mask: u16,
        value: u16,
        order: WriteOrder,
    ) -> Result<(), ProtocolError> {
        let mask = mask & register.mask();
        let after = (before & !mask | value & mask) & register.mask();
        let different = (before & register.mask()) ^ after;
        if different & 0xFF00 != 0 && order == WriteOrder::HighByteFirst {
            self.write_high(register, after).await;
        }
        // A written upper byte may have changed the lower one: see `configure`.
        let may_have_changed = order == WriteOrder::HighByteFirst && different & 0xFF00 != 0;
        if different & 0x00FF != 0 || may_have_changed {
            self.write_low(register, after).await;
        }
        if different & 0xFF00 != 0 && order == WriteOrder::LowByteFirst {
            self.write_high(register, after).await;
        }
        if different != 0 && self.state.verify {
            let expected = value & mask;
            let answer = self.read(register).await & mask;
            if answer != expected {
                return Err(Error::Verify { register, expected, answer });
            }
        }
        Ok(())
    }

    pub(crate) async fn set_register(&self, register: Register, value: u16) -> Result<(), ProtocolError> {
        self.update_register(register, u16::MAX, value).await
    }

    /// Polls until the bits of `mask` are clear. True if a poll saw them set; [`Error::Deadline`] after `most_us`.
    pub(crate) async fn wait_until_clear(
        &self,
        register: Register,
        mask: u16,
        most_us: u32,
    ) -> Result<bool, ProtocolError> {
        let mut was_set = false;
        let mut waited_us = 0u32;
        loop {
            if self.read(register).await & mask == 0 {
                return Ok(was_set);
            }
            was_set = true;
            if waited_us >= most_us {
                return Err(Error::Deadline { register, mask, waited_us });
            }
            let step_us = self.state.timing.poll_us.max(1);
            self.pause(step_us).await;
            waited_us = waited_us.saturating_add(step_us);
        }
    }
}
