//! The measured Allan variance curve with its confidence and noise types.

use crate::confidence::{ChiSquareApproximation, Difference};
use crate::interpolation::{AddedVariance, subtraction_factor};
use crate::math::log2;
use crate::moments::Moments;
use crate::noise_type::{OctaveVariance, PowerLaw, VarianceFractions, classify};
use heapless::Vec;

/// One averaging factor of a [`Curve`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AllanPoint {
    /// Averaging factor, samples.
    pub n: u64,
    /// Averaging time, s.
    pub tau: f64,
    /// Allan variance, in the square of the unit of the samples, without [`interpolation`](Self::interpolation).
    pub avar: f64,
    /// Variance that was subtracted from the measured one because replacing missing samples had added it. At most nine
    /// tenths of the measured variance.
    pub interpolation: f64,
    /// Share of the samples that was replaced because it was missing, 0 to 1. Where differences with missing samples are
    /// left out it is 0.
    pub replaced: f64,
    /// Squared differences that `avar` is the mean of.
    pub count: u64,
    /// Differences per averaging time: one is taken every `n/overlap` samples.
    pub overlap: u32,
    /// Equivalent degrees of freedom of `avar`.
    pub edf: f64,
    /// Lower 95 % bound of `avar`.
    pub low: f64,
    /// Upper 95 % bound of `avar`.
    pub high: f64,
    /// Excess kurtosis of the differences: 0 for Gaussian noise. `None` if all differences are 0 or the sum of their
    /// fourth powers is full.
    pub kurtosis: Option<f64>,
    /// The power law that dominates around this averaging time.
    pub power_law: PowerLaw,
}

impl AllanPoint {
    /// A point whose confidence is not set yet. `octave` selects the rounding of the fourth powers.
    pub(crate) fn new(
        n: u64,
        sample_period: f64,
        moments: &Moments,
        octave: usize,
        count: u64,
        overlap: u32,
        power_law: PowerLaw,
    ) -> Self {
        Self {
            n,
            tau: n as f64 * sample_period,
            avar: moments.squares.get() as f64 / (2.0 * count as f64 * n as f64 * n as f64),
            interpolation: 0.0,
            replaced: 0.0,
            count,
            overlap,
            edf: 0.0,
            low: 0.0,
            high: 0.0,
            kurtosis: moments.excess_kurtosis(octave, count),
            power_law,
        }
    }

    /// The point without the variance that replacing missing samples has added.
    pub(crate) fn without(mut self, added: AddedVariance) -> Self {
        self.interpolation = added.subtracted(self.avar);
        self.avar -= self.interpolation;
        self.replaced = added.replaced;
        self
    }

    /// Factor on the degrees of freedom of the measured variance.
    pub(crate) fn subtraction_factor(&self) -> f64 {
        subtraction_factor(self.avar, self.interpolation)
    }

    fn octave_variance(&self) -> OctaveVariance {
        let weight = self.count as f64 / f64::from(self.overlap);
        OctaveVariance { octave: log2(self.n as f64), variance: self.avar, weight }
    }
}

/// Allan variance at up to `OCTAVES` octave-spaced averaging factors, shortest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve<const OCTAVES: usize> {
    sample_period: f64,
    samples: u64,
    points: Vec<AllanPoint, OCTAVES>,
}

impl<const OCTAVES: usize> Curve<OCTAVES> {
    /// A curve without points, to be filled in place by [`Cascade::rebuild_curve`](crate::Cascade::rebuild_curve): with 24
    /// octaves a curve takes about 2 kB, too much to be moved over a small stack.
    #[must_use]
    pub const fn empty() -> Self {
        Self { sample_period: 0.0, samples: 0, points: Vec::new() }
    }

    /// Replaces the points by `points`, classifies them and sets their confidence.
    pub(crate) fn fill(&mut self, sample_period: f64, samples: u64, points: impl Iterator<Item = AllanPoint>) {
        (self.sample_period, self.samples) = (sample_period, samples);
        self.points.clear();
        self.points.extend(points);
        self.classify();
        self.set_confidence(&mut |point| point.power_law.variance_fractions());
    }

    /// A curve of points whose noise type is set already.
    pub(crate) fn from_classified(sample_period: f64, samples: u64, points: Vec<AllanPoint, OCTAVES>) -> Self {
        Self { sample_period, samples, points }.with_confidence(|point| point.power_law.variance_fractions())
    }

    /// Sets the power law of each point from the slope around it.
    #[inline(never)] // its stack frame would otherwise be part of every caller's
    fn classify(&mut self) {
        let octaves: Vec<OctaveVariance, OCTAVES> = self.points.iter().map(AllanPoint::octave_variance).collect();
        for (at, point) in self.points.iter_mut().enumerate() {
            point.power_law = classify(&octaves, at);
        }
    }

    /// Sets the degrees of freedom and bounds of each point for its variance fractions.
    fn set_confidence(&mut self, fractions: &mut dyn FnMut(&AllanPoint) -> VarianceFractions) {
        for point in &mut self.points {
            let mut approximation =
                ChiSquareApproximation::new(Difference::Second, point.n, point.count, point.overlap, fractions(point));
            approximation.edf *= point.subtraction_factor();
            point.edf = approximation.edf;
            (point.low, point.high) = approximation.bounds(point.avar);
        }
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
    pub fn points(&self) -> &[AllanPoint] {
        &self.points
    }

    /// Keeps the points for which `keep` returns true: a fit to the others is a fit to a range of averaging times.
    pub fn retain(&mut self, keep: impl FnMut(&AllanPoint) -> bool) {
        self.points.retain(keep);
    }

    /// The same curve in another unit: `avar` and its bounds are multiplied by the square of `lsb`, units per count.
    #[must_use]
    pub fn scaled(mut self, lsb: f64) -> Self {
        self.scale(lsb);
        self
    }

    /// As [`scaled`](Self::scaled), in place.
    pub fn scale(&mut self, lsb: f64) {
        let square = lsb * lsb;
        for point in &mut self.points {
            point.avar *= square;
            point.interpolation *= square;
            point.low *= square;
            point.high *= square;
        }
    }

    /// Copies another curve in place, without a copy on the stack.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        (self.sample_period, self.samples) = (other.sample_period, other.samples);
        self.points.clear();
        self.points.extend(other.points.iter().copied());
    }

    /// Replaces the variance of every point with a positive one. The bounds change in proportion, the degrees of freedom
    /// not at all.
    pub fn replace_avar(&mut self, avar: impl Fn(&AllanPoint) -> f64) {
        for point in self.points.iter_mut().filter(|point| point.avar > 0.0) {
            let ratio = avar(point) / point.avar;
            point.avar *= ratio;
            point.interpolation *= ratio;
            point.low *= ratio;
            point.high *= ratio;
        }
    }

    /// The same curve with the confidence of the variance fractions that `fractions` returns for each point.
    #[must_use]
    pub fn with_confidence(mut self, mut fractions: impl FnMut(&AllanPoint) -> VarianceFractions) -> Self {
        self.set_confidence(&mut fractions);
        self
    }
}
