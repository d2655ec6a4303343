//! Every test of this crate in one program, so that what it links is compiled and linked once.

#[path = "architecture/main.rs"]
mod architecture;
#[path = "attack/main.rs"]
mod attack;
#[path = "boards/main.rs"]
mod boards;
mod estimator;
mod formatted;
mod links;
mod recorded_words;
mod recordings;
mod reproducible_image;
mod wires;
