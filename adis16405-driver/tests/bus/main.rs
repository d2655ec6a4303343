//! The exact bytes and pauses of every public method, on the blocking and on the asynchronous driver. Addresses, bits
//! and times are copied from the data sheet, not taken from the driver.

#[macro_use]
mod harness;

mod calibration;
mod commands;
mod pins_and_alarms;
mod registers_and_bursts;
mod self_test;
