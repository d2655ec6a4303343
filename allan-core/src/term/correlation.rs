//! How second differences of a process hang together: what decides how much an estimate is worth.

use super::{AngleRandomWalk, BiasInstability, Quantization, RateRamp, RateRandomWalk};
use super::{Kind, Process, of};
use crate::math::clamp;

/// Differences to an averaging time that are looked at, at most: more of them add next to nothing.
pub const MAX_OVERLAP: u32 = 8;
/// Lags that are looked at, at most: up to four averaging times.
pub const MAX_LAGS: usize = 4 * MAX_OVERLAP as usize + 1;

impl Kind {
    /// Adds `share` times the correlations of two second differences of averages over `n` samples, at lags of 0, 1, 2 …
    /// strides, `overlap` of which make up `n`.
    ///
    /// Of up to [`MAX_LAGS`] lags at an overlap of up to [`MAX_OVERLAP`]; nothing is added beyond.
    #[inline(never)] // so that its stack is not everybody's
    pub fn add_correlations(&self, share: f32, n: u64, overlap: u32, sample_period: f64, sums: &mut [f32]) {
        let width = overlap as usize;
        let mut table = [0.0; MAX_LAGS + 2 * MAX_OVERLAP as usize];
        let Some(v) = table.get_mut(..sums.len() + 2 * width) else { return };
        of!(self, process => process.structures(n as f64 / f64::from(overlap), sample_period, v));
        // Fourth differences, of which the covariances are `−1/(4n²)`.
        let fourth = |lag: usize| {
            6.0 * v[lag] - 4.0 * (v[lag.abs_diff(width)] + v[lag + width])
                + v[lag.abs_diff(2 * width)]
                + v[lag + 2 * width]
        };
        let whole = fourth(0);
        if whole < 0.0 {
            for (lag, sum) in sums.iter_mut().enumerate() {
                *sum += share * clamp(fourth(lag) / whole, -1.0, 1.0) as f32;
            }
        }
    }
}
