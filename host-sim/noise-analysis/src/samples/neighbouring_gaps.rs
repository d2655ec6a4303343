//! The variance that closing neighbouring gaps adds to the Allan variance of white noise.
//!
//! A gap of `m` samples is closed with `m` times the mean of `k` samples around it. Per sample period with a share `p`
//! missing, a long window then has `1 + p + Σ m²/k + 2 Σ (m/k)·(m'/k')` of the complete one; the last sum is over
//! samples that close two gaps. The estimator subtracts the part of separate gaps (`k = 2m`), `p + Σ m/2`.

use crate::OCTAVES;
use allan_core::Curve;

/// Averaging factor, as a power of two, at which a gap of one sample is bridged; `m` times as much for `m` samples.
const SHORTEST_BRIDGING: usize = 3;

/// Gaps nearer to each other than the samples that close them reach.
#[derive(Clone, Default)]
pub(crate) struct NeighbouringGaps {
    /// In variances of a sample, by the shortest octave that bridges them.
    added: [f64; OCTAVES],
    samples: u64,
    before: Option<ClosedGap>,
}

#[derive(Clone, Copy)]
struct ClosedGap {
    /// Additional weight of each sample that closes it.
    weight: f64,
    /// Shortest octave that bridges it.
    octave: usize,
}

impl NeighbouringGaps {
    pub(crate) fn push(&mut self, samples: u64) {
        self.samples += samples;
    }

    pub(crate) fn close(&mut self, missing: u64) {
        let samples = std::mem::take(&mut self.samples);
        let before = self.before.take();
        let octave = SHORTEST_BRIDGING + missing.max(1).next_power_of_two().ilog2() as usize;
        if samples == 0 || octave >= OCTAVES {
            return;
        }
        // The samples back to the gap before, and the next one.
        let closing = (2 * missing - 1).min(samples) + 1;
        let (gap, weight) = (missing as f64, missing as f64 / closing as f64);
        self.added[octave] += gap * weight - 0.5 * gap;
        if let Some(before) = before.filter(|_| closing > samples) {
            // The first sample behind the gap before.
            self.added[octave.max(before.octave)] += 2.0 * weight * before.weight;
        }
        self.before = Some(ClosedGap { weight, octave });
    }

    pub(crate) fn merge(&mut self, later: &Self) {
        self.added.iter_mut().zip(later.added).for_each(|(added, later)| *added += later);
        (self.samples, self.before) = (later.samples, later.before);
    }

    /// Subtracts the added variance from a curve of `periods` sample periods.
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
