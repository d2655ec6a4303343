//! Every test of this crate in one program, so that what it links is compiled and linked once.

mod any_answer;
#[path = "bus/main.rs"]
mod bus;
mod configuration;
mod decoding;
mod interrupted;
mod send;
mod validity;
