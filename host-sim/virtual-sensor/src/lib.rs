//! A virtual ADIS16405 at register level, in virtual time.
//!
//! [`VirtualAdis16405`] is the part: noise, injected effects, digital filter, quantization, every register with its side
//! effects, flash, self-test, auto-null, alarms, sleep, pins, SPI protocol, and a checker of the bus timing. Its register
//! map is that of the data sheet and shares no code with the driver. [`EmulatedBus`] puts it behind an embedded-hal
//! [`SpiDevice`](embedded_hal::spi::SpiDevice), over which the driver reads it.

mod activity;
mod bus;
mod diagnosis;
mod effects;
mod environment;
mod interface;
mod noise;
mod part;
mod registers;
mod signal_chain;
mod spi;

pub use activity::Activity;
pub use bus::{EmulatedBus, VirtualDelay};
pub use effects::{EffectSource, InjectedEffect, SensorScenario};
pub use environment::{Environment, Motion, SupplyProfile, TemperatureProfile};
pub use noise::{ChannelNoise, NoiseModel, NoiseSource};
pub use part::VirtualAdis16405;
pub use registers::OutputRegister;
pub use signal_chain::CascadedBoxFilter;
pub use spi::{Violation, ViolationKind};
