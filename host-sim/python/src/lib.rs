//! The compiled half of the Python module `imunoise`. The other half, in `package/imunoise`, converts the users' lists,
//! series, time stamps and names into arrays and numbers, and wraps the results in arrays.
//!
//! Arrays are read in place, without the global interpreter lock. As with functions of NumPy, no other thread may write
//! to them meanwhile. No method holds a mutex while it waits for that lock.

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
