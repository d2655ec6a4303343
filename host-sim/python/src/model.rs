//! Noise terms by name, and models fitted to a curve.

use crate::curve::NativeCurve;
use allan_core::fit::{fit as fit_coefficients, fit_shapes, goodness};
use allan_core::model::{Discrepancy, FittedTerm, MAX_TERMS};
use allan_core::term::{CoefficientUnit, LowPass, Markov, MovingAverageFilter, Resonance, Sinusoid};
use allan_core::{Model, NoiseTerm};
use postcard::{from_bytes, to_allocvec};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// A term by its name, with its shape parameters.
pub(crate) type NamedTerm = (String, Vec<f64>);
/// Value, lower and upper bound.
type Interval = (f64, f64, f64);
/// A fitted term: its name, the name of its coefficient, the coefficient, its unit, and the shape parameters by name.
type Row = (&'static str, &'static str, Interval, &'static str, Vec<(&'static str, Interval)>);

/// The model behind `imunoise.Model`.
#[pyclass(frozen, name = "Model", module = "imunoise._native")]
pub(crate) struct NativeModel {
    pub(crate) model: Model,
}

/// The shape parameter of the term `name`, checked to be above 0.
fn positive(name: &str, parameter: &str, value: f64) -> PyResult<f64> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(PyValueError::new_err(format!("{name}: {parameter} is {value}, it must be above 0")))
}

/// The filter with these stages, taps and decimation.
pub(crate) fn filter(stages: f64, taps: f64, decimation: f64) -> PyResult<MovingAverageFilter> {
    if (stages != 1.0 && stages != 2.0) || !(1.0..=128.0).contains(&taps) || taps.fract() != 0.0 {
        return Err(PyValueError::new_err(format!(
            "filter_bandwidth: {stages} stages of {taps} taps, there must be 1 or 2 stages of 1 to 128 taps"
        )));
    }
    if !(decimation >= 1.0 && decimation.is_finite()) {
        return Err(PyValueError::new_err(format!(
            "filter_bandwidth: decimation is {decimation}, it must be 1 or more"
        )));
    }
    Ok(MovingAverageFilter { stages: stages as u8, taps: taps as u16, decimation })
}

fn term(name: &str, shape: &[f64]) -> PyResult<NoiseTerm> {
    Ok(match (name, shape) {
        ("quantization", []) => NoiseTerm::Quantization,
        ("angle_random_walk", []) => NoiseTerm::AngleRandomWalk,
        ("bias_instability", []) => NoiseTerm::BiasInstability,
        ("rate_random_walk", []) => NoiseTerm::RateRandomWalk,
        ("rate_ramp", []) => NoiseTerm::RateRamp,
        ("markov", &[time_constant]) => {
            NoiseTerm::Markov(Markov { time_constant: positive(name, "time_constant", time_constant)? })
        }
        ("resonance", &[frequency, bandwidth]) => NoiseTerm::Resonance(Resonance {
            frequency: positive(name, "frequency", frequency)?,
            bandwidth: positive(name, "bandwidth", bandwidth)?,
        }),
        ("sinusoid", &[frequency]) => {
            NoiseTerm::Sinusoid(Sinusoid { frequency: positive(name, "frequency", frequency)? })
        }
        ("low_pass", &[frequency, damping]) => NoiseTerm::LowPass(LowPass {
            frequency: positive(name, "frequency", frequency)?,
            damping: if damping < 1.0 {
                positive(name, "damping", damping)?
            } else {
                return Err(PyValueError::new_err(format!("{name}: damping is {damping}, it must be below 1")));
            },
        }),
        ("filter_bandwidth", &[stages, taps, decimation]) => NoiseTerm::Filtered(filter(stages, taps, decimation)?),
        _ => {
            return Err(PyValueError::new_err(format!(
                "there is no term {name} with {} shape parameters",
                shape.len()
            )));
        }
    })
}

const fn unit(term: NoiseTerm) -> &'static str {
    match term.unit() {
        CoefficientUnit::TimesSecond => "unit·s",
        CoefficientUnit::TimesRootSecond => "unit·√s",
        CoefficientUnit::Itself => "unit",
        CoefficientUnit::PerRootSecond => "unit/√s",
        CoefficientUnit::PerSecond => "unit/s",
    }
}

fn row(term: &FittedTerm) -> Row {
    let shape = term.shape_parameters().map(|(name, value, (low, high))| (name, (value, low, high))).collect();
    (term.kind.name(), term.kind.coefficient(), (term.value, term.low, term.high), unit(term.kind), shape)
}

#[pymethods]
impl NativeModel {
    /// Seconds between samples.
    fn sample_period(&self) -> f64 {
        self.model.sample_period()
    }

    /// The terms, in the order in which they were given.
    fn terms(&self) -> Vec<Row> {
        self.model.terms().iter().map(row).collect()
    }

    /// Modelled Allan variance at these averaging factors.
    fn avar(&self, factors: Vec<u64>) -> Vec<f64> {
        factors.into_iter().map(|n| self.model.avar(n)).collect()
    }

    /// Modelled two-sided power spectral density at these frequencies in Hz.
    fn density(&self, frequencies: Vec<f64>) -> Vec<f64> {
        frequencies.into_iter().map(|frequency| self.model.density(frequency)).collect()
    }

    /// Deviance and p-value of the model, which was fitted to `curve`.
    fn goodness(&self, py: Python, curve: &NativeCurve) -> (f64, f64) {
        let goodness = py.detach(|| goodness(&curve.curve, &self.model));
        (goodness.deviance, goodness.p_value)
    }

    /// Deviance per point, rms error in percent, and the largest deviation in standard deviations with its averaging time
    /// in s; `None` if the curve has no octave in range.
    fn discrepancy(&self, py: Python, curve: &NativeCurve) -> Option<(f64, f64, f64, f64)> {
        let found = py.detach(|| Discrepancy::between(&self.model, &curve.curve))?;
        Some((found.deviance_per_point, found.rms_percent, found.worst_sigma, found.worst_tau))
    }

    /// The model as bytes.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = to_allocvec(&self.model).map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Restores the model from a [`state`](Self::state).
    #[staticmethod]
    fn from_state(state: &[u8]) -> PyResult<Self> {
        let model = from_bytes(state);
        Ok(Self { model: model.map_err(|error| PyValueError::new_err(format!("not the state of a model: {error}")))? })
    }
}

/// Fits the coefficients of `terms` to `curve`, and their shape parameters if `shapes` is true.
#[pyfunction]
pub(crate) fn fit(py: Python, curve: &NativeCurve, terms: Vec<NamedTerm>, shapes: bool) -> PyResult<NativeModel> {
    if terms.is_empty() || terms.len() > MAX_TERMS {
        return Err(PyValueError::new_err(format!("{} terms: there must be 1 to {MAX_TERMS}", terms.len())));
    }
    let mut kinds = Vec::with_capacity(terms.len());
    for (name, shape) in &terms {
        let term = term(name, shape)?;
        if kinds.contains(&term) {
            return Err(PyValueError::new_err(format!("{name} is given twice")));
        }
        kinds.push(term);
    }
    let estimate = if shapes { fit_shapes } else { fit_coefficients };
    Ok(NativeModel { model: py.detach(|| estimate(&curve.curve, &kinds)) })
}
