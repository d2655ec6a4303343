//! A virtual ADIS16405 at register level, on virtual time.
//!
//! [`VirtualAdis16405`] is the part: noise, hidden effects, filter, quantization, every register with its side effects, flash,
//! self-test, auto-null, alarms, sleep, pins, SPI protocol, and a judge of how the bus is used. It knows nothing of who drives it. [`EmulatedBus`] is one way: an embedded-hal
//! [`SpiDevice`](embedded_hal::spi::SpiDevice), so that the real driver reads the virtual part.

pub mod bus;
pub mod effect;
pub mod filter;
pub mod noise;
pub mod output;
pub mod part;
pub mod police;
pub mod registers;

pub use bus::{EmulatedBus, VirtualDelay};
pub use effect::{Effect, Hidden, Surroundings};
pub use noise::{ChannelNoise, NoiseModel};
pub use output::OutputRegister;
pub use part::{Activity, VirtualAdis16405};
pub use police::{Violation, ViolationKind};
