//! Samples in a unit as the counts of a grid: value = origin + count·lsb.

use pyo3::exceptions::{PyOverflowError, PyValueError};
use pyo3::prelude::*;

/// Steps of the automatic grid in the standard deviation of white noise with the same differences: rounding then adds
/// `2⁻³²/12`, or 2·10⁻¹¹, of its variance, and the 32 bits of a count reach 32,768 of these deviations to either side.
const STEPS: f64 = 65_536.0;

/// The grid of an estimator.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grid {
    pub(crate) origin: f64,
    pub(crate) lsb: f64,
}

/// A chunk of samples as Python passes it on: the bytes of an array in the byte order of this machine, the grid if they are
/// `float64` and not `int32`, and the index of the first one in the user's array, for messages.
#[derive(Clone, Copy)]
pub(crate) struct Chunk<'a> {
    pub(crate) bytes: &'a [u8],
    pub(crate) grid: Option<Grid>,
    pub(crate) first: u64,
}

impl Chunk<'_> {
    /// The samples in counts; `None` where a value is missing, that is NaN.
    pub(crate) fn counts(self) -> PyResult<Vec<Option<i32>>> {
        let Some(grid) = self.grid else { return Ok(int32(self.bytes)?.into_iter().map(Some).collect()) };
        float64(self.bytes)?.zip(self.first..).map(|(value, index)| grid.count(value, index)).collect()
    }
}

impl Grid {
    fn count(self, value: f64, index: u64) -> PyResult<Option<i32>> {
        if value.is_nan() {
            return Ok(None);
        }
        if value.is_infinite() {
            return Err(PyValueError::new_err(format!("sample {index} is {value}: a missing sample is NaN")));
        }
        let count = ((value - self.origin) / self.lsb).round_ties_even();
        if count.abs() > f64::from(i32::MAX) {
            let Self { origin, lsb } = self;
            return Err(PyOverflowError::new_err(format!(
                "sample {index} is {value}, more than 2**31 steps of lsb={lsb} from origin={origin}: choose a coarser lsb \
                 or another origin"
            )));
        }
        Ok(Some(count as i32))
    }
}

/// The `int32` values of `bytes`.
pub(crate) fn int32(bytes: &[u8]) -> PyResult<Vec<i32>> {
    let (values, rest) = bytes.as_chunks::<4>();
    whole(rest)?;
    Ok(values.iter().map(|&value| i32::from_ne_bytes(value)).collect())
}

/// The `float64` values of `bytes`.
fn float64(bytes: &[u8]) -> PyResult<impl Iterator<Item = f64>> {
    let (values, rest) = bytes.as_chunks::<8>();
    whole(rest)?;
    Ok(values.iter().map(|&value| f64::from_ne_bytes(value)))
}

fn whole(rest: &[u8]) -> PyResult<()> {
    if rest.is_empty() { Ok(()) } else { Err(PyValueError::new_err("the bytes end within a sample")) }
}

/// Origin and LSB of a grid that is fine enough for the `float64` samples in `samples`: the first value, and the largest
/// power of two below `1/65536` of the root mean square of `(x[i+1] − x[i])/√2`.
///
/// `None` if no two neighbouring samples are finite and different.
#[pyfunction]
pub(crate) fn automatic_quantizer(py: Python, samples: &[u8]) -> PyResult<Option<(f64, f64)>> {
    py.detach(|| {
        let (mut origin, mut previous) = (None, f64::NAN);
        let (mut sum, mut count) = (0.0, 0_u64);
        for value in float64(samples)? {
            if value.is_finite() {
                origin.get_or_insert(value);
            }
            let difference = value - previous;
            previous = value;
            if difference.is_finite() {
                sum += difference * difference / 2.0;
                count += 1;
            }
        }
        let lsb = ((sum / count as f64).sqrt() / STEPS).log2().floor().exp2();
        Ok(origin.filter(|_| lsb.is_normal()).map(|origin| (origin, lsb)))
    })
}
