//! Every test of this crate in one program, so that what it links is compiled and linked once.

mod data_ready;
mod deliberate_bugs;
mod driver;
mod faults;
mod misbehaving_part;
mod noise;
mod other_drivers;
mod procedures;
mod registers;
