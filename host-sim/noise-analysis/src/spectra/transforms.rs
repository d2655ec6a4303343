//! Fourier transforms of real numbers in buffers that are used again, and the cosine transform.

use crate::parallel::threads;
use fourier::{Complex, RealToComplex, forward};
use std::f64::consts::PI;
use std::sync::{Arc, Mutex, PoisonError};

/// Buffers that no transform uses: new ones of megabytes would have to be cleared by the system.
static BUFFERS: Mutex<Vec<Buffers>> = Mutex::new(Vec::new());

#[derive(Default)]
struct Buffers {
    input: Vec<f64>,
    output: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

/// A transform of real numbers with its buffers.
pub(super) struct BufferedTransform {
    transform: Arc<dyn RealToComplex<f64>>,
    buffers: Buffers,
}

impl BufferedTransform {
    /// Of `length` numbers, 2 or more, which are 0 at first.
    pub(super) fn new(length: usize) -> Self {
        let transform = forward(length);
        let mut buffers = BUFFERS.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        buffers.input.clear();
        buffers.input.resize(length, 0.0);
        buffers.output.resize(transform.complex_len(), Complex::ZERO);
        buffers.scratch.resize(transform.get_scratch_len(), Complex::ZERO);
        Self { transform, buffers }
    }

    /// The numbers to be transformed.
    pub(super) fn input(&mut self) -> &mut [f64] {
        &mut self.buffers.input
    }

    /// Their transform, for which the numbers are overwritten.
    pub(super) fn output(&mut self) -> Option<&[Complex<f64>]> {
        let Buffers { input, output, scratch } = &mut self.buffers;
        // An error means buffers of the wrong length; these have the transform's own.
        self.transform.process_with_scratch(input, output, scratch).ok()?;
        Some(output)
    }
}

impl Drop for BufferedTransform {
    fn drop(&mut self) {
        let mut free = BUFFERS.lock().unwrap_or_else(PoisonError::into_inner);
        if free.len() < threads() {
            free.push(std::mem::take(&mut self.buffers));
        }
    }
}

/// The cosine transform of `values` (DCT-II, not normalised), by order: `Σ x·cos(π·order·(2·at + 1)/2N)`. Their even continuation has no jump,
/// so that little of a drift leaks.
///
/// It is the transform of the even samples, followed by the odd ones in reverse, turned by a quarter of its phase (J. Makhoul, "A fast
/// cosine transform in one and two dimensions", IEEE Trans. ASSP 28, 1980).
pub(super) fn cosine_transform(values: impl ExactSizeIterator<Item = f64>) -> Vec<f64> {
    let count = values.len();
    let mut transform = BufferedTransform::new(count);
    for (at, value) in values.enumerate() {
        let place = if at % 2 == 0 { at / 2 } else { count - 1 - at / 2 };
        transform.input()[place] = value;
    }
    let Some(output) = transform.output() else { return Vec::new() };
    let mut by_order = vec![output[0].re; count];
    for (order, value) in output.iter().enumerate().skip(1) {
        let (sine, cosine) = (PI * order as f64 / (2 * count) as f64).sin_cos();
        by_order[order] = value.re * cosine + value.im * sine;
        by_order[count - order] = value.re * sine - value.im * cosine;
    }
    by_order
}
