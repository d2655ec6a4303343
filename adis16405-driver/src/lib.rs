#![doc = include_str!("../README.md")]
//!
//! # Asynchronous, at each data-ready pulse
//!
//! ```
//! # #[cfg(feature = "async")] mod asynchronous {
//! use adis16405_driver::{Adis16405, Config, Error};
//! use embedded_hal_async::{delay::DelayNs, digital::Wait, spi::SpiDevice};
//!
//! async fn sample<S: SpiDevice>(spi: S, delay: impl DelayNs, mut dio1: impl Wait) -> Result<(), Error<S::Error>> {
//!     let mut imu = Adis16405::new_async(spi, delay, Config::default());
//!     imu.start_up().await?;
//!     loop {
//!         match imu.read_on(&mut dio1).await {
//!             Ok(sample) => drop(sample.gyro_dps()),
//!             Err(Error::Unusable(_)) => (), // no sample; the causes are in the error
//!             Err(error) => return Err(error),
//!         }
//!     }
//! }
//! # }
//! ```
//!
//! # Interrupted calls
//!
//! A transaction under way may or may not have reached the part. The next call works, since each read begins with its
//! own request and pause. An interrupted call can leave the part in these states:
//!
//! | interrupted | state of the part | remedy |
//! |---|---|---|
//! | [`burst`](Adis16405::burst), [`read`](Adis16405::read), register reads | new-data flags are cleared | none; the next sample is new |
//! | [`init`](Adis16405::init), [`configure`](Adis16405::configure) and the methods that set rate, range or filter | old or new period, range and filter | [`init`](Adis16405::init); until then [`read`](Adis16405::read) refuses |
//! | [`start_up`](Adis16405::start_up), [`software_reset`](Adis16405::software_reset) | settings of the flash memory, perhaps still busy | [`start_up`](Adis16405::start_up); until then [`read`](Adis16405::read) refuses |
//! | [`hardware_reset`](Adis16405::hardware_reset) | perhaps held in reset, the line being low | call it again; until then [`read`](Adis16405::read) refuses |
//! | [`stimulus_response`](Adis16405::stimulus_response) | sensors deflected, unless the driver could switch that off | [`stop_stimulus`](Adis16405::stop_stimulus) or [`init`](Adis16405::init); until then [`read`](Adis16405::read) refuses |
//! | [`self_test`](Adis16405::self_test), [`flash_test`](Adis16405::flash_test) | the test goes on and ends by itself | wait; flags of DIAG_STAT that were read are lost |
//! | [`auto_null`](Adis16405::auto_null), [`precision_auto_null`](Adis16405::precision_auto_null) | busy up to 31 s; a negative XGYRO_OFF | wait, then [`init`](Adis16405::init) |
//! | setters of offsets, factors, alarms and pins | some registers old, some new, one perhaps with one new byte | call the setter again |
//! | [`keep_negative_x_bias_on_host`](Adis16405::keep_negative_x_bias_on_host) | XGYRO_OFF may be 0 and its value lost | read [`gyro_offsets`](Adis16405::gyro_offsets) before, and set them again |
//! | [`factory_restore`](Adis16405::factory_restore) | old or factory corrections | call it again; corrections that it has read are lost |
//! | [`flash_update`](Adis16405::flash_update) | flash old, new or being written | wait, compare [`flash_writes`](Adis16405::flash_writes), call it again; flags of DIAG_STAT that were read are lost |
//! | [`sleep`](Adis16405::sleep), [`wake`](Adis16405::wake) | asleep or awake | [`wake`](Adis16405::wake) |
//!
//! # Equal samples
//!
//! In a measured minute of 49,425 bursts, 45 repeated the inertial words of their predecessor, a full period apart; 37
//! differed in another word. The new-data flags distinguish a sample that was read twice from one that is equal by
//! chance. In a recording without flags, the times of the samples do.
//!
//! # Sources
//!
//! Facts are those of the data sheet ADIS16400/ADIS16405 Rev. B, with page or table. It does not specify the reset
//! pulse, the least time that chip select is high ([`Timing`]), or the update rate of supply, magnetometers,
//! temperature and auxiliary input ([`Faults::NO_NEW_DATA`]). The erratum of the x rate ([`GyroBias`]) was reported by
//! users of the part.
//!
//! # Structure
//!
//! Functions are `async` procedures without I/O that request frames and pauses. The blocking and the asynchronous
//! driver carry them out, with the same methods from one table. A burst read needs no procedure: it takes no time
//! beyond the bus and the stall.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod alarms;
#[cfg(feature = "async")]
mod asynch;
mod blocking;
mod burst;
mod calibration;
mod channel;
mod clock;
mod commands;
mod config;
mod delay;
mod driver;
mod error;
mod fronts;
mod pins;
mod protocol;
mod register;
mod sample;
mod self_test;
mod spacing;
mod validity;

pub use alarms::{Alarm, AlarmNumber, AlarmThreshold, AlarmWatch};
pub use burst::{BURST_BYTES, BURST_REQUEST, Burst, Counts, OutputWord};
pub use calibration::{FactoryRestore, GyroBias, OnChipCompensation};
pub use channel::{Channel, ChannelMask, GyroRange};
pub use clock::{ClockMode, ConfigError, PerClockMode, SampleClock, SamplePeriod, TimeBase, Timing};
pub use commands::{Product, Sleep};
pub use config::{BartlettFilter, Config};
pub use delay::SharedDelay;
#[cfg(feature = "async")]
pub use driver::Async;
pub use driver::{Adis16405, Blocking};
pub use error::{Diagnosis, Error, FlashUpdate};
pub use pins::{DacLevel, Dio, DioLine, DioSignal, Gpio, Polarity};
pub use register::{Access, Register};
pub use sample::ImuSample;
pub use self_test::{FlashTest, SelfTest, Stimulus};
pub use spacing::SelectDuringStall;
pub use validity::{BurstValidator, FaultCounters, Faults, Validity};

/// Types that grow with the family need a wildcard arm.
///
/// ```compile_fail,E0004
/// fn name(product: adis16405_driver::Product) -> &'static str {
///     match product {
///         adis16405_driver::Product::Adis16400 => "ADIS16400",
///         adis16405_driver::Product::Adis16405 => "ADIS16405",
///     }
/// }
/// ```
#[cfg(doctest)]
struct NonExhaustive;
