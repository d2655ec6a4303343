//! The application that characterises an ADIS16405 while sampling it; the same code runs in the images of all boards
//! and on the host.
//!
//! ```text
//! data-ready edge ─► Sampler ─► burst queue ─► Estimators ─► App ─► transmit queue ─► serial port
//!  acquisition (two interrupts)                (interrupt)   (main loop)
//! ```
//!
//! | module | content |
//! |---|---|
//! | `board`, `microcontroller` | the interface of a board to the application; code that the images of all boards share
//! |
//! | `bus_frame` | frames on the sensor's bus: times of chip select, operations |
//! | [`acquisition`] | bursts at data-ready edges, data-ready monitor |
//! | [`sensor`] | serial clock, probing, auto-null |
//! | `sample_intake` | the path of every sample into the statistics, health counters |
//! | `channels`, `statistics`, `cross_sums` | exact sums of a channel and of pairs of channels; curve and baseline model made of them |
//! | `gross_error_gate` | single samples that noise does not explain |
//! | `scale` | the unit of a count and the measured time between two samples |
//! | [`epoch`] | a finished epoch, regression on covariates, compensated curves |
//! | [`learner`] | models fitted to a finished epoch and validated on the next |
//! | `device` | state of the device, supervision of the sensor |
//! | `recovery`, `status_flags` | steps that recover a sensor in trouble; counts of the causes in its status register |
//! | `watchdog` | proof that every task is alive and the clock runs, for the watchdog |
//! | `report_messages`, `report_frames` | the messages of a report; the report in frames, message by message |
//! | `report_text`, [`number_text`] | the report as a table for people; numbers in it |
//! | [`console`], `answer`, `bench_console` | answers in text; registers, bus times and deflections for a bench |
//! | `event`, `counters` | output for a debug probe: events, and counters that have risen |
//! | `transmit`, `receive`, [`usb_port`] | the queues to and from the serial ports, raw stream; the USB port |
//! | [`command`], `app` | commands, main loop |
//! | [`retained`], `slot`, `epoch_record`, `crash_record` | state that a warm reset keeps |
//! | `stored_state`, [`settings_store`] | state that survives a loss of power, and its flash memory |
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
