//! The command line of the noise observatory.

pub mod cli;
pub mod monitor;
pub mod uf2;
