//! The measured Allan variance, octave by octave.

use crate::cascade::Moments;
use crate::confidence::{Difference, Law, Shares};
use crate::math::log2;
use crate::noise_type::{Level, Noise, identify};
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
    /// Lower 95 % bound of `avar`.
    pub low: f64,
    /// Upper 95 % bound of `avar`.
    pub high: f64,
    /// Excess kurtosis of the differences: 0 for Gaussian noise. `None` if they are all 0 or too large to say.
    pub kurtosis: Option<f64>,
    /// The power law that rules around this averaging time.
    pub noise: Noise,
}

impl Point {
    /// A point without confidence yet. `octave` is the one that the moments were rounded for.
    pub(crate) fn new(
        n: u64,
        sample_period: f64,
        moments: &Moments,
        octave: usize,
        count: u64,
        overlap: u32,
        noise: Noise,
    ) -> Self {
        Self {
            n,
            tau: n as f64 * sample_period,
            avar: moments.squares.get() as f64 / (2.0 * count as f64 * n as f64 * n as f64),
            count,
            overlap,
            edf: 0.0,
            low: 0.0,
            high: 0.0,
            kurtosis: moments.excess_kurtosis(octave, count),
            noise,
        }
    }

    fn level(&self) -> Level {
        Level { octave: log2(self.n as f64), variance: self.avar, weight: self.count as f64 / f64::from(self.overlap) }
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
    /// Without points: to be [drawn](crate::Cascade::draw) where it stands, as it is too large to be handed about on a small
    /// stack.
    #[must_use]
    pub const fn empty() -> Self {
        Self { sample_period: 0.0, samples: 0, points: Vec::new() }
    }

    /// Takes `points` in the place of its own.
    pub(crate) fn take(&mut self, sample_period: f64, samples: u64, points: impl Iterator<Item = Point>) {
        (self.sample_period, self.samples) = (sample_period, samples);
        self.points.clear();
        self.points.extend(points);
        self.name();
        self.weigh(&mut |point| point.noise.shares());
    }

    /// Of points whose noise type is known already.
    pub(crate) fn of_named(sample_period: f64, samples: u64, points: Vec<Point, OCTAVES>) -> Self {
        Self { sample_period, samples, points }.with_confidence(|point| point.noise.shares())
    }

    /// Finds the power law around each point.
    #[inline(never)] // so that its stack is not everybody's
    fn name(&mut self) {
        let levels: Vec<Level, OCTAVES> = self.points.iter().map(Point::level).collect();
        for (at, point) in self.points.iter_mut().enumerate() {
            point.noise = identify(&levels, at);
        }
    }

    fn weigh(&mut self, shares: &mut dyn FnMut(&Point) -> Shares) {
        for point in &mut self.points {
            let law = Law::new(Difference::Second, point.n, point.count, point.overlap, shares(point));
            point.edf = law.edf;
            (point.low, point.high) = law.bounds(point.avar);
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
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// The same curve with the samples' unit replaced: `avar` and its bounds times the square of `lsb`.
    #[must_use]
    pub fn scaled(mut self, lsb: f64) -> Self {
        self.scale(lsb);
        self
    }

    /// The same in place.
    pub fn scale(&mut self, lsb: f64) {
        let square = lsb * lsb;
        for point in &mut self.points {
            point.avar *= square;
            point.low *= square;
            point.high *= square;
        }
    }

    /// Takes what another curve has.
    pub(crate) fn copy(&mut self, other: &Self) {
        (self.sample_period, self.samples) = (other.sample_period, other.samples);
        self.points.clear();
        self.points.extend(other.points.iter().copied());
    }

    /// Gives the points whose variance is not 0 another one, with bounds in proportion and the same degrees of freedom.
    pub fn change_avar(&mut self, avar: impl Fn(&Point) -> f64) {
        for point in self.points.iter_mut().filter(|point| point.avar > 0.0) {
            let ratio = avar(point) / point.avar;
            point.avar *= ratio;
            point.low *= ratio;
            point.high *= ratio;
        }
    }

    /// The same curve with the confidence of the noise that `shares` tells for each point.
    #[must_use]
    pub fn with_confidence(mut self, mut shares: impl FnMut(&Point) -> Shares) -> Self {
        self.weigh(&mut shares);
        self
    }
}
