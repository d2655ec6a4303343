//! The words of which procedures are made: read, write byte by byte, change and verify, poll.

use core::convert::Infallible;

use crate::clock::ClockMode;
use crate::config::Config;
use crate::error::Error;
use crate::port::{Port, Step};
use crate::register::{Access, Register};
use crate::timing::Timing;

/// What can go wrong where there is no bus that could fail.
pub(crate) type Refusal = Error<Infallible>;

/// What the driver remembers between procedures.
#[derive(Clone, Copy, Debug)]
pub(crate) struct State {
    pub(crate) config: Config,
    pub(crate) timing: Timing,
    pub(crate) verify: bool,
    /// The mode that the part is in, as far as known; while it changes, the slower one.
    pub(crate) mode: ClockMode,
    /// Bias of gyro x that is kept here instead of in XGYRO_OFF, in counts of 0.0125 °/s.
    pub(crate) host_bias_x: i16,
    /// XGYRO_OFF as last read or written was negative.
    pub(crate) sign_at_risk: bool,
}

impl State {
    pub(crate) const fn new(config: Config) -> Self {
        let timing = Timing::DEFAULT;
        let mode = timing.clock_mode(config.smpl_prd());
        Self { config, timing, verify: true, mode, host_bias_x: 0, sign_at_risk: false }
    }

    pub(crate) const fn stall_ns(&self) -> u32 {
        self.timing.stall_ns.get(self.mode)
    }
}

/// Which byte of a register is written first; each takes effect on its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    LowerFirst,
    UpperFirst,
}

/// A procedure's access to the part.
pub(crate) struct Session<'a> {
    port: &'a Port,
    pub(crate) state: &'a mut State,
}

impl<'a> Session<'a> {
    pub(crate) fn new(port: &'a Port, state: &'a mut State) -> Self {
        Self { port, state }
    }

    pub(crate) async fn frame(&self, request: [u8; 2]) -> u16 {
        u16::from_be_bytes(self.port.perform(Step::Frame { request, stall_ns: self.state.stall_ns() }).await)
    }

    pub(crate) async fn pause(&self, us: u32) {
        self.port.perform(Step::Pause { us }).await;
    }

    pub(crate) async fn select(&self, ns: u32) {
        self.port.perform(Step::Select { ns }).await;
    }

    /// Two frames: the answer comes in the second, which asks for FLASH_CNT, the one read without any effect.
    pub(crate) async fn read(&self, register: Register) -> u16 {
        self.frame(register.read_frame()).await;
        self.frame(Register::FlashCnt.read_frame()).await
    }

    /// N + 1 frames: each brings the answer to the one before.
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

    /// Checks access, then reads.
    pub(crate) async fn read_register(&self, register: Register) -> Result<u16, Refusal> {
        let [answer] = self.read_registers([register]).await?;
        Ok(answer)
    }

    /// Checks access, then reads all in one go.
    pub(crate) async fn read_registers<const N: usize>(&self, registers: [Register; N]) -> Result<[u16; N], Refusal> {
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

    /// Writes the lower byte, then the upper one if the register has one.
    pub(crate) async fn write_register(&self, register: Register, value: u16) -> Result<(), Refusal> {
        if register.access() == Access::Read {
            return Err(Error::ReadOnly(register));
        }
        self.write_low(register, value).await;
        if register.bits() > 8 {
            self.write_high(register, value).await;
        }
        Ok(())
    }

    /// Gives the bits of `mask` the value that they have in `value`: reads, writes only the bytes that change, and
    /// reads back if the driver verifies.
    pub(crate) async fn update_register(&self, register: Register, mask: u16, value: u16) -> Result<(), Refusal> {
        match register.access() {
            Access::Read => return Err(Error::ReadOnly(register)),
            Access::Write => return Err(Error::WriteOnly(register)),
            Access::ReadWrite => {}
        }
        let before = self.read(register).await;
        self.change(register, before, mask, value, Order::LowerFirst).await
    }

    /// As [`update_register`](Self::update_register), where the register is known to read `before`.
    pub(crate) async fn change(
        &self,
        register: Register,
        before: u16,
        mask: u16,
        value: u16,
        order: Order,
    ) -> Result<(), Refusal> {
        let mask = mask & register.mask();
        let after = (before & !mask | value & mask) & register.mask();
        let different = (before & register.mask()) ^ after;
        if different & 0xFF00 != 0 && order == Order::UpperFirst {
            self.write_high(register, after).await;
        }
        if different & 0x00FF != 0 {
            self.write_low(register, after).await;
        }
        if different & 0xFF00 != 0 && order == Order::LowerFirst {
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

    /// Gives the whole register a value.
    pub(crate) async fn set(&self, register: Register, value: u16) -> Result<(), Refusal> {
        self.update_register(register, u16::MAX, value).await
    }

    /// Reads until the bits of `mask` are clear. True if they were seen set before.
    pub(crate) async fn wait_until_clear(&self, register: Register, mask: u16, most_us: u32) -> Result<bool, Refusal> {
        let mut seen = false;
        let mut waited_us = 0u32;
        loop {
            if self.read(register).await & mask == 0 {
                return Ok(seen);
            }
            seen = true;
            if waited_us >= most_us {
                return Err(Error::Deadline { register, mask, waited_us });
            }
            let step_us = self.state.timing.poll_us.max(1);
            self.pause(step_us).await;
            waited_us = waited_us.saturating_add(step_us);
        }
    }
}
