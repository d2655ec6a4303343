//! What can go wrong between the driver and the part.

use core::convert::Infallible;
use core::fmt;

use crate::config::ConfigError;
use crate::diagnosis::Diagnosis;
use crate::register::Register;

/// An error of the bus, or an answer that the part must not give.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Error<E> {
    /// The SPI bus failed.
    Spi(E),
    /// PROD_ID is neither 16405 nor 16400.
    Product {
        /// What PROD_ID read.
        answer: u16,
    },
    /// A register did not take what was written.
    Verify {
        /// The register.
        register: Register,
        /// What was written, in the bits that were to change.
        expected: u16,
        /// What it read afterwards, in the same bits.
        answer: u16,
    },
    /// Bits that clear themselves when something is done did not do so in time.
    Deadline {
        /// The register.
        register: Register,
        /// The bits.
        mask: u16,
        /// Sum of the pauses while they were watched, µs.
        waited_us: u32,
    },
    /// The flash update failed, or FLASH_CNT did not move.
    FlashUpdate {
        /// FLASH_CNT before the command.
        before: u16,
        /// FLASH_CNT after it.
        after: u16,
        /// What DIAG_STAT held after it; reading it cleared it.
        diagnosis: Diagnosis,
    },
    /// The configuration is none that the part accepts. Nothing was written.
    Config(ConfigError),
    /// The value does not fit the register. Nothing was written.
    Value {
        /// The register.
        register: Register,
        /// The value asked for.
        value: i32,
    },
    /// The register cannot be written, or not in this way.
    ReadOnly(Register),
    /// The register cannot be read.
    WriteOnly(Register),
}

impl Error<Infallible> {
    /// The same error where a bus can fail.
    pub(crate) fn over_bus<E>(self) -> Error<E> {
        match self {
            Error::Spi(never) => match never {},
            Error::Product { answer } => Error::Product { answer },
            Error::Verify { register, expected, answer } => Error::Verify { register, expected, answer },
            Error::Deadline { register, mask, waited_us } => Error::Deadline { register, mask, waited_us },
            Error::FlashUpdate { before, after, diagnosis } => Error::FlashUpdate { before, after, diagnosis },
            Error::Config(error) => Error::Config(error),
            Error::Value { register, value } => Error::Value { register, value },
            Error::ReadOnly(register) => Error::ReadOnly(register),
            Error::WriteOnly(register) => Error::WriteOnly(register),
        }
    }
}

impl<E> From<E> for Error<E> {
    fn from(error: E) -> Self {
        Error::Spi(error)
    }
}

impl<E: fmt::Debug> fmt::Display for Error<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Spi(error) => write!(f, "SPI bus: {error:?}"),
            Error::Product { answer } => {
                write!(f, "PROD_ID answered {answer} ({answer:#06x}), not 16405 or 16400")
            }
            Error::Verify { register, expected, answer } => {
                let name = register.name();
                write!(f, "{name} was written {expected:#06x} and answered {answer:#06x}")
            }
            Error::Deadline { register, mask, waited_us } => {
                let name = register.name();
                write!(f, "{name} still has bits of {mask:#06x} set after {waited_us} µs")
            }
            Error::FlashUpdate { before, after, diagnosis } => {
                let diagnosis = diagnosis.bits();
                write!(f, "flash update failed: FLASH_CNT was {before} and is {after}, DIAG_STAT {diagnosis:#06x}")
            }
            Error::Config(error) => write!(f, "{error}"),
            Error::Value { register, value } => write!(f, "{value} does not fit {}", register.name()),
            Error::ReadOnly(register) => write!(f, "{} cannot be written", register.name()),
            Error::WriteOnly(register) => write!(f, "{} cannot be read", register.name()),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for Error<E> {}
