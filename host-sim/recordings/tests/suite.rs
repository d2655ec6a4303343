//! Every test of this crate in one program, so that what it links is compiled and linked once.

mod clocks;
mod coarse_stamps;
mod irregular_stamps;
mod one_path;
#[path = "reading/main.rs"]
mod reading;
mod serial;
mod time_base;
