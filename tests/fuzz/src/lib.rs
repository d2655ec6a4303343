//! Readers of bytes that someone else has written, each as a function of these bytes that has to return: it panics where a promise is
//! broken. `tests/corpus.rs` calls them with the bytes that are kept in `corpus`; the example `fuzz` has libFuzzer look for others.

mod c_interface;
mod device;
mod driver;
mod files;
mod serial_line;
mod state;

/// A target and its name, which is that of its folder in `corpus`.
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
