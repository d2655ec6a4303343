//! Input from Python: arrays of samples, read in place, and their counts.

use allan_core::{Quantizer, SampleError};
use numpy::ndarray::{ArrayView1, Axis, Slice};
use numpy::{PyReadonlyArray1, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use std::fmt::Display;

/// Origin and LSB of a quantizer.
pub(crate) type Grid = (f64, f64);

/// Number of samples converted together; their counts stay in the nearest cache.
const BLOCK: usize = 4096;

/// Automatic steps of single precision over those of double precision: 1/256 of the deviation of white noise, to whose variance rounding adds
/// 1.3·10⁻⁶. Differences then have few bits, which are squared in half of the time.
const SINGLE_PRECISION: f64 = 256.0;

/// The automatic step of an array of this many samples is that of one stretch in so many, each of so many samples. Their deviation is known
/// to 1 %, and the step is a power of two. If no neighbours in them differ, all samples are taken.
const LONG: usize = 1 << 17;
const APART: usize = 16;
const STRETCH: usize = 64;

/// Declares the dtypes that are read without a copy. Floats have their automatic step over that of [`Quantizer::for_samples`]; integers have
/// none. Each has a number whose upper 32 bits are 0 if the sample is a count.
macro_rules! dtypes {
    ($($name:ident $type:ty, $step:expr, |$value:ident| $beyond:expr;)*) => {
        /// An array of samples that Python holds.
        pub(crate) enum Array<'py> {
            $($name(PyReadonlyArray1<'py, $type>),)*
        }

        /// The samples of an array.
        #[derive(Clone, Copy)]
        pub(crate) enum Values<'a> {
            $($name(ArrayView1<'a, $type>),)*
        }

        impl<'a, 'py> FromPyObject<'a, 'py> for Array<'py> {
            type Error = PyErr;

            fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
                $(if let Ok(array) = object.extract::<PyReadonlyArray1<$type>>() {
                    return Ok(Self::$name(array));
                })*
                let array = object.cast::<PyUntypedArray>()?;
                Err(PyTypeError::new_err(format!("an array of {} with {} dimensions", array.dtype(), array.ndim())))
            }
        }

        impl Array<'_> {
            pub(crate) fn values(&self) -> Values<'_> {
                match self {
                    $(Self::$name(array) => Values::$name(array.as_array()),)*
                }
            }
        }

        impl Values<'_> {
            pub(crate) fn len(&self) -> usize {
                match self {
                    $(Self::$name(values) => values.len(),)*
                }
            }

            /// The automatic grid, if these are floats.
            fn automatic_grid(self) -> Option<Grid> {
                match self {
                    $(Self::$name(values) => {
                        let step: f64 = $step?;
                        let apart = if values.len() < LONG { &[1][..] } else { &[APART, 1] };
                        let quantizer =
                            apart.iter().find_map(|&apart| Quantizer::for_samples(stretches(values, apart)))?;
                        Some((quantizer.origin(), quantizer.lsb() * step))
                    })*
                }
            }
        }

        impl Counts {
            /// Calls `take` with the counts of all samples in runs. A run ends with a block or before a missing sample.
            pub(crate) fn each_run(&mut self, values: Values, take: impl FnMut(&[i32], Rest)) -> PyResult<()> {
                match values {
                    $(Values::$name(values) => self.each_block(values, |$value| $beyond, take),)*
                }
            }
        }
    };
}
dtypes! {
    Int8 i8, None, |_value| 0;
    Int16 i16, None, |_value| 0;
    Int32 i32, None, |_value| 0;
    Int64 i64, None, |value| value.wrapping_add(1 << 31) as u64;
    UInt8 u8, None, |_value| 0;
    UInt16 u16, None, |_value| 0;
    UInt32 u32, None, |value| u64::from(value) << 1;
    UInt64 u64, None, |value| value | value << 1;
    Float32 f32, Some(SINGLE_PRECISION), |_value| u64::MAX;
    Float64 f64, Some(1.0), |_value| u64::MAX;
}

/// Counts of the first samples of a part of an array.
pub(crate) struct Counts {
    counts: [i32; BLOCK],
    quantizer: Option<Quantizer>,
    /// Index of the array's first sample in the user's array, for messages.
    first: u64,
}

/// The rest after some counts.
pub(crate) enum Rest {
    /// There are no more samples.
    End,
    /// The next sample is missing.
    Missing,
}

impl Counts {
    pub(crate) fn new(grid: Option<Grid>, first: u64) -> PyResult<Self> {
        let quantizer = |(origin, lsb)| {
            Quantizer::new(origin, lsb)
                .ok_or_else(|| PyValueError::new_err(format!("no grid has lsb={lsb} and origin={origin}")))
        };
        Ok(Self { counts: [0; BLOCK], quantizer: grid.map(quantizer).transpose()?, first })
    }

    /// [`each_run`](Self::each_run) for samples of one type. Without a grid, a sample is a count if the upper 32 bits of `beyond` are 0.
    fn each_block<T: Sample>(
        &mut self,
        values: ArrayView1<T>,
        beyond: impl Fn(T) -> u64,
        mut take: impl FnMut(&[i32], Rest),
    ) -> PyResult<()> {
        if self.quantizer.is_none()
            && let Some(counts) = values.as_slice().and_then(T::counts)
        {
            take(counts, Rest::End);
            return Ok(());
        }
        let Self { counts, quantizer, .. } = self;
        let mut gathered = [T::default(); BLOCK];
        for start in (0..values.len()).step_by(BLOCK) {
            let end = values.len().min(start + BLOCK);
            let part = values.slice_axis(Axis(0), Slice::from(start..end));
            let mut rest = part.as_slice().unwrap_or_else(|| {
                gathered.iter_mut().zip(&part).for_each(|(slot, &value)| *slot = value);
                &gathered[..part.len()]
            });
            while !rest.is_empty() {
                let put = match quantizer {
                    Some(quantizer) => T::put_rounded(quantizer, rest, counts),
                    None => put_integers(rest, counts, &beyond),
                };
                if put == rest.len() {
                    take(&counts[..put], Rest::End);
                    break;
                }
                check_missing(rest[put], *quantizer, self.first + (end - rest.len() + put) as u64)?;
                take(&counts[..put], Rest::Missing);
                rest = &rest[put + 1..];
            }
        }
        Ok(())
    }
}

/// A type of samples.
trait Sample: Copy + Default + Display {
    /// The samples as counts without a copy, if they are counts.
    fn counts(_values: &[Self]) -> Option<&[i32]> {
        None
    }

    /// The lower 32 bits of an integer.
    fn low_bits(self) -> i32;

    fn to_f64(self) -> f64;

    /// Puts the counts of the first samples on a grid into `counts`; returns the number of samples that have one.
    fn put_rounded(quantizer: &Quantizer, values: &[Self], counts: &mut [i32]) -> usize;
}

macro_rules! samples {
    ($($type:ty: $put:expr $(, $counts:item)?;)*) => {
        $(impl Sample for $type {
            $($counts)?

            fn low_bits(self) -> i32 {
                self as i32
            }

            fn to_f64(self) -> f64 {
                self as f64
            }

            fn put_rounded(quantizer: &Quantizer, values: &[Self], counts: &mut [i32]) -> usize {
                $put(quantizer, values, counts)
            }
        })*
    };
}
samples! {
    i8: Quantizer::counts;
    i16: Quantizer::counts;
    i32: Quantizer::counts, fn counts(values: &[Self]) -> Option<&[i32]> { Some(values) };
    u8: Quantizer::counts;
    u16: Quantizer::counts;
    u32: Quantizer::counts;
    f32: Quantizer::counts;
    f64: Quantizer::counts;
    // Integers of 64 bits are first rounded to doubles.
    i64: |quantizer: &Quantizer, values: &[i64], counts| put_each(quantizer, values, counts);
    u64: |quantizer: &Quantizer, values: &[u64], counts| put_each(quantizer, values, counts);
}

/// Puts integers into `counts` up to the first one that is no count; returns their number.
fn put_integers<T: Sample>(values: &[T], counts: &mut [i32], beyond: impl Fn(T) -> u64) -> usize {
    let mut found = 0;
    for (count, &value) in counts.iter_mut().zip(values) {
        *count = value.low_bits();
        found |= beyond(value);
    }
    if found >> 32 == 0 { values.len() } else { values.iter().take_while(|&&value| beyond(value) >> 32 == 0).count() }
}

/// Puts the counts of samples on a grid into `counts` one by one; returns the number of samples that have one.
fn put_each<T: Sample>(quantizer: &Quantizer, values: &[T], counts: &mut [i32]) -> usize {
    let mut put = 0;
    for (count, value) in counts.iter_mut().zip(values) {
        let Ok(found) = quantizer.count(value.to_f64()) else { break };
        (*count, put) = (found, put + 1);
    }
    put
}

/// Checks a sample that has no count: NaN is a missing sample, any other value is an error.
fn check_missing(value: impl Sample, quantizer: Option<Quantizer>, index: u64) -> PyResult<()> {
    let Some(quantizer) = quantizer else {
        return Err(PyOverflowError::new_err(format!(
            "sample {index} is {value}, outside the 32 bits of a count: pass lsb=1 and the origin from which counts are to be \
             taken"
        )));
    };
    match quantizer.count(value.to_f64()) {
        Err(SampleError::NotANumber) => Ok(()),
        Err(SampleError::Infinite) => {
            Err(PyValueError::new_err(format!("sample {index} is {value}: a missing sample is NaN")))
        }
        _ => Err(PyOverflowError::new_err(format!(
            "sample {index} is {value}, more than 2**31 steps of lsb={} from origin={}: choose a coarser lsb or another origin",
            quantizer.lsb(),
            quantizer.origin()
        ))),
    }
}

/// The samples of one stretch in `apart`. NaN follows each unless the next one does, so that no difference is taken across a gap.
fn stretches<T: Sample>(values: ArrayView1<T>, apart: usize) -> impl Iterator<Item = f64> {
    let ends = if apart == 1 { 0 } else { 1 };
    (0..values.len()).step_by(STRETCH * apart).flat_map(move |start| {
        let end = values.len().min(start + STRETCH);
        let samples = (start..end).map(move |at| values[at].to_f64());
        samples.chain(std::iter::repeat_n(f64::NAN, ends))
    })
}

/// Origin and LSB of the grid for an array of floats.
#[pyfunction]
pub(crate) fn automatic_quantizer(py: Python, samples: Array) -> Option<Grid> {
    let values = samples.values();
    py.detach(|| values.automatic_grid())
}
