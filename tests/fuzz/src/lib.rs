//! Readers of untrusted bytes, each as a function of the bytes. The function must return; it panics if a guarantee is broken.
//! `tests/corpus.rs` calls them with the bytes in `corpus`, and the example `fuzz` lets libFuzzer search for others.

mod c_interface;
mod device;
mod driver;
mod files;
mod serial_line;
mod state;

/// The name of a target, which is also its folder in `corpus`, and its function.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 8] = [
    ("driver", driver::answers_of_the_bus),
    ("recording", files::recording),
    ("report", files::report),
    ("serial", serial_line::stream),
    ("state", state::estimators),
    ("settings", state::settings),
    ("commands", device::commands),
    ("c_interface", c_interface::calls),
];
