//! The measured Allan variance, octave by octave.

use crate::chi_square;
use crate::confidence::{Shares, edf};
use crate::math;
use heapless::Vec;

/// One averaging factor of a [`Curve`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Averaging factor, samples.
    pub n: u64,
    /// Averaging time, s.
    pub tau: f64,
    /// Allan variance, in the square of the unit of the samples.
    pub avar: f64,
    /// Squared differences that `avar` is the mean of.
    pub count: u64,
    /// Differences per averaging time: the stride between them is `n/overlap` samples.
    pub overlap: u32,
    /// Equivalent degrees of freedom of `avar`.
    pub edf: f64,
    /// Lower 95 % bound of `avar`, by χ² with `edf` degrees of freedom.
    pub low: f64,
    /// Upper 95 % bound of `avar`.
    pub high: f64,
    /// Excess kurtosis of the differences: 0 for Gaussian noise. `None` if they are all 0 or too large to say.
    pub kurtosis: Option<f64>,
}

impl Point {
    /// Equivalent degrees of freedom if the variance is due to noises in these `shares`.
    pub(crate) fn edf_of(&self, shares: Shares) -> f64 {
        edf(self.n, self.count, self.overlap, shares)
    }
}

/// Allan variance at up to `OCTAVES` octave-spaced averaging factors, shortest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve<const OCTAVES: usize> {
    sample_period: f64,
    samples: u64,
    points: Vec<Point, OCTAVES>,
}

impl<const OCTAVES: usize> Curve<OCTAVES> {
    pub(crate) fn new(sample_period: f64, samples: u64, points: Vec<Point, OCTAVES>) -> Self {
        let mut curve = Self { sample_period, samples, points };
        let slopes: Vec<f64, OCTAVES> = (0..curve.points.len()).map(|k| curve.slope(k)).collect();
        let mut slopes = slopes.iter();
        curve.set_confidence(|_| slopes.next().map_or(Shares::WHITE, |&slope| Shares::of_slope(slope)));
        curve
    }

    /// Seconds between samples.
    #[must_use]
    pub fn sample_period(&self) -> f64 {
        self.sample_period
    }

    /// Samples that the curve was made of.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// The points, shortest averaging time first.
    #[must_use]
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// The same curve with the samples' unit replaced: `avar` and its bounds times the square of `lsb`.
    #[must_use]
    pub fn scaled(mut self, lsb: f64) -> Self {
        let square = lsb * lsb;
        for point in &mut self.points {
            point.avar *= square;
            point.low *= square;
            point.high *= square;
        }
        self
    }

    /// The same curve with the confidence of the noise that `shares` tells for each point.
    #[must_use]
    pub fn with_confidence(mut self, shares: impl FnMut(&Point) -> Shares) -> Self {
        self.set_confidence(shares);
        self
    }

    fn set_confidence(&mut self, mut shares: impl FnMut(&Point) -> Shares) {
        for point in &mut self.points {
            point.edf = point.edf_of(shares(point));
            point.low = point.avar * point.edf / chi_square::quantile(0.975, point.edf);
            point.high = point.avar * point.edf / chi_square::quantile(0.025, point.edf);
        }
    }

    /// `d log σ² / d log τ` around point `k`.
    fn slope(&self, k: usize) -> f64 {
        let before = k.saturating_sub(1);
        let after = (k + 1).min(self.points.len() - 1);
        let rise = math::coarse_log2(self.points[after].avar / self.points[before].avar);
        if after > before && rise.is_finite() { rise / (after - before) as f64 } else { -1.0 }
    }
}
