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

pub mod alarm;
#[cfg(feature = "async")]
mod asynch;
mod blocking;
pub mod channel;
pub mod clock;
pub mod compensation;
pub mod config;
pub mod diagnosis;
pub mod driver;
pub mod error;
pub mod fault;
pub mod filter;
pub mod frame;
pub mod judge;
#[cfg(feature = "defmt")]
mod log;
pub mod offset;
pub mod pin;
mod port;
mod procedure;
pub mod product;
pub mod register;
pub mod sample;
pub mod self_test;
mod session;
mod shell;
pub mod sleep;
#[cfg(feature = "serde")]
mod stored;
pub mod timing;

pub use alarm::{Alarm, AlarmNumber, Threshold, Watch};
pub use channel::Channel;
pub use clock::{ClockMode, SampleClock, SamplePeriod, TimeBase};
pub use compensation::Compensation;
pub use config::{Config, ConfigError, GyroRange};
pub use diagnosis::Diagnosis;
#[cfg(feature = "async")]
pub use driver::Async;
pub use driver::{Adis16405, Blocking};
pub use error::Error;
pub use fault::Faults;
pub use filter::Filter;
pub use frame::{BURST_BYTES, BURST_REQUEST, Burst, OutputWord};
pub use judge::{Counters, Judge, Verdict};
pub use offset::{FactoryRestore, GyroBias};
pub use pin::{DacLevel, Dio, Gpio, Line, Polarity, Signal};
pub use product::Product;
pub use register::{Access, Register};
pub use sample::{Counts, Sample};
pub use self_test::{FlashTest, SelfTest, Stimulus};
pub use sleep::Sleep;
pub use timing::{ByMode, Timing};
