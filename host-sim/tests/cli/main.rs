//! The command `host-sim`: its help, input errors, what is in a file, damaged input, equal reports of the ways to read a recording, simulated and measured recordings,
//! exports, conversions, the live screen, quick reports, reports of many files, and a device on a serial port.

mod analyze_and_replay;
mod convert_and_simulate;
mod damaged_input;
mod documented_options;
mod exports;
mod formats;
mod help;
mod input_errors;
mod inspection;
mod live_screen;
mod many_and_interrupted;
mod measured_recordings;
mod other_recordings;
mod outputs;
mod program;
mod quick_report;
mod reading_limits;
mod recorded_screens;
mod report_output;
mod serial_device;
mod serial_faults;
mod several_recordings;
mod simulated_sensor;
mod stretches;
mod text_formats;
mod walkthrough;
