//! Every test of this crate in one program, so that what it links is compiled and linked once.

mod sample_intake;
mod settings_store;
#[path = "usb_port/main.rs"]
mod usb_port;
