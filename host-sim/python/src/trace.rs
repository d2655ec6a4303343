//! The search for missing terms, which Ctrl-C or a function of the user can cancel.

use crate::curve::NativeCurve;
use crate::model::{NativeModel, filter};
use allan_core::term::Sinusoid;
use allan_core::trace::{LineCandidates, Trace, trace_while};
use allan_core::{Model, NoiseTerm};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// An added term: its index in the final model, its score, and the largest residual before it was added, by averaging
/// factor, excess and standard deviations.
type Added = (usize, f64, u64, f64, f64);
/// The two models, each with deviance and p-value, the added terms, and true if the search was completed.
type Found = ((NativeModel, f64, f64), (NativeModel, f64, f64), Vec<Added>, bool);

/// Fits N, B and K to `curve` and adds the missing terms.
///
/// `lines` are frequencies in Hz from a spectrum; `filters` are stages, taps and decimation of the sensor's possible
/// filters. `keep_on` is called between the fits. If it returns false, the search ends.
#[pyfunction]
#[pyo3(signature = (curve, lines, filters, keep_on))]
pub(crate) fn trace(
    py: Python,
    curve: &NativeCurve,
    lines: Option<Vec<f64>>,
    filters: Vec<(f64, f64, f64)>,
    keep_on: Option<Py<PyAny>>,
) -> PyResult<Found> {
    let filters = filters
        .into_iter()
        .map(|(stages, taps, decimation)| filter(stages, taps, decimation))
        .collect::<PyResult<Vec<_>>>()?;
    if let Some(frequency) = lines.iter().flatten().find(|&&frequency| !(frequency > 0.0 && frequency.is_finite())) {
        return Err(PyValueError::new_err(format!("a line at {frequency} Hz: the frequency must be above 0")));
    }
    let lines: Option<Vec<NoiseTerm>> =
        lines.map(|lines| lines.into_iter().map(|frequency| NoiseTerm::Sinusoid(Sinusoid { frequency })).collect());
    let candidates = lines.as_deref().map_or(LineCandidates::Curve, LineCandidates::Spectrum);
    let mut error = None;
    let (found, completed) = py.detach(|| {
        let mut found = Box::new(Trace::baseline(&curve.curve));
        let mut attend = || {
            let answer = Python::attach(|py| {
                py.check_signals()?;
                keep_on.as_ref().map_or(Ok(true), |keep_on| keep_on.call0(py)?.is_truthy(py))
            });
            answer.unwrap_or_else(|raised| {
                error = Some(raised);
                false
            })
        };
        let completed = trace_while(&mut found, &curve.curve, candidates, &filters, &mut attend);
        (found, completed)
    });
    if let Some(error) = error {
        return Err(error);
    }
    let native = |model: &Model| NativeModel { model: model.clone() };
    let before = (native(&found.before), found.before_goodness.deviance, found.before_goodness.p_value);
    let after = (native(&found.after), found.after_goodness.deviance, found.after_goodness.p_value);
    let added = found.added.iter();
    let added = added.map(|added| {
        let residual = added.residual;
        (added.term, added.score, residual.n, residual.excess, residual.sigmas)
    });
    Ok((before, after, added.collect(), completed))
}
