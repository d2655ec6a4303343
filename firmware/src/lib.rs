//! The application that characterises an ADIS16405 while it runs: the same code on every board and on the host.
//!
//! ```text
//! data-ready edge ─► Acquisition ─► queue ─► App ─► link frames ─► Sink
//!   (interrupt)      one burst      bursts   judge, estimate, report
//! ```
//!
//! A board brings pins, clocks and interrupts, and calls [`Acquisition::on_data_ready`] from the interrupt and
//! [`App::take`], [`App::command`] and [`App::poll`] from its main loop.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod acquisition;
pub mod app;
pub mod spi_clock;
mod summary;
mod uptime;

pub use acquisition::{Acquisition, Arrival, Queue, bring_up};
pub use app::{App, Settings, Sink, log_frame};
pub use summary::{OCTAVES, OVERLAP, channel_report};
pub use uptime::Uptime;
