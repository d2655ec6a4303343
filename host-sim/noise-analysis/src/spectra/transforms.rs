//! Real Fourier transforms with reused buffers, and the cosine transform.

use crate::parallel::threads;
use fourier::{Complex, RealToComplex, forward};
use std::f64::consts::PI;
use std::sync::{Arc, Mutex, PoisonError};

/// Spare buffers; the system would have to clear new ones.
static BUFFERS: Mutex<Vec<Buffers>> = Mutex::new(Vec::new());

#[derive(Default)]
struct Buffers {
    input: Vec<f64>,
    output: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

pub(super) struct BufferedTransform {
    transform: Arc<dyn RealToComplex<f64>>,
    buffers: Buffers,
}

impl BufferedTransform {
    /// `length` is 2 or more; the input is 0 at first.
    pub(super) fn new(length: usize) -> Self {
        let transform = forward(length);
        let mut buffers = BUFFERS.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        buffers.input.clear();
        buffers.input.resize(length, 0.0);
        buffers.output.resize(transform.complex_len(), Complex::ZERO);
        buffers.scratch.resize(transform.get_scratch_len(), Complex::ZERO);
        Self { transform, buffers }
    }

    pub(super) fn input(&mut self) -> &mut [f64] {
        &mut self.buffers.input
    }

    /// The transform; overwrites the input.
    pub(super) fn output(&mut self) -> Option<&[Complex<f64>]> {
        let Buffers { input, output, scratch } = &mut self.buffers;
        // Only buffers of the wrong length are an error.
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

/// DCT-II of `values`, `Σ x·cos(π·order·(2·at + 1)/2N)` (J. Makhoul, IEEE Trans. ASSP 28, 1980).
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

/// Gain of the mean of `m` samples over `width` s at `frequency`, Hz: `sin(πfw)/(m·sin(πfw/m))`.
pub(super) fn gain_of_mean(frequency: f64, width: f64, m: u64) -> f64 {
    let (phase, m) = (PI * frequency * width, m as f64);
    phase.sin() / (m * (phase / m).sin())
}
