//! What replacing missing samples adds to the Allan variance of white noise where gaps are near to each other.
//!
//! A gap of `m` samples is closed with `m` times the mean of `k` samples around it. In a window much longer than its gaps white noise
//! then has the variance of the sum of all samples, each with the weight `1 + Σ m/k` of the gaps that it closes: per sample period of
//! which a share `p` is missing, `1 + p + Σ m²/k + 2 Σ (m/k)·(m'/k')` of the complete window, where the last sum is over the samples
//! that close two gaps. The estimator takes off what a gap with `k = 2m` samples of its own adds, `p + Σ m/2`; what is left is that of
//! fewer samples and of common ones.

use crate::OCTAVES;
use allan_core::Curve;

/// Averaging factor of the estimator at which a gap of one sample is bridged, as a power of two; one of `m` samples is from `m` times as
/// much on.
const SHORTEST_BRIDGING: usize = 3;

/// The gaps of a series that are nearer to each other than the samples which close them reach.
#[derive(Clone, Default)]
pub(crate) struct NeighbouringGaps {
    /// By the shortest octave that bridges them, in variances of a sample.
    added: [f64; OCTAVES],
    /// Samples since the last gap.
    samples: u64,
    /// The last gap.
    before: Option<ClosedGap>,
}

/// A gap that samples around it close.
#[derive(Clone, Copy)]
struct ClosedGap {
    /// Weight that each of these has besides its own.
    weight: f64,
    /// Shortest octave that bridges it.
    octave: usize,
}

impl NeighbouringGaps {
    /// Records that samples follow each other.
    pub(crate) fn push(&mut self, samples: u64) {
        self.samples += samples;
    }

    /// Records that `missing` samples are missing before the next one.
    pub(crate) fn close(&mut self, missing: u64) {
        let samples = std::mem::take(&mut self.samples);
        let before = self.before.take();
        let octave = SHORTEST_BRIDGING + missing.max(1).next_power_of_two().ilog2() as usize;
        if samples == 0 || octave >= OCTAVES {
            return;
        }
        // The samples before the gap, as far as they go back to the one before, and the next one.
        let closing = (2 * missing - 1).min(samples) + 1;
        let (gap, weight) = (missing as f64, missing as f64 / closing as f64);
        self.added[octave] += gap * weight - 0.5 * gap;
        if let Some(before) = before.filter(|_| closing > samples) {
            // The first sample behind the gap before.
            self.added[octave.max(before.octave)] += 2.0 * weight * before.weight;
        }
        self.before = Some(ClosedGap { weight, octave });
    }

    /// Adds those of a later stretch.
    pub(crate) fn merge(&mut self, later: &Self) {
        self.added.iter_mut().zip(later.added).for_each(|(added, later)| *added += later);
        (self.samples, self.before) = (later.samples, later.before);
    }

    /// Takes what they add off the curve of a series of so many sample periods.
    pub(crate) fn take_off(&self, curve: &mut Curve<OCTAVES>, periods: u64) {
        let Some(white) = curve.points().first().filter(|point| point.n == 1).map(|point| point.avar) else { return };
        if self.added.iter().all(|added| *added == 0.0) {
            return;
        }
        curve.subtract_interpolation(|n| {
            let bridged: f64 = self.added.iter().take(n.ilog2() as usize + 1).sum();
            white * bridged / (n as f64 * periods as f64)
        });
    }
}
