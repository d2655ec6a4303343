//! A virtual ADIS16405 at register level, in virtual time.
//!
//! [`VirtualAdis16405`] is the part: noise, injected effects, digital filter, quantization, every register with its
//! side effects, flash, self-test, auto-null, alarms, sleep, pins, SPI protocol, and a checker of the bus timing. Its
//! register map is that of the data sheet and shares no code with the driver. [`EmulatedBus`] connects it to the driver
//! as an embedded-hal [`SpiDevice`](embedded_hal::spi::SpiDevice).
//!
//! Facts are those of the data sheet ADIS16400/ADIS16405 Rev. B, with page, table or figure. If a controller addresses the part too soon or
//! clocks it too fast, it reads garbage and its frames are not executed ([`Violation`]). What drivers of real parts do and the data sheet
//! neither shows nor forbids is accepted with a [`Note`]. [`Strictness`] changes both.
//!
//! These behaviours of real parts are off by default:
//!
//! | the part is | by |
//! |---|---|
//! | cold: it starts up for 220 to 290 ms, and answers zeros, ones or garbage meanwhile | [`VirtualAdis16405::cold`], [`VirtualAdis16405::power_on`], [`VirtualAdis16405::set_start_up_ns`], [`VirtualAdis16405::set_busy_answers`] |
//! | slow in its words of supply, magnetometers, temperature and auxiliary input | [`VirtualAdis16405::set_slow_refresh`] |
//! | latched: a flag of DIAG_STAT is set, once or by a cause that persists | [`VirtualAdis16405::latch_flag`], [`VirtualAdis16405::hold_flag`] |
//! | lenient about its bus, or pedantic about chip select and unused bytes | [`VirtualAdis16405::set_strictness`] |
//! | reset by its pin, or held in reset | [`EmulatedBus::reset_line`], [`VirtualAdis16405::drive_reset`] |
//! | broken, without power, or another product | [`VirtualAdis16405::break_sensor`], [`VirtualAdis16405::damage_flash`], [`VirtualAdis16405::power_off`], [`VirtualAdis16405::set_prod_id`] |

mod activity;
mod bus;
mod diagnosis;
mod effects;
mod environment;
mod faults;
mod interface;
mod noise;
mod noise_ahead;
mod part;
mod registers;
mod signal_chain;
mod spi;

pub use activity::{Activity, BusyAnswers};
pub use bus::{EmulatedBus, VirtualDelay, VirtualResetLine};
pub use diagnosis::DiagnosisFlag;
pub use effects::{EffectSource, InjectedEffect, SensorScenario};
pub use environment::{Environment, Motion, SupplyProfile, TemperatureProfile};
pub use noise::{ChannelNoise, NoiseModel, NoiseSource};
pub use part::VirtualAdis16405;
pub use registers::OutputRegister;
pub use signal_chain::CascadedBoxFilter;
pub use spi::{
    MAX_SCK_BURST_HZ, MAX_SCK_NORMAL_HZ, MIN_READ_RATE_NORMAL_NS, MIN_STALL_NORMAL_NS, Note, NoteKind, Strictness,
    Violation, ViolationKind,
};
