//! A pure line.

use super::Process;
use crate::math::sin;
use core::f64::consts::PI;

/// A sinusoid of amplitude 1: `σ² = sin⁴(πf·n·dt)/(n²·sin²(πf·dt))`.
///
/// The continuous form is `[sin²(πfτ)/(πfτ)]²` (IEEE 952); above half the sample rate it is the alias that is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sinusoid {
    /// Hz, above 0.
    pub frequency: f64,
}

impl Process for Sinusoid {
    fn structure(&self, m: f64, sample_period: f64) -> f64 {
        let half = PI * self.frequency * sample_period;
        let ratio = sin(half * m) / sin(half);
        ratio * ratio / 2.0
    }

    fn density(&self, _frequency: f64, _sample_period: f64) -> f64 {
        0.0
    }

    fn record_needed(&self, _sample_period: f64) -> f64 {
        4.0 / self.frequency
    }

    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        let half = PI * self.frequency * sample_period;
        let ratio = sin(half * n as f64);
        let ratio = ratio * ratio / (n as f64 * sin(half));
        ratio * ratio
    }
}
