//! The command `host-sim`: input errors, equal reports of the ways to read a recording, simulated and measured recordings,
//! and a device on a serial port.

mod analyze_and_replay;
mod input_errors;
mod measured_recordings;
mod program;
mod serial_device;
mod simulated_sensor;
