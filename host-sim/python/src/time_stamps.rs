//! Gaps between time stamps, by the arithmetic of allan-core.

use allan_core::{TimeStampError, TimeStamps};
use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Ticks per sample period, to which time stamps are rounded.
const TICKS: u32 = 1 << 20;

/// Gaps, each with the index of the sample after it and its length in samples, and the expected time of the last
/// sample, s.
type GapsBefore = (Vec<(usize, u32)>, Option<f64>);

/// The gaps that [`TimeStamps`] finds, each with the index of the sample after it and its length in samples, and the expected time of the
/// last sample in s. `times` are `float64` time stamps in s. `previous` is the expected time of the sample before them.
#[pyfunction]
pub(crate) fn gaps(py: Python, times: PyReadonlyArray1<f64>, rate: f64, previous: Option<f64>) -> PyResult<GapsBefore> {
    let times = times.as_slice()?;
    py.detach(|| {
        let Some(mut stamps) = TimeStamps::new(TICKS.into()) else { return Ok((Vec::new(), previous)) };
        let (mut gaps, mut start) = (Vec::new(), previous);
        let ticks_a_second = rate * f64::from(TICKS);
        if previous.is_some() {
            stamps.missing(0).map_err(|error| PyValueError::new_err(error.to_string()))?;
        }
        for (index, &time) in times.iter().enumerate() {
            let ticks = ((time - *start.get_or_insert(time)) * ticks_a_second).round();
            // At larger times a tick count would not fit; the largest gap is 2³² samples.
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
