//! Driver for the Analog Devices ADIS16405 (and ADIS16400) inertial sensor over an
//! [`embedded_hal::spi::SpiDevice`], or over that of embedded-hal-async with feature `async`.
//!
//! ```text
//! SPI bytes ─► Burst (12 output words) ─► Counts (sign-extended) ─► ImuSample: °/s, g, gauss, °C, V
//!                └► BurstValidator ─► Validity (faults by cause)
//! ```
//!
//! ```
//! use adis16405_driver::{Adis16405, Config, Error, GyroRange, SamplePeriod};
//! use embedded_hal::{delay::DelayNs, spi::SpiDevice};
//!
//! fn read<SPI: SpiDevice<u8>>(spi: SPI, delay: impl DelayNs) -> Result<(), Error<SPI::Error>> {
//!     let period = SamplePeriod::nearest(204.8)?;
//!     let config = Config::new(GyroRange::Dps300, 2, period)?;
//!     let mut imu = Adis16405::new(spi, delay, config);
//!     imu.start_up()?; // 290 ms after power-on
//!     let healthy = imu.self_test()?.passed();
//!     // … at every data-ready edge:
//!     match imu.read() {
//!         Ok(sample) => {
//!             let [x, y, z] = sample.gyro_dps();
//!             # let _ = (healthy, x, y, z);
//!             if sample.warnings().contains(adis16405_driver::Faults::ERROR_ALARM) {
//!                 let reason = imu.diagnosis()?; // Clears DIAG_STAT.
//!                 # let _ = reason;
//!             }
//!         }
//!         Err(Error::Unusable(_)) => (), // Left out.
//!         Err(error) => return Err(error),
//!     }
//!     Ok(())
//! }
//! ```
//!
//! # Wiring and the bus
//!
//! SCLK, DIN, DOUT and CS go to an SPI controller in **mode 3**, most significant bit first. DIO1 carries data ready,
//! active high; [`set_data_ready`](Adis16405::set_data_ready) changes that. RST, active low, may go to an output, best an
//! open-drain one: [`hardware_reset`](Adis16405::hardware_reset) revives a part that does not answer. The supply is 5 V (4.75 to 5.25 V). The
//! logic inputs take 3.3 V and 5 V levels; the outputs may reach 5 V. At a supply of 3.3 V the part answers, but its
//! outputs saturate. Steel screws disturb the magnetometer.
//!
//! | | SMPL_PRD ≤ 0x08 ([`ClockMode::Normal`]) | above ([`ClockMode::LowPower`]) |
//! |---|---|---|
//! | SCK, single frames | 2 MHz at most | 300 kHz at most |
//! | SCK, burst | 1 MHz at most | 300 kHz at most |
//! | stall after a frame or burst | at least 9 µs; the driver keeps 16 µs | at least 75 µs |
//! | from a falling edge of chip select to the next | at least 40 µs | at least 150 µs |
//!
//! (ADIS16400/ADIS16405 data sheet Rev. B, Tables 2 and 7; where low-power mode begins, [`ClockMode`].) The driver cannot
//! set SCK. Rates of 163.84 samples per second and below select low-power mode: reduce SCK first. After a restart of the
//! microcontroller alone, the part may still be in that mode.
//!
//! Each frame is a transaction, after which the driver waits for the stall with its own delay: chip select is high
//! meanwhile, and on a shared bus the other devices have the time. A burst is one transaction of 26 bytes.
//! [`Timing`] sets these pauses:
//!
//! | field | default | |
//! |---|---|---|
//! | [`stall_ns`](Timing::stall_ns) | 16 µs, 75 µs in low-power mode | least pause after each frame and burst |
//! | [`read_rate_ns`](Timing::read_rate_ns) | 40 µs, 150 µs in low-power mode | from frame to frame |
//! | [`sck_hz`](Timing::sck_hz) | the fastest: 2 MHz, 300 kHz in low-power mode | sets what the read rate leaves for the stall: 32 µs, 24 µs at 1 MHz |
//! | [`stall_select`](Timing::stall_select) | [`High`](SelectDuringStall::High) | `Low` holds chip select low for the stall, as one transaction |
//! | [`select_high_ns`](Timing::select_high_ns) | 1 µs | least time that chip select is high |
//! | [`word_gap_ns`](Timing::word_gap_ns) | 0 | between the words of a burst; not 0 makes 13 transfers of it |
//!
//! The shortest burst is the default one with a stall of 9 µs, the least by the data sheet. A pause that was cut short,
//! by a future that was dropped, is kept before the next frame.
//!
//! With embedded-hal-bus, `new_no_delay` is enough unless you use [`wake`](Adis16405::wake), `SelectDuringStall::Low` or a
//! word gap, whose [`Operation::DelayNs`](embedded_hal::spi::Operation::DelayNs) it would panic on:
//!
//! ```
//! # use embedded_hal::{delay::DelayNs, digital::OutputPin, spi::SpiBus};
//! use adis16405_driver::{Adis16405, Config};
//! use embedded_hal_bus::spi::ExclusiveDevice;
//! # fn build<B: SpiBus<u8>, P: OutputPin, D: DelayNs>(bus: B, chip_select: P, timer: D) -> Result<(), P::Error> {
//! let device = ExclusiveDevice::new_no_delay(bus, chip_select)?;
//! let mut imu = Adis16405::new(device, timer, Config::default());
//! # Ok(()) }
//! ```
//!
//! If both need a delay and your HAL has only one, [`SharedDelay`] serves both. embassy-embedded-hal carries a
//! `DelayNs` operation out only with its feature `time`.
//!
//! `examples/mock.rs` runs without hardware; `examples/spidev.rs` reads a part on a Linux host; the crate in
//! `examples-stm32f405` has images for cortex-m-rt, RTIC and Embassy.
//!
//! # Validity of a burst
//!
//! The part has no checksum and no sample counter. [`BurstValidator`] derives the validity of a burst from the flags of
//! its words, from their values, and from the bursts before:
//!
//! | fault | condition | refuses | remedy |
//! |---|---|---|---|
//! | [`STUCK_LOW`](Faults::STUCK_LOW), [`STUCK_HIGH`](Faults::STUCK_HIGH) | all bits 0; the last two words all ones | all | check wiring and power; then [`start_up`](Adis16405::start_up) |
//! | [`SHIFTED`](Faults::SHIFTED) | a valid burst, shifted by 1 to 15 bits | all | check SCK; the next transaction is aligned again |
//! | [`IMPLAUSIBLE_SUPPLY`](Faults::IMPLAUSIBLE_SUPPLY) | supply below 3.0 V or above 6.0 V | all | check SCK and wiring |
//! | [`MIXED_ALARM`](Faults::MIXED_ALARM) | the error/alarm flag is set in some words, clear in others | all | check SCK and wiring |
//! | [`FROZEN`](Faults::FROZEN) | twelve words equal for 512 bursts | all | [`software_reset`](Adis16405::software_reset) |
//! | [`NO_NEW_DATA`](Faults::NO_NEW_DATA) | the new-data flag of an inertial word is clear | the channel; all if no inertial word is new | wait for data ready |
//! | [`IMPOSSIBLE_RATE`](Faults::IMPOSSIBLE_RATE) | a gyro beyond ±7000 counts | the channel | a damaged word, or the sign erratum |
//! | [`X_SIGN`](Faults::X_SIGN) | an x rate that may lack its sign bit | gyro x | [`keep_negative_x_bias_on_host`](Adis16405::keep_negative_x_bias_on_host) |
//! | [`ERROR_ALARM`](Faults::ERROR_ALARM) | an error/alarm flag is set | none | [`diagnosis`](Adis16405::diagnosis), which clears it |
//! | [`SUPPLY`](Faults::SUPPLY) | supply outside 4.75 to 5.25 V | none | check power |
//! | [`REPEATED`](Faults::REPEATED) | inertial words equal those of the burst before | none | none: mostly chance, and leaving them out would bias the noise estimate |
//!
//! [`read`](Adis16405::read) returns a sample if no channel is refused, with the other faults as
//! [warnings](ImuSample::warnings); [`fault_counters`](Adis16405::fault_counters) counts
//! every fault. [`with_refused_faults`](Adis16405::with_refused_faults) sets which faults refuse.
//!
//! In a measured minute of 49,425 bursts, 45 repeated the inertial words of their predecessor. All were a full sample
//! period apart, and 37 of them differed in another word. A sample that was read twice is distinguished from one that
//! is equal by chance by its new-data flags, or, in a recording without them, by its time.
//!
//! # Errors and cancellation
//!
//! A method whose bus fails, or whose future is dropped, stops where it is. A transaction that was under way may or may
//! not have reached the part. The driver itself stays consistent, and the next call works: each read begins with its own
//! request, after the pause that the part needs, and each transaction with a falling edge of chip select, provided that
//! the SPI device releases it when its future is dropped. What the part may be left with, and the remedy:
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
//! The SPI devices of embassy-embedded-hal 0.6 release chip select when their future is dropped; the asynchronous ones of
//! embedded-hal-bus 0.3 do not, so let their futures end.
//!
//! A timeout around any method is therefore possible; `burst` and `read` may be dropped at any time without a loss other
//! than that sample.
//!
//! # Sources
//!
//! Facts of the part are those of the data sheet ADIS16400/ADIS16405 Rev. B, with the page or table where it matters. It says
//! nothing of the reset pulse and of the least time that chip select is high ([`Timing`]), nor of the rate at which supply,
//! magnetometers, temperature and auxiliary input are refreshed ([`Faults::NO_NEW_DATA`]). The erratum of the x rate
//! ([`GyroBias`]) is from users of the part.
//!
//! # Structure
//!
//! Every function of the part is an `async` procedure without I/O, which requests frames and pauses and receives
//! answers. The blocking and the asynchronous driver carry the requests out; both have the same methods, from one
//! table. A burst read does not go through a procedure, so that it takes no longer than the bus and the stall.
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

/// Compiles the example of the README as a documentation test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
