//! Exact bytes and pauses of every public method, through both shells. Addresses, bits and times are written down again
//! here from the data sheet and its like, not taken from the driver.

#[macro_use]
mod harness;

mod alarms;
mod commands;
mod corrections;
mod frames;
mod pins;
mod self_tests;
mod start;
