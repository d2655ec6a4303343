//! A curve, and its points as plain data.

use crate::OCTAVES;
use allan_core::{AllanPoint, Curve, PowerLaw};
use postcard::{from_bytes, to_allocvec};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// A point: n, τ, σ², its lower and upper bound, edf, count, overlap, share of replaced samples, kurtosis and power
/// law.
type Row = (u64, f64, f64, f64, f64, f64, u64, u32, f64, Option<f64>, &'static str);

/// The curve behind `imunoise.Curve`.
#[pyclass(frozen, name = "Curve", module = "imunoise._native")]
pub(crate) struct NativeCurve {
    pub(crate) curve: Curve<OCTAVES>,
}

const fn power_law(law: PowerLaw) -> &'static str {
    match law {
        PowerLaw::Quantization => "quantization",
        PowerLaw::White => "white",
        PowerLaw::Flicker => "flicker",
        PowerLaw::RandomWalk => "random_walk",
    }
}

fn row(point: &AllanPoint) -> Row {
    let AllanPoint { n, tau, avar, low, high, edf, count, overlap, replaced, kurtosis, .. } = *point;
    (n, tau, avar, low, high, edf, count, overlap, replaced, kurtosis, power_law(point.power_law))
}

#[pymethods]
impl NativeCurve {
    /// Seconds between samples.
    fn sample_period(&self) -> f64 {
        self.curve.sample_period()
    }

    /// Samples that the curve was made of.
    fn samples(&self) -> u64 {
        self.curve.samples()
    }

    /// The points, shortest averaging time first.
    fn points(&self) -> Vec<Row> {
        self.curve.points().iter().map(row).collect()
    }

    /// The curve restricted to averaging times from `shortest` to `longest`, s.
    fn between(&self, shortest: f64, longest: f64) -> Self {
        let mut curve = self.curve.clone();
        curve.retain(|point| (shortest..=longest).contains(&point.tau));
        Self { curve }
    }

    /// The curve as bytes.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = to_allocvec(&self.curve).map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Restores the curve from a [`state`](Self::state).
    #[staticmethod]
    fn from_state(state: &[u8]) -> PyResult<Self> {
        let curve = from_bytes(state);
        Ok(Self { curve: curve.map_err(|error| PyValueError::new_err(format!("not the state of a curve: {error}")))? })
    }
}
