//! The application that characterises an ADIS16405 while it runs: the same code on every board and on the host.
//!
//! ```text
//! data-ready edge ─► Sampler ─► queue ─► Estimators ─► App ─► Outbox ─► serial port
//!  (interrupts)      bursts              (below them)  (main loop)
//! ```
//!
//! A board brings pins, clocks and interrupts; what all images share beside the application is in `microcontroller`: it
//! calls the [`Sampler`] at data-ready edges and at the ends of bursts, [`estimate`] at a lower priority, and [`run`] from
//! the main program. Nothing of a higher priority ever waits for anything of a lower one.
#![no_std]
#![deny(unsafe_code)]
#![deny(missing_docs)]

pub mod acquisition;
mod app;
mod board;
pub mod cadence;
pub mod command;
pub mod compensation;
pub mod couplings;
mod desk;
mod epoch;
mod estimators;
mod last_words;
pub mod lesson;
#[cfg(all(target_os = "none", feature = "microcontroller"))]
#[allow(unsafe_code, reason = "registers, and memory that outlives a reset")]
pub mod microcontroller;
pub mod outbox;
pub mod retained;
pub mod sensor;
pub mod spi_clock;
mod summary;
mod sums;
pub mod table;
mod uptime;

pub use acquisition::{Arrival, Arrivals, Sampler};
pub use app::{App, FIRST_CONFIG, Start};
pub use board::{Board, Meters};
pub use desk::{Chip, Desk, Locks, run};
pub use epoch::Epoch;
pub use estimators::{CHANNELS, Estimator, Estimators, Statistics, estimate};
pub use last_words::LastWords;
pub use outbox::{Outbox, Outgoing};
pub use retained::Retained;
pub use summary::{OCTAVES, OVERLAP, channel_model, channel_report, unseen_error};
pub use sums::Sums;
pub use uptime::Uptime;
