//! Errors: the status flags that the part reports in DIAG_STAT, and the error type of the driver.

use core::convert::Infallible;
use core::fmt;

use crate::channel::Channel;
use crate::clock::ConfigError;
use crate::register::Register;
use crate::validity::Faults;

bitflags::bitflags! {
    /// The flags of DIAG_STAT. A read clears them, so procedures that read them return them.
    ///
    /// A flag is set again while its condition persists; supply flags clear by themselves (data sheet Rev. B, page 15
    /// and Table 23). Linux has gyro x and z exchanged.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub struct Diagnosis: u16 {
        /// Supply below 4.75 V.
        const SUPPLY_LOW = 1 << 0;
        /// Supply above 5.25 V.
        const SUPPLY_HIGH = 1 << 1;
        /// A flash or control update failed.
        const FLASH_UPDATE = 1 << 2;
        /// An SPI frame whose number of clocks was not a multiple of 16.
        const SPI = 1 << 3;
        /// A sensor is beyond its range.
        const OVER_RANGE = 1 << 4;
        /// The self-test failed; the bits from [`GYRO_X`](Self::GYRO_X) on show which sensor.
        const SELF_TEST = 1 << 5;
        /// The checksum of the flash memory is wrong.
        const FLASH_CHECKSUM = 1 << 6;
        /// Alarm 1 is raised.
        const ALARM_1 = 1 << 8;
        /// Alarm 2 is raised.
        const ALARM_2 = 1 << 9;
        /// Self-test of gyro x failed.
        const GYRO_X = 1 << 10;
        /// Self-test of gyro y failed.
        const GYRO_Y = 1 << 11;
        /// Self-test of gyro z failed.
        const GYRO_Z = 1 << 12;
        /// Self-test of accelerometer x failed.
        const ACCL_X = 1 << 13;
        /// Self-test of accelerometer y failed.
        const ACCL_Y = 1 << 14;
        /// Self-test of accelerometer z failed.
        const ACCL_Z = 1 << 15;
    }
}

impl Diagnosis {
    /// All flags of a failed self-test.
    pub const SELF_TEST_FAILURES: Self = Self::SELF_TEST
        .union(Self::GYRO_X)
        .union(Self::GYRO_Y)
        .union(Self::GYRO_Z)
        .union(Self::ACCL_X)
        .union(Self::ACCL_Y)
        .union(Self::ACCL_Z);

    /// The sensors that failed their self-test.
    pub fn failed_sensors(self) -> impl Iterator<Item = Channel> {
        Channel::INERTIAL
            .into_iter()
            .enumerate()
            .filter(move |(index, _)| self.bits() & Self::GYRO_X.bits() << index != 0)
            .map(|(_, channel)| channel)
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Diagnosis {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "Diagnosis({=u16:#x})", self.bits());
    }
}

/// Outcome of a flash update, successful or not. Both reads of DIAG_STAT cleared the register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct FlashUpdate {
    /// DIAG_STAT before the command: [`Diagnosis::FLASH_UPDATE`] here belongs to an earlier update.
    pub before: Diagnosis,
    /// FLASH_CNT before the command.
    pub writes_before: u16,
    /// FLASH_CNT after it.
    pub writes: u16,
    /// DIAG_STAT after the command.
    pub diagnosis: Diagnosis,
}

/// An error of the SPI bus, an unexpected answer of the part, or a request that the part would not accept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Error<E> {
    /// The SPI bus failed.
    Spi(E),
    /// PROD_ID is neither 16405 nor 16400.
    Product {
        /// The value read from PROD_ID.
        answer: u16,
    },
    /// A register did not take the value that was written.
    Verify {
        /// The register.
        register: Register,
        /// The value written, in the bits that were to change.
        expected: u16,
        /// The value read back, in the same bits.
        answer: u16,
    },
    /// Self-clearing bits were still set at the deadline.
    Deadline {
        /// The register.
        register: Register,
        /// The bits.
        mask: u16,
        /// Sum of the pauses between the polls, µs.
        waited_us: u32,
    },
    /// The flash update failed, or FLASH_CNT did not change.
    FlashUpdate(FlashUpdate),
    /// The burst that was read is not usable.
    Unusable(Faults),
    /// Unknown configuration, or a stimulus may be on: [`init`](crate::Adis16405::init) has to succeed first. Nothing
    /// was sent.
    NotReady,
    /// The reset or data-ready pin of the controller failed.
    Pin,
    /// The part does not accept the configuration. Nothing was written.
    Config(ConfigError),
    /// The value does not fit the register. Nothing was written.
    Value {
        /// The register.
        register: Register,
        /// The requested value.
        value: i32,
    },
    /// The register cannot be written.
    ReadOnly(Register),
    /// The register cannot be read.
    WriteOnly(Register),
}

impl Error<Infallible> {
    /// Converts the error to that of a driver whose bus can fail.
    pub(crate) fn with_bus_error<E>(self) -> Error<E> {
        match self {
            Error::Spi(never) => match never {},
            Error::Product { answer } => Error::Product { answer },
            Error::Verify { register, expected, answer } => Error::Verify { register, expected, answer },
            Error::Deadline { register, mask, waited_us } => Error::Deadline { register, mask, waited_us },
            Error::FlashUpdate(outcome) => Error::FlashUpdate(outcome),
            Error::Unusable(faults) => Error::Unusable(faults),
            Error::NotReady => Error::NotReady,
            Error::Pin => Error::Pin,
            Error::Config(error) => Error::Config(error),
            Error::Value { register, value } => Error::Value { register, value },
            Error::ReadOnly(register) => Error::ReadOnly(register),
            Error::WriteOnly(register) => Error::WriteOnly(register),
        }
    }
}

impl<E> From<ConfigError> for Error<E> {
    fn from(error: ConfigError) -> Self {
        Error::Config(error)
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
            Error::FlashUpdate(FlashUpdate { writes_before, writes, diagnosis, .. }) => {
                let diagnosis = diagnosis.bits();
                write!(
                    f,
                    "flash update failed: FLASH_CNT was {writes_before} and is {writes}, DIAG_STAT {diagnosis:#06x}"
                )
            }
            Error::Unusable(faults) => write!(f, "the burst is not usable: {}", faults.cause().unwrap_or_default()),
            Error::NotReady => write!(f, "init() has to succeed first"),
            Error::Pin => write!(f, "a pin of the controller failed"),
            Error::Config(error) => write!(f, "{error}"),
            Error::Value { register, value } => write!(f, "{value} does not fit {}", register.name()),
            Error::ReadOnly(register) => write!(f, "{} cannot be written", register.name()),
            Error::WriteOnly(register) => write!(f, "{} cannot be read", register.name()),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for Error<E> {}
