//! Benchmarks of the noise analysis on recordings with known noise or known hidden effects.

pub mod arguments;
pub mod contradictions;
pub mod filtered_noise;
pub mod losses;
mod parallel;
pub mod reproduction;
mod spectral_noise;
pub mod undeclared;
