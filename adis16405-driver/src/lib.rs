//! Driver for the Analog Devices ADIS16405 (and ADIS16400) inertial sensor over an
//! [`embedded_hal::spi::SpiDevice`], or over that of embedded-hal-async with feature `async`.
//!
//! ```text
//! SPI bytes ─► Burst (12 output words, flags) ─► Sample (sign-extended counts, range) ─► °/s, g, gauss, °C, V
//!                    └► Judge ─► Verdict (faults by cause)
//! ```
//!
//! ```
//! use adis16405_driver::{Adis16405, Config, Error, GyroRange, Judge, SamplePeriod};
//! use embedded_hal::{delay::DelayNs, spi::SpiDevice};
//!
//! fn read<SPI: SpiDevice<u8>>(spi: SPI, delay: &mut impl DelayNs) -> Result<(), Error<SPI::Error>> {
//!     let period = SamplePeriod::nearest(204.8).map_err(Error::Config)?;
//!     let config = Config::new(GyroRange::Dps300, 2, period).map_err(Error::Config)?;
//!     let mut imu = Adis16405::new(spi, config);
//!     imu.start_up(delay)?;
//!     let healthy = imu.self_test(delay)?.passed();
//!     let mut judge = Judge::default().with_x_sign_at_risk(imu.x_sign_at_risk());
//!     // … at every data-ready edge:
//!     let burst = imu.burst()?;
//!     if judge.judge(&burst).usable {
//!         let [x, y, z] = imu.sample_of(burst).gyro_dps();
//!         # let _ = (healthy, x, y, z);
//!     }
//!     Ok(())
//! }
//! ```
//!
//! # Wiring and the bus
//!
//! SCLK, DIN, DOUT and CS go to an SPI controller in **mode 3**, most significant bit first; DIO1 carries data ready, active
//! high, unless told otherwise ([`set_data_ready`](Adis16405::set_data_ready)). The supply is 5 V (4.75 to 5.25 V); the
//! logic takes 3.3 V and 5 V levels, and its outputs may reach 5 V. At 3.3 V supply the outputs saturate instead of falling
//! silent. Steel screws disturb the magnetometer.
//!
//! | | SMPL_PRD ≤ 0x08 ([`ClockMode::Normal`]) | above ([`ClockMode::LowPower`]) |
//! |---|---|---|
//! | SCK, single frames | 2 MHz at most | 300 kHz at most |
//! | SCK, burst | 1 MHz at most | 300 kHz at most |
//! | stall after a frame | 9 µs at least, 16 µs kept | 75 µs kept (unconfirmed) |
//!
//! (ADIS16400/ADIS16405 data sheet Rev. B, page 10.) The driver cannot set SCK: 102.4 samples per second and fewer are
//! low-power mode, where the bus must be slowed down first. A microcontroller that restarts while the part keeps its power
//! may meet it in that mode.
//!
//! Each frame is a transaction, so chip select is high in between; the stall is an
//! [`Operation::DelayNs`](embedded_hal::spi::Operation::DelayNs) at the transaction's end. With embedded-hal-bus use a
//! constructor that takes a delay; `new_no_delay` panics on the first stall:
//!
//! ```
//! # use embedded_hal::{delay::DelayNs, digital::OutputPin, spi::SpiBus};
//! use adis16405_driver::{Adis16405, Config};
//! use embedded_hal_bus::spi::ExclusiveDevice;
//! # fn build<B: SpiBus<u8>, P: OutputPin, D: DelayNs>(bus: B, chip_select: P, timer: D) -> Result<(), P::Error> {
//! let device = ExclusiveDevice::new(bus, chip_select, timer)?;
//! let mut imu = Adis16405::new(device, Config::default());
//! # Ok(()) }
//! ```
//!
//! The firmware of this workspace (`firmware/src/bin/observatory-f405`) has the whole of it: clock, pins, the data-ready
//! interrupt and a queue. `examples/spidev.rs` reads the part on a Linux host.
//!
//! # What a verdict means
//!
//! The part has no checksum and no sample counter. [`Judge`] uses all that there is:
//!
//! | fault | what was seen | usable | what to do |
//! |---|---|---|---|
//! | [`STUCK_LOW`](Faults::STUCK_LOW), [`STUCK_HIGH`](Faults::STUCK_HIGH) | nothing but zeros, or ones | no | wiring, power; then [`start_up`](Adis16405::start_up) |
//! | [`SHIFTED`](Faults::SHIFTED) | a good burst, some bits off | no | SCK integrity; the next chip select puts it right |
//! | [`NO_NEW_DATA`](Faults::NO_NEW_DATA) | read before the next sample was there | no | wait for data ready |
//! | [`FROZEN`](Faults::FROZEN) | twelve words equal for 512 bursts | no | [`software_reset`](Adis16405::software_reset) |
//! | [`IMPOSSIBLE_RATE`](Faults::IMPOSSIBLE_RATE) | a gyro beyond ±7000 counts | no | damaged word, or the sign erratum |
//! | [`X_SIGN`](Faults::X_SIGN) | an x rate that may lack its sign | no | [`keep_negative_x_bias_on_host`](Adis16405::keep_negative_x_bias_on_host) |
//! | [`ERROR_ALARM`](Faults::ERROR_ALARM) | a flag in DIAG_STAT | no | [`diagnosis`](Adis16405::diagnosis), which clears it |
//! | [`SUPPLY`](Faults::SUPPLY) | supply outside 4.75 to 5.25 V | no | power |
//! | [`REPEATED`](Faults::REPEATED) | inertial words as before, but new data | yes | nothing: mostly chance, and leaving them out would bias the noise |
//!
//! The 45 equal neighbours in a measured minute of 49,425 bursts were each a full sample period apart, and 37 of them
//! differed in another word. What tells a sample that was read twice from one that is equal by chance is the new-data bit,
//! or, in a recording without it, that it comes too soon.
//!
//! # What no source at hand confirms
//!
//! It can all be set: the stall in low-power mode, where that mode begins, the gap between burst words, and the times of
//! flash update, factory restore, auto-null and wake-up pulse ([`Timing`]); 0.14 °C or 0.1357 °C a count
//! ([`Sample::temp_udegc`]); the layout of the alarm registers ([`alarm`]) and the scale of the analog output
//! ([`DacLevel`]), for which [`update_register`](Adis16405::update_register) is the way around; the width of SUPPLY_OUT,
//! 12 or 14 bits ([`OutputWord`] is the raw word); the external clock ([`SampleClock::External`]), indefinite sleep
//! ([`Sleep::Indefinite`]), the delay of the filter ([`Filter::group_delay`]) and the order of x and z in DIAG_STAT
//! ([`Diagnosis`]).
//!
//! # How it is built
//!
//! What the part can be told is a procedure without I/O: an `async fn` that asks for frames and pauses and gets answers. Two
//! thin shells carry them out, blocking and asynchronous; both have the same methods, from one table. A burst goes to the
//! bus directly, and takes no longer than the bus and the stall.
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
