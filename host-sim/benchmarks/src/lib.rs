//! Benchmarks of the noise analysis on simulated recordings, whose true noise and effects are known.

pub mod losses;
mod parallel;
pub mod reproduction;
mod spectral_noise;
pub mod undeclared;
