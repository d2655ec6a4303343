//! Benchmarks of the noise analysis on recordings whose true noise, or what is hidden in it, is known.

pub mod contradictions;
pub mod filtered_noise;
pub mod losses;
mod parallel;
pub mod reproduction;
mod spectral_noise;
pub mod undeclared;
