//! The application that characterises an ADIS16405 while sampling it; the same code runs in the images of all boards
//! and on the host.
//!
//! ```text
//! data-ready edge ─► Sampler ─► burst queue ─► Estimators ─► App ─► transmit queue ─► serial port
//!  acquisition (two interrupts)                (interrupt)   (main loop)
//! ```
//!
//! Sampling has priority over the estimators, and these over the main loop. Interrupts that share a locked resource
//! wait; locks are short.
#![no_std]
#![deny(unsafe_code)]
#![deny(missing_docs)]

pub mod acquisition;
mod answer;
mod app;
mod bench_console;
mod board;
#[cfg_attr(
    not(target_os = "none"),
    allow(dead_code, reason = "the images use all of it, and its tests what they test")
)]
mod bus_frame;
mod channels;
pub mod command;
pub mod console;
mod counters;
mod crash_record;
mod cross_sums;
mod device;
pub mod epoch;
mod epoch_record;
mod event;
mod gross_error_gate;
pub mod learner;
#[cfg(all(target_os = "none", feature = "microcontroller"))]
#[allow(unsafe_code, reason = "registers, and memory that is not initialised at the start")]
pub mod microcontroller;
pub mod number_text;
mod receive;
mod recovery;
mod report_frames;
mod report_messages;
mod report_text;
pub mod retained;
mod sample_intake;
mod scale;
pub mod sensor;
pub mod settings_store;
mod slot;
mod statistics;
mod status_flags;
mod stored_state;
mod transmit;
pub mod usb_port;
#[cfg_attr(
    not(target_os = "none"),
    allow(dead_code, reason = "the images use all of it, and its tests what they test")
)]
mod watchdog;

pub use acquisition::{BurstQueue, EdgeAction, Sampler, SamplingActivity, TimedBurst};
pub use app::{App, Start, run};
pub use board::{Board, BrownOutLevel, BusTiming, FrameTimes, SelectTiming, Uptime};
pub use bus_frame::{BusFault, ByteExchange, MicrosecondCounter};
pub use crash_record::CrashRecord;
pub use device::FIRST_CONFIG;
pub use epoch::FinishedEpoch;
pub use receive::{HostPort, ReceiveBuffer, ReceivedBytes, Receiver, ServedPort};
pub use retained::RetainedRam;
pub use sample_intake::{Estimators, estimate};
pub use scale::ReportScale;
pub use statistics::{CHANNELS, ChannelEstimator, ChannelSums, OCTAVES, OVERLAP, Statistics};
pub use transmit::{TransmitBuffer, TransmitQueue};
pub use watchdog::{Feeder, FeedingDelay, Watchdog, WatchdogExtension};
