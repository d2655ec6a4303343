//! Yardsticks of the noise analysis.

pub mod paper;
pub mod undeclared;
