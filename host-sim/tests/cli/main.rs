//! The command `host-sim`: input errors, damaged input, equal reports of the ways to read a recording, simulated and measured recordings,
//! and a device on a serial port.

mod analyze_and_replay;
mod damaged_input;
mod input_errors;
mod measured_recordings;
mod program;
mod serial_device;
mod serial_faults;
mod simulated_sensor;
