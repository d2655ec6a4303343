//! The command `imunoise`: its help, exit codes, streams and signals, the files that it writes, the live screen, and a device on a serial port;
//! each verb once. `recordings` tests the reading of files, `reports` the sentences of a report.

mod analyze_and_replay;
mod bench;
mod convert_and_simulate;
mod documented_options;
mod exit_codes;
mod help;
mod inspection;
mod live_screen;
mod many_and_interrupted;
mod measured_recordings;
mod outputs;
mod pipes;
mod program;
mod quick_report;
mod reading_limits;
mod recorded_screens;
mod report_output;
mod serial_device;
mod serial_faults;
mod several_recordings;
mod simulated_sensor;
mod walkthrough;
