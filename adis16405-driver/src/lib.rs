//! Driver for the Analog Devices ADIS16405 (and ADIS16400) inertial sensor over an
//! [`embedded_hal::spi::SpiDevice`].
//!
//! ```text
//! SPI bytes ─► Burst (12 output words, flags) ─► Counts (sign-extended integers) ─► unit per count
//!                    └► Judge ─► Verdict (faults by cause)
//! ```
//!
//! The part speaks SPI mode 3, most significant bit first, in frames of 16 bits with chip select high between
//! them. SCK may be at most 2 MHz ([`ClockMode::Normal`]), 1 MHz for a burst read and 300 kHz in
//! [`ClockMode::LowPower`] (ADIS16400/ADIS16405 data sheet Rev. B, page 10).
//!
//! ```
//! use adis16405_driver::{Adis16405, Config, Error, GyroRange, Judge, SamplePeriod};
//! # fn read<SPI: embedded_hal::spi::SpiDevice<u8>>(spi: SPI) -> Result<(), Error<SPI::Error>> {
//! let period = SamplePeriod::nearest(204.8).expect("a positive rate");
//! let config = Config::new(GyroRange::Dps300, 2, period).expect("taps that fit the range");
//! let mut imu = Adis16405::new(spi, config);
//! imu.init()?;
//! let mut judge = Judge::default();
//! let burst = imu.burst()?;
//! if judge.judge(&burst).usable {
//!     let gyro = burst.counts().gyro();
//!     # let _ = gyro;
//! }
//! # Ok(()) }
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod blocking;
pub mod config;
pub mod error;
pub mod frame;
pub mod register;
pub mod sample;
pub mod status;

pub use blocking::Adis16405;
pub use config::{ClockMode, Config, ConfigError, GyroRange, SamplePeriod, TimeBase};
pub use error::Error;
pub use frame::{BURST_BYTES, BURST_REQUEST, Burst, OutputWord};
pub use register::{Access, Register};
pub use sample::{Channel, Counts};
pub use status::{Counters, Faults, Judge, Verdict};
