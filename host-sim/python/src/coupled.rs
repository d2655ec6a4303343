//! A channel and covariates sampled together, and the regression of the channel on the covariates.

use crate::OCTAVES;
use crate::curve::NativeCurve;
use crate::samples::{Array, Counts, Grid, Rest, Values};
use allan_core::regression::{Covariate, CovariateRegression, MAX_COVARIATES};
use allan_core::{Cascade, Coupling};
use postcard::{from_bytes, to_allocvec};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::sync::{Mutex, MutexGuard, PoisonError};

const OVERLAP: usize = 8;

/// Index of a covariate, its sensitivity with lower and upper bound, and its significance in standard deviations.
type Row = (usize, f64, f64, f64, f64);
/// Samples of one channel: an array, and a grid of origin and LSB for values in a unit.
type Samples<'py> = (Array<'py>, Option<Grid>);

/// The channels, the regressed one first, and the coupling of each with all channels before it.
#[derive(Clone)]
struct Channels {
    cascades: Vec<Cascade<OCTAVES, OVERLAP>>,
    couplings: Vec<Coupling<OCTAVES>>,
}

/// Index of the coupling of two different channels.
fn pair(a: usize, b: usize) -> usize {
    let (low, high) = (a.min(b), a.max(b));
    high * (high - 1) / 2 + low
}

/// The counts of a channel's samples; `None` for a missing sample.
fn column(mut counts: Counts, values: Values) -> PyResult<Vec<Option<i32>>> {
    let mut column = Vec::with_capacity(values.len());
    counts.each_run(values, |counts, rest| {
        column.extend(counts.iter().copied().map(Some));
        if let Rest::Missing = rest {
            column.push(None);
        }
    })?;
    Ok(column)
}

impl Channels {
    fn push(&mut self, columns: &[Vec<Option<i32>>]) {
        for row in 0..columns.first().map_or(0, Vec::len) {
            for (cascade, column) in self.cascades.iter_mut().zip(columns) {
                match column[row] {
                    Some(count) => cascade.push(count),
                    None => cascade.gap(1),
                }
            }
            for a in 1..columns.len() {
                for b in (0..a).filter(|&b| columns[a][row].is_some() && columns[b][row].is_some()) {
                    self.couplings[pair(a, b)].observe(&self.cascades[a], &self.cascades[b]);
                }
            }
        }
    }
}

/// The estimators behind `imunoise.CovariateRegression`.
#[pyclass(frozen, module = "imunoise._native")]
pub(crate) struct CoupledEstimators {
    channels: Mutex<Channels>,
}

impl CoupledEstimators {
    fn lock(&self) -> MutexGuard<'_, Channels> {
        // After a panic in another thread the sums are still valid.
        self.channels.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl CoupledEstimators {
    #[new]
    fn new(covariates: usize) -> PyResult<Self> {
        if !(1..=MAX_COVARIATES).contains(&covariates) {
            let message = format!("{covariates} covariates: there must be 1 to {MAX_COVARIATES}");
            return Err(PyValueError::new_err(message));
        }
        let cascades = vec![Cascade::new(); covariates + 1];
        let couplings = vec![Coupling::new(); pair(0, covariates + 1)];
        Ok(Self { channels: Mutex::new(Channels { cascades, couplings }) })
    }

    /// Adds samples taken together. `first` is the index of the first one in the user's arrays, for messages. If a
    /// value is refused, no sample is added.
    fn push(&self, py: Python, channels: Vec<Samples>, first: u64) -> PyResult<()> {
        let samples = channels.iter().map(|(array, grid)| Ok((Counts::new(*grid, first)?, array.values())));
        let samples = samples.collect::<PyResult<Vec<_>>>()?;
        py.detach(|| {
            let columns =
                samples.into_iter().map(|(counts, values)| column(counts, values)).collect::<PyResult<Vec<_>>>()?;
            let mut channels = self.lock();
            if columns.len() != channels.cascades.len() {
                let (given, expected) = (columns.len(), channels.cascades.len());
                return Err(PyValueError::new_err(format!("{given} arrays for {expected} channels")));
            }
            if columns.iter().any(|column| column.len() != columns[0].len()) {
                return Err(PyValueError::new_err("the arrays have different lengths"));
            }
            channels.push(&columns);
            Ok(())
        })
    }

    /// Records that `missing` samples of all channels are missing before the next ones.
    fn gap(&self, py: Python, missing: u32) {
        py.detach(|| self.lock().cascades.iter_mut().for_each(|cascade| cascade.gap(missing)));
    }

    /// Number of samples of the regressed channel.
    fn samples(&self, py: Python) -> u64 {
        py.detach(|| self.lock().cascades[0].len())
    }

    /// The channel's curve, the significant sensitivities, and the curve without the dependence on them.
    ///
    /// `lsbs` are the units per count, the channel's first.
    fn regress(
        &self,
        py: Python,
        sample_period: f64,
        lsbs: Vec<f64>,
    ) -> PyResult<(NativeCurve, Vec<Row>, NativeCurve)> {
        py.detach(|| {
            let channels = self.lock();
            if lsbs.len() != channels.cascades.len() {
                let (given, expected) = (lsbs.len(), channels.cascades.len());
                return Err(PyValueError::new_err(format!("{given} units per count for {expected} channels")));
            }
            let curve = |index: usize| channels.cascades[index].curve(sample_period).scaled(lsbs[index]);
            let channel = curve(0);
            let covariates: Vec<Covariate<OCTAVES>> =
                (1..lsbs.len()).map(|index| Covariate::new(&curve(index), lsbs[index], 1)).collect();
            let points: Vec<_> = channels.couplings.iter().map(Coupling::points).collect();
            let covariance = |other: Option<usize>, covariate: usize, n: u64| {
                let (a, b) = (other.map_or(0, |other| other + 1), covariate + 1);
                let at_n = points.get(pair(a, b))?.iter().find(|point| point.n == n)?;
                Some(at_n.covariance * lsbs[a] * lsbs[b])
            };
            let regression =
                CovariateRegression { channel: &channel, covariates: &covariates, covariance: &covariance };
            let sensitivities = regression.sensitivities();
            let row = |found: &allan_core::regression::Sensitivity| {
                let (low, high) = found.bounds();
                (found.covariate, found.value, low, high, found.sigmas())
            };
            let rows = sensitivities.iter().map(row).collect();
            let compensated = NativeCurve { curve: regression.compensated(&sensitivities) };
            Ok((NativeCurve { curve: channel.clone() }, rows, compensated))
        })
    }

    /// Copies the estimators with their state.
    fn copy(&self, py: Python) -> Self {
        py.detach(|| Self { channels: Mutex::new(self.lock().clone()) })
    }

    /// The whole state as bytes, with versions and checksums.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| {
            let channels = self.lock();
            to_allocvec(&(&channels.cascades, &channels.couplings))
        });
        Ok(PyBytes::new(py, &bytes.map_err(|error| PyRuntimeError::new_err(error.to_string()))?))
    }

    /// Restores the estimators from a [`state`](Self::state).
    #[staticmethod]
    fn from_state(py: Python, state: &[u8]) -> PyResult<Self> {
        let found: Result<(Vec<_>, Vec<_>), _> = py.detach(|| from_bytes(state));
        let (cascades, couplings) =
            found.map_err(|error| PyValueError::new_err(format!("not the state of estimators: {error}")))?;
        if !(2..=MAX_COVARIATES + 1).contains(&cascades.len()) || couplings.len() != pair(0, cascades.len()) {
            return Err(PyValueError::new_err("not the state of estimators: the numbers of channels and pairs"));
        }
        Ok(Self { channels: Mutex::new(Channels { cascades, couplings }) })
    }
}
