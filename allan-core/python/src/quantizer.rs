//! What Python passes on: samples in a unit, and time stamps. Their arithmetic is that of allan-core.

use allan_core::{Quantizer, SampleError, TimeStampError, TimeStamps};
use pyo3::exceptions::{PyOverflowError, PyValueError};
use pyo3::prelude::*;

/// Ticks of a sample period, in which time stamps are rounded.
const TICKS: u32 = 1 << 20;

/// Origin and LSB of a quantizer.
pub(crate) type Grid = (f64, f64);

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
        let Some((origin, lsb)) = self.grid else { return Ok(int32(self.bytes)?.into_iter().map(Some).collect()) };
        let quantizer = Quantizer::new(origin, lsb)
            .ok_or_else(|| PyValueError::new_err(format!("no grid has lsb={lsb} and origin={origin}")))?;
        float64(self.bytes)?.zip(self.first..).map(|(value, index)| count(&quantizer, value, index)).collect()
    }
}

/// The count of a sample; `None` where it is missing.
fn count(quantizer: &Quantizer, value: f64, index: u64) -> PyResult<Option<i32>> {
    match quantizer.count(value) {
        Ok(count) => Ok(Some(count)),
        Err(SampleError::NotANumber) => Ok(None),
        Err(SampleError::Infinite) => {
            Err(PyValueError::new_err(format!("sample {index} is {value}: a missing sample is NaN")))
        }
        Err(SampleError::OutOfRange) => {
            let (origin, lsb) = (quantizer.origin(), quantizer.lsb());
            Err(PyOverflowError::new_err(format!(
                "sample {index} is {value}, more than 2**31 steps of lsb={lsb} from origin={origin}: choose a coarser lsb \
                 or another origin"
            )))
        }
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

/// Origin and LSB of [`Quantizer::for_samples`] for the `float64` samples in `samples`.
#[pyfunction]
pub(crate) fn automatic_quantizer(py: Python, samples: &[u8]) -> PyResult<Option<Grid>> {
    py.detach(|| {
        let quantizer = Quantizer::for_samples(float64(samples)?);
        Ok(quantizer.map(|quantizer| (quantizer.origin(), quantizer.lsb())))
    })
}

/// Gaps, each with the index of the sample after it and its length in samples; and when the last sample was expected, s.
type GapsBefore = (Vec<(usize, u32)>, Option<f64>);

/// The gaps that [`TimeStamps`] finds: index of the sample after each and its length in samples, and the time in s at which
/// the last sample was expected. `times` are the `float64` time stamps in s, `previous` is the time at which the sample before
/// the first of them was expected.
#[pyfunction]
pub(crate) fn gaps(py: Python, times: &[u8], rate: f64, previous: Option<f64>) -> PyResult<GapsBefore> {
    py.detach(|| {
        let times = float64(times)?;
        let Some(mut stamps) = TimeStamps::new(TICKS.into()) else { return Ok((Vec::new(), previous)) };
        let (mut gaps, mut start) = (Vec::new(), previous);
        let ticks_a_second = rate * f64::from(TICKS);
        if previous.is_some() {
            stamps.missing(0).map_err(|error| PyValueError::new_err(error.to_string()))?;
        }
        for (index, time) in times.enumerate() {
            let ticks = ((time - *start.get_or_insert(time)) * ticks_a_second).round();
            // Further away a tick count would not fit; the largest gap is 2³² samples.
            let found = match ticks.abs() < (1_u64 << 62) as f64 {
                true => stamps.missing(ticks as i64 as u64),
                false if ticks < 0.0 => Err(TimeStampError::NotLater),
                false => Err(TimeStampError::TooLate),
            };
            match found {
                Ok(0) => {}
                Ok(missing) => gaps.push((index, missing)),
                Err(error) => return Err(PyValueError::new_err(format!("time stamp {index}, {time} s: {error}"))),
            }
        }
        let last = stamps.last().map(|ticks| ticks as i64 as f64 / ticks_a_second);
        Ok((gaps, start.zip(last).map(|(start, last)| start + last)))
    })
}
