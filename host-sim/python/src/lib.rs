//! The compiled half of the Python module `imunoise`. The other half, in `package/imunoise`, turns what users have
//! (lists, series, time stamps, names) into arrays and numbers, and wraps the results in arrays.
//!
//! Arrays are read where they are, without the global interpreter lock: another thread must not write to them meanwhile, as
//! with the functions of NumPy. No method holds a mutex while it waits for that lock.

mod analysis;
mod arrays;
mod coupled;
mod curve;
mod estimator;
mod model;
mod report;
mod samples;
mod time_stamps;
mod trace;

/// Octaves of every estimator: averaging factors up to 2³⁰ samples.
const OCTAVES: usize = 31;

#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use super::analysis::{RecordingError, analyze, command};
    #[pymodule_export]
    use super::arrays::Arrays;
    #[pymodule_export]
    use super::coupled::CoupledEstimators;
    #[pymodule_export]
    use super::curve::NativeCurve;
    #[pymodule_export]
    use super::estimator::Estimator;
    #[pymodule_export]
    use super::model::{NativeModel, fit};
    #[pymodule_export]
    use super::report::{NativeReport, Rows};
    #[pymodule_export]
    use super::samples::automatic_quantizer;
    #[pymodule_export]
    use super::time_stamps::gaps;
    #[pymodule_export]
    use super::trace::trace;
}
