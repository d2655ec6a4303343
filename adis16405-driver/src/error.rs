//! What can go wrong between the driver and the part.

use core::fmt;

use crate::register::Register;

/// An error of the bus, or an answer that the part must not give.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
        /// What was written, in the bits that the register holds.
        expected: u16,
        /// What it read afterwards, in the same bits.
        answer: u16,
    },
    /// The register cannot be written.
    ReadOnly(Register),
    /// The register cannot be read.
    WriteOnly(Register),
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
            Error::ReadOnly(register) => write!(f, "{} cannot be written", register.name()),
            Error::WriteOnly(register) => write!(f, "{} cannot be read", register.name()),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for Error<E> {}
