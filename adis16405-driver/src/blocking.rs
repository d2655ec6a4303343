//! The driver over a blocking [`SpiDevice`].

use embedded_hal::spi::{Operation, SpiDevice};

use crate::config::{ClockMode, Config};
use crate::error::Error;
use crate::frame::{BURST_BYTES, BURST_REQUEST, Burst};
use crate::register::{Access, Register};

/// Default stall after a frame in normal mode, as Analog Devices' evaluation tool has it. The part needs 9 µs.
const STALL_NORMAL_NS: u32 = 16_000;
/// Default stall after a frame in low-power mode; no source at hand confirms it.
const STALL_LOW_POWER_NS: u32 = 75_000;

const PRODUCTS: [u16; 2] = [16405, 16400];

/// An ADIS16405 or ADIS16400 on an SPI bus.
///
/// Every 16-bit frame is a transaction of its own, so chip select is high between frames; the stall is part of the
/// transaction, after the frame. The device must therefore support [`Operation::DelayNs`].
#[derive(Debug)]
pub struct Adis16405<SPI> {
    spi: SPI,
    config: Config,
    stall_ns: u32,
}

impl<SPI: SpiDevice<u8>> Adis16405<SPI> {
    /// Takes the bus; nothing is sent before [`init`](Self::init). The stall is 16 µs, or 75 µs if the sample period
    /// puts the part into low-power mode.
    pub fn new(spi: SPI, config: Config) -> Self {
        let stall_ns = match config.sample_period().clock_mode() {
            ClockMode::Normal => STALL_NORMAL_NS,
            ClockMode::LowPower => STALL_LOW_POWER_NS,
        };
        Self { spi, config, stall_ns }
    }

    /// Sets the pause after each frame in ns.
    #[must_use]
    pub fn with_stall_ns(mut self, stall_ns: u32) -> Self {
        self.stall_ns = stall_ns;
        self
    }

    /// Checks that an ADIS16405 or ADIS16400 answers, then configures it.
    ///
    /// Only bytes that differ are written, the lower byte first, and a register that was written is read back.
    ///
    /// # Errors
    /// [`Error::Product`] if something else answers, [`Error::Verify`] if a register did not take its value.
    pub fn init(&mut self) -> Result<(), Error<SPI::Error>> {
        let answer = self.read_register(Register::ProdId)?;
        if !PRODUCTS.contains(&answer) {
            return Err(Error::Product { answer });
        }
        self.configure(Register::SmplPrd, u16::from(self.config.sample_period().register()))?;
        self.configure(Register::SensAvg, self.config.sens_avg())
    }

    /// Reads a register: two frames, the answer comes in the second. Bits outside the register's width are as the
    /// part sends them.
    ///
    /// # Errors
    /// [`Error::WriteOnly`] for GLOB_CMD (reading it would start a burst) and SLP_CNT.
    pub fn read_register(&mut self, register: Register) -> Result<u16, Error<SPI::Error>> {
        if register.access() == Access::Write {
            return Err(Error::WriteOnly(register));
        }
        self.frame(register.read_frame())?;
        // The second frame asks for FLASH_CNT, the one read without any effect.
        Ok(u16::from_be_bytes(self.frame(Register::FlashCnt.read_frame())?))
    }

    /// Writes a register, the lower byte first; the upper byte only if the register has one. Does not read it back.
    ///
    /// # Errors
    /// [`Error::ReadOnly`] if it cannot be written.
    pub fn write_register(&mut self, register: Register, value: u16) -> Result<(), Error<SPI::Error>> {
        if register.access() == Access::Read {
            return Err(Error::ReadOnly(register));
        }
        self.frame(register.write_low_frame(value))?;
        if register.bits() > 8 {
            self.frame(register.write_high_frame(value))?;
        }
        Ok(())
    }

    /// Reads all twelve outputs in one transaction of 26 bytes, 208 µs at 1 MHz.
    ///
    /// # Errors
    /// Only of the bus: whether the data can be believed is for [`Judge`](crate::Judge) to say.
    pub fn burst(&mut self) -> Result<Burst, Error<SPI::Error>> {
        let mut answer = [0; BURST_BYTES];
        self.spi
            .transaction(&mut [Operation::Transfer(&mut answer, &BURST_REQUEST), Operation::DelayNs(self.stall_ns)])?;
        Ok(Burst::from_bytes(&answer))
    }

    /// What [`init`](Self::init) sets.
    pub fn config(&self) -> Config {
        self.config
    }

    /// Gives the bus back.
    pub fn release(self) -> SPI {
        self.spi
    }

    fn configure(&mut self, register: Register, value: u16) -> Result<(), Error<SPI::Error>> {
        let expected = value & register.mask();
        let different = (self.read_register(register)? & register.mask()) ^ expected;
        if different == 0 {
            return Ok(());
        }
        if different & 0x00FF != 0 {
            self.frame(register.write_low_frame(expected))?;
        }
        if different & 0xFF00 != 0 {
            self.frame(register.write_high_frame(expected))?;
        }
        let answer = self.read_register(register)? & register.mask();
        if answer == expected { Ok(()) } else { Err(Error::Verify { register, expected, answer }) }
    }

    fn frame(&mut self, request: [u8; 2]) -> Result<[u8; 2], Error<SPI::Error>> {
        let mut answer = [0; 2];
        self.spi.transaction(&mut [Operation::Transfer(&mut answer, &request), Operation::DelayNs(self.stall_ns)])?;
        Ok(answer)
    }
}
