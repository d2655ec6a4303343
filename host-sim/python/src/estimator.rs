//! The estimator of one channel, with any overlap.

use crate::OCTAVES;
use crate::curve::NativeCurve;
use crate::samples::{Array, Counts, Grid, Rest, Values};
use allan_core::Cascade;
use postcard::{from_bytes, to_allocvec};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A cascade, by its overlap.
#[derive(Clone)]
enum AnyOverlap {
    One(Box<Cascade<OCTAVES, 1>>),
    Two(Box<Cascade<OCTAVES, 2>>),
    Four(Box<Cascade<OCTAVES, 4>>),
    Eight(Box<Cascade<OCTAVES, 8>>),
    Sixteen(Box<Cascade<OCTAVES, 16>>),
}

/// Evaluates an expression with the cascade of an [`AnyOverlap`].
macro_rules! with_cascade {
    ($any:expr, $cascade:ident => $expression:expr) => {
        match $any {
            AnyOverlap::One($cascade) => $expression,
            AnyOverlap::Two($cascade) => $expression,
            AnyOverlap::Four($cascade) => $expression,
            AnyOverlap::Eight($cascade) => $expression,
            AnyOverlap::Sixteen($cascade) => $expression,
        }
    };
}

impl AnyOverlap {
    fn new(overlap: u32) -> PyResult<Self> {
        match overlap {
            1 => Ok(Self::One(Box::default())),
            2 => Ok(Self::Two(Box::default())),
            4 => Ok(Self::Four(Box::default())),
            8 => Ok(Self::Eight(Box::default())),
            16 => Ok(Self::Sixteen(Box::default())),
            _ => Err(PyValueError::new_err(format!("overlap is {overlap}: it must be 1, 2, 4, 8 or 16"))),
        }
    }

    fn push(&mut self, mut counts: Counts, values: Values) -> PyResult<()> {
        counts.each_run(values, |counts, rest| {
            with_cascade!(self, cascade => {
                cascade.push_slice(counts);
                if let Rest::Missing = rest {
                    cascade.gap(1);
                }
            });
        })
    }

    fn gap(&mut self, mut missing: u64) {
        while missing > 0 {
            let some = u32::try_from(missing).unwrap_or(u32::MAX);
            with_cascade!(self, cascade => cascade.gap(some));
            missing -= u64::from(some);
        }
    }
}

/// The estimator behind `imunoise.Cascade`.
#[pyclass(frozen, module = "imunoise._native")]
pub(crate) struct Estimator {
    cascade: Mutex<AnyOverlap>,
}

impl Estimator {
    fn lock(&self) -> MutexGuard<'_, AnyOverlap> {
        // After a panic in another thread the sums are still valid.
        self.cascade.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Estimator {
    #[new]
    fn new(overlap: u32) -> PyResult<Self> {
        Ok(Self { cascade: Mutex::new(AnyOverlap::new(overlap)?) })
    }

    /// Adds the samples of an array: counts, or values in a unit if `grid` is `(origin, lsb)`.
    ///
    /// `first` is the index of the first sample in the user's array, for messages. If a value is refused, some samples
    /// before it have been added.
    fn push(&self, py: Python, samples: Array, grid: Option<Grid>, first: u64) -> PyResult<()> {
        let (values, counts) = (samples.values(), Counts::new(grid, first)?);
        py.detach(|| self.lock().push(counts, values))
    }

    /// Records that `missing` samples are missing before the next one.
    fn gap(&self, py: Python, missing: u64) {
        py.detach(|| self.lock().gap(missing));
    }

    /// Adds the sums of another estimator with the same overlap, which has seen a later part of the record.
    fn merge(&self, py: Python, later: &Self) -> PyResult<()> {
        py.detach(|| {
            // A copy is needed, since both may be the same object.
            let later = later.lock().clone();
            match (&mut *self.lock(), &later) {
                (AnyOverlap::One(first), AnyOverlap::One(later)) => first.merge(later),
                (AnyOverlap::Two(first), AnyOverlap::Two(later)) => first.merge(later),
                (AnyOverlap::Four(first), AnyOverlap::Four(later)) => first.merge(later),
                (AnyOverlap::Eight(first), AnyOverlap::Eight(later)) => first.merge(later),
                (AnyOverlap::Sixteen(first), AnyOverlap::Sixteen(later)) => first.merge(later),
                _ => return Err(PyValueError::new_err("the estimators have different overlaps")),
            }
            Ok(())
        })
    }

    /// Number of samples, number of missing samples, and number of missing samples that the curve replaces.
    fn samples(&self, py: Python) -> (u64, u64, u64) {
        py.detach(|| with_cascade!(&*self.lock(), cascade => (cascade.len(), cascade.missing(), cascade.replaced())))
    }

    /// True if a sum of squares is full.
    fn is_saturated(&self, py: Python) -> bool {
        py.detach(|| with_cascade!(&*self.lock(), cascade => cascade.is_saturated()))
    }

    /// The curve for samples every `sample_period` seconds, in units of `lsb`.
    fn curve(&self, py: Python, sample_period: f64, lsb: f64) -> NativeCurve {
        py.detach(|| {
            let curve = with_cascade!(&*self.lock(), cascade => cascade.curve(sample_period));
            NativeCurve { curve: curve.scaled(lsb) }
        })
    }

    /// Copies the estimator with its state.
    fn copy(&self, py: Python) -> Self {
        py.detach(|| Self { cascade: Mutex::new(self.lock().clone()) })
    }

    /// The whole state as bytes, with version and checksum.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| with_cascade!(&*self.lock(), cascade => to_allocvec(cascade)));
        let bytes = bytes.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Restores an estimator with this overlap from a [`state`](Self::state).
    #[staticmethod]
    fn from_state(py: Python, overlap: u32, state: &[u8]) -> PyResult<Self> {
        let cascade = py.detach(|| {
            let mut cascade = AnyOverlap::new(overlap)?;
            with_cascade!(&mut cascade, cascade => match from_bytes(state) {
                Ok(state) => **cascade = state,
                Err(error) => return Err(PyValueError::new_err(format!("not the state of an estimator: {error}"))),
            });
            Ok(cascade)
        })?;
        Ok(Self { cascade: Mutex::new(cascade) })
    }
}
