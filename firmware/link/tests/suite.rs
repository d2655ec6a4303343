//! Every test of this crate in one program, so that what it links is compiled and linked once.

mod frames;
mod kept_stream;
