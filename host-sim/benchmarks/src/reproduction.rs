//! Reproduction of the paper on simulated hours of its gyro z with known coefficients (L. Hristov, E. Iontchev and R.
//! Miletiev, "Error modeling of MEMS ADIS 16405").
//!
//! ```text
//! seed ─► published gyro (virtual sensor) ─► slope method and fit ─► tables.py: bias and scatter over the seeds
//!                                         └► four methods on the record of the first seed
//! ```

mod bias_and_scatter;
mod four_methods;
mod published_gyro;

pub use bias_and_scatter::{Hour, PredictedScatter, Reproduction, ReproductionResult};
pub use four_methods::{
    Autocorrelation, FourMethods, InnovationTest, MethodCoefficients, SpectrumOctave, allan_weight,
};
pub use published_gyro::{INTERVALS, RATE_HZ, SECONDS, TRUTH, slope_coefficients};
