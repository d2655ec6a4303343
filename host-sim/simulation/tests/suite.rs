//! Every test of this crate in one program, so that what it links is compiled and linked once.

mod commands;
mod device;
mod effects;
mod epochs;
mod fault_grid;
mod faults;
mod refused_bursts;
mod replayed_files;
mod settling;
mod week;
