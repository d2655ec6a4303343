//! Every test of this crate in one program, so that what it links is compiled and linked once.

mod four_methods;
mod losses;
mod program;
mod recordings;
mod reproduction;
mod tables;
