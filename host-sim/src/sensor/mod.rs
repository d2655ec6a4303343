//! A virtual ADIS16405 at register level, on virtual time.
//!
//! [`VirtualAdis16405`] is the part: noise, hidden effects, filter, quantization, register file, SPI protocol, and a judge of how the bus
//! is used. It knows nothing of who drives it. [`EmulatedBus`] is one way: an embedded-hal
//! [`SpiDevice`](embedded_hal::spi::SpiDevice), so that the real driver reads the virtual part.
//!
//! Not modelled yet: start-up and flash, self-test (passes at once), alarms, sleep, GPIO, auto-null.

pub mod bus;
pub mod effect;
pub mod filter;
pub mod noise;
pub mod part;
pub mod police;
pub mod registers;

#[cfg(test)]
mod tests;

pub use bus::EmulatedBus;
pub use effect::{Effect, Hidden, Surroundings};
pub use noise::{ChannelNoise, NoiseModel};
pub use part::VirtualAdis16405;
pub use police::{Violation, ViolationKind};
