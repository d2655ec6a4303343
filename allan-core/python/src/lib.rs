//! The compiled half of the Python module `allan_core`. The other half, in `package/allan_core`, turns what users have
//! (arrays of any dtype, time stamps, names) into bytes and numbers, and wraps the results in arrays.
//!
//! Samples arrive as `bytes`, which are immutable: they are read without the global interpreter lock. No method holds a
//! mutex while it waits for that lock.
#![forbid(unsafe_code)]

mod coupled;
mod curve;
mod estimator;
mod model;
mod quantizer;
mod trace;

/// Octaves of every estimator: averaging factors up to 2³⁰ samples.
const OCTAVES: usize = 31;

#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use super::coupled::CoupledEstimators;
    #[pymodule_export]
    use super::curve::NativeCurve;
    #[pymodule_export]
    use super::estimator::Estimator;
    #[pymodule_export]
    use super::model::{NativeModel, fit};
    #[pymodule_export]
    use super::quantizer::{automatic_quantizer, gaps};
    #[pymodule_export]
    use super::trace::trace;
}
