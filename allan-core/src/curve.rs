//! The measured Allan variance curve with its confidence and noise types.

use crate::confidence::{ChiSquareApproximation, Difference};
use crate::interpolation::{AddedVariance, subtraction_factor};
use crate::math::{is_finite, log2};
use crate::moments::Moments;
use crate::noise_type::{OctaveVariance, PowerLaw, VarianceFractions, classify};
use core::fmt;
use heapless::Vec;

/// One averaging factor of a [`Curve`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct AllanPoint {
    /// Averaging factor, samples.
    pub n: u64,
    /// Averaging time, s.
    pub tau: f64,
    /// Allan variance, in the square of the unit of the samples, without [`interpolation`](Self::interpolation).
    pub avar: f64,
    /// Variance that was subtracted because replacing missing samples had added it, at most nine tenths of the measured
    /// variance.
    pub interpolation: f64,
    /// Share of the samples that was missing and replaced, 0 to 1.
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
    /// Excess kurtosis of the differences, 0 for Gaussian noise; `None` if all are 0 or the sum is full.
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
        let kurtosis = moments.excess_kurtosis(octave, count);
        Self {
            tau: n as f64 * sample_period,
            avar: moments.squares.get() as f64 / (2.0 * count as f64 * n as f64 * n as f64),
            kurtosis,
            power_law,
            ..Self::without_confidence(n, count, overlap)
        }
    }

    /// A point with the bounds 0 and infinity, without kurtosis and noise type.
    pub(crate) fn without_confidence(n: u64, count: u64, overlap: u32) -> Self {
        Self {
            n,
            tau: 0.0,
            avar: 0.0,
            interpolation: 0.0,
            replaced: 0.0,
            count,
            overlap,
            edf: (count / (2 * u64::from(overlap))).max(1) as f64,
            low: 0.0,
            high: f64::INFINITY,
            kurtosis: None,
            power_law: PowerLaw::White,
        }
    }

    /// The point without the variance that replacing missing samples has added.
    pub(crate) fn without(mut self, added: AddedVariance) -> Self {
        self.interpolation = added.subtracted(self.avar);
        self.avar -= self.interpolation;
        self.replaced = added.replaced;
        self
    }

    fn octave_variance(&self) -> OctaveVariance {
        let weight = self.count as f64 / f64::from(self.overlap);
        OctaveVariance { octave: log2(self.n as f64), variance: self.avar, weight }
    }
}

/// Allan variance at up to `OCTAVES` octave-spaced averaging factors, shortest first.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Unchecked<OCTAVES>"))]
pub struct Curve<const OCTAVES: usize> {
    pub(crate) sample_period: f64,
    pub(crate) samples: u64,
    pub(crate) points: Vec<AllanPoint, OCTAVES>,
}

/// A curve of any number of points, borrowed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurveView<'a> {
    sample_period: f64,
    samples: u64,
    points: &'a [AllanPoint],
}

impl<'a> CurveView<'a> {
    /// The curve with these points, shortest averaging time first, of `samples` samples every `sample_period` seconds.
    /// The arguments are not checked.
    #[must_use]
    pub const fn new(sample_period: f64, samples: u64, points: &'a [AllanPoint]) -> Self {
        Self { sample_period, samples, points }
    }

    /// Seconds between samples.
    #[must_use]
    pub const fn sample_period(&self) -> f64 {
        self.sample_period
    }

    /// Samples that the curve was made of.
    #[must_use]
    pub const fn samples(&self) -> u64 {
        self.samples
    }

    /// The points, shortest averaging time first.
    #[must_use]
    pub const fn points(&self) -> &'a [AllanPoint] {
        self.points
    }
}

impl<'a, const OCTAVES: usize> From<&'a Curve<OCTAVES>> for CurveView<'a> {
    fn from(curve: &'a Curve<OCTAVES>) -> Self {
        Self::new(curve.sample_period, curve.samples, &curve.points)
    }
}

/// The reason for which a table is not a [`Curve`]. Rows are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TableError {
    /// The sample period is not positive and finite.
    SamplePeriod,
    /// The overlap is not 1 to 16.
    Overlap,
    /// There are more rows than the curve has room for.
    TooManyRows,
    /// The averaging factor of this row is 0, not above that of the row before, or more than half of the samples.
    AveragingFactor(usize),
    /// The variance of this row, its bounds or its degrees of freedom are negative or not a number.
    Variance(usize),
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::SamplePeriod => f.write_str("the sample period is not positive and finite"),
            Self::Overlap => f.write_str("the overlap is not 1 to 16"),
            Self::TooManyRows => f.write_str("the table has more rows than the curve has room for"),
            Self::AveragingFactor(row) => write!(
                f,
                "the averaging factor in row {row} is 0, not above that of the row before, or more than half of the samples"
            ),
            Self::Variance(row) => write!(f, "the variance in row {row} or its confidence is negative or not a number"),
        }
    }
}

impl core::error::Error for TableError {}

#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct Unchecked<const OCTAVES: usize> {
    sample_period: f64,
    samples: u64,
    points: Vec<AllanPoint, OCTAVES>,
}

#[cfg(feature = "serde")]
impl<const OCTAVES: usize> TryFrom<Unchecked<OCTAVES>> for Curve<OCTAVES> {
    type Error = TableError;

    fn try_from(unchecked: Unchecked<OCTAVES>) -> Result<Self, TableError> {
        let Unchecked { sample_period, samples, points } = unchecked;
        check_table(sample_period, points.iter().map(|point| (point.n, point.avar)))?;
        for (row, point) in points.iter().enumerate() {
            if !(1..=16).contains(&point.overlap) {
                return Err(TableError::Overlap);
            }
            let numbers = [point.low, point.high, point.edf, point.interpolation, point.replaced];
            if point.count == 0 || numbers.iter().any(|number| number.is_nan() || *number < 0.0) {
                return Err(TableError::Variance(row));
            }
        }
        Ok(Self { sample_period, samples, points })
    }
}

fn check_table(sample_period: f64, table: impl Iterator<Item = (u64, f64)>) -> Result<(), TableError> {
    if !(sample_period > 0.0 && is_finite(sample_period)) {
        return Err(TableError::SamplePeriod);
    }
    let mut before = 0;
    for (row, (n, avar)) in table.enumerate() {
        if n <= before {
            return Err(TableError::AveragingFactor(row));
        }
        if !(avar >= 0.0 && is_finite(avar)) {
            return Err(TableError::Variance(row));
        }
        before = n;
    }
    Ok(())
}

impl<const OCTAVES: usize> Curve<OCTAVES> {
    /// The curve of a table that was computed elsewhere, with the noise type and the confidence that this crate gives
    /// it.
    ///
    /// A row is an averaging factor in samples and the Allan *variance*, in the square of the unit. `sample_period` is in
    /// seconds, and `overlap` is the number of differences per averaging time, 1 to 16. The number of differences is that
    /// of `samples` samples without gaps.
    ///
    /// ```
    /// use allan_core::{Curve, NoiseTerm, fit::fit};
    ///
    /// // Fully overlapping, 10,000 samples at 1 Hz: averaging time in s, Allan deviation.
    /// let table = [(1, 1.00e-3), (2, 7.05e-4), (4, 5.02e-4), (8, 3.49e-4), (16, 2.55e-4)];
    /// let curve = Curve::<8>::from_points(1.0, 10_000, 16, &table.map(|(n, adev)| (n, adev * adev))).unwrap();
    /// let n = fit(&curve, &[NoiseTerm::AngleRandomWalk]).terms()[0];
    /// assert!(n.low < 1.0e-3 && 1.0e-3 < n.high);
    /// ```
    ///
    /// # Errors
    /// A [`TableError`] for the first argument or row that a curve cannot have.
    ///
    /// # Cost
    /// | `Curve::from_points` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 9.18 million | 28.1 million |
    /// | stack, bytes | 5,600 | 5,550 |
    /// | flash, bytes | 20,100 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    pub fn from_points(
        sample_period: f64,
        samples: u64,
        overlap: u32,
        table: &[(u64, f64)],
    ) -> Result<Self, TableError> {
        if !(1..=16).contains(&overlap) {
            return Err(TableError::Overlap);
        }
        if table.len() > OCTAVES {
            return Err(TableError::TooManyRows);
        }
        check_table(sample_period, table.iter().copied())?;
        if let Some(row) = table.iter().position(|&(n, _)| n > samples / 2) {
            return Err(TableError::AveragingFactor(row));
        }
        let mut curve = Self::empty();
        let points = table.iter().map(|&(n, avar)| {
            let overlap = n.min(u64::from(overlap)) as u32;
            let steps = u128::from(samples - 2 * n) * u128::from(overlap) / u128::from(n);
            let count = u64::try_from(steps).unwrap_or(u64::MAX - 1) + 1;
            let tau = n as f64 * sample_period;
            AllanPoint { tau, avar, ..AllanPoint::without_confidence(n, count, overlap) }
        });
        curve.fill(sample_period, samples, points);
        Ok(curve)
    }

    /// A curve without points, to be filled in place by [`Cascade::rebuild_curve`](crate::Cascade::rebuild_curve).
    #[must_use]
    pub const fn empty() -> Self {
        Self { sample_period: 0.0, samples: 0, points: Vec::new() }
    }

    /// Replaces the points by `points`, classifies them and sets their confidence.
    pub(crate) fn fill(&mut self, sample_period: f64, samples: u64, points: impl Iterator<Item = AllanPoint>) {
        self.fill_without_confidence(sample_period, samples, points);
        self.classify();
        self.set_confidence(&mut |point| point.power_law.variance_fractions());
    }

    pub(crate) fn fill_without_confidence(
        &mut self,
        sample_period: f64,
        samples: u64,
        points: impl Iterator<Item = AllanPoint>,
    ) {
        (self.sample_period, self.samples) = (sample_period, samples);
        self.points.clear();
        self.points.extend(points);
    }

    pub(crate) fn from_classified(sample_period: f64, samples: u64, points: Vec<AllanPoint, OCTAVES>) -> Self {
        Self { sample_period, samples, points }.with_confidence(|point| point.power_law.variance_fractions())
    }

    #[inline(never)] // its stack frame would otherwise be part of every caller's
    fn classify(&mut self) {
        let octaves: Vec<OctaveVariance, OCTAVES> = self.points.iter().map(AllanPoint::octave_variance).collect();
        for (at, point) in self.points.iter_mut().enumerate() {
            point.power_law = classify(&octaves, at);
        }
    }

    fn set_confidence(&mut self, fractions: &mut dyn FnMut(&AllanPoint) -> VarianceFractions) {
        for point in &mut self.points {
            let approximation =
                ChiSquareApproximation::new(Difference::Second, point.n, point.count, point.overlap, fractions(point));
            point.edf = subtraction_factor(point.avar, point.interpolation) * approximation.edf;
            (point.low, point.high) = approximation.bounds(point.avar, point.interpolation);
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

    /// Returns the curve in another unit: `avar` and its bounds are multiplied by the square of `lsb`, units per count.
    #[must_use]
    pub fn scaled(mut self, lsb: f64) -> Self {
        self.scale(lsb);
        self
    }

    /// Converts the curve to another unit in place: see [`scaled`](Self::scaled).
    pub fn scale(&mut self, lsb: f64) {
        let square = lsb * lsb;
        for point in &mut self.points {
            point.avar *= square;
            point.interpolation *= square;
            point.low *= square;
            point.high *= square;
        }
    }

    /// Replaces the positive variances; the bounds change in proportion.
    pub(crate) fn set_variances(&mut self, avar: impl Fn(&AllanPoint) -> f64) {
        for point in self.points.iter_mut().filter(|point| point.avar > 0.0) {
            let ratio = avar(point) / point.avar;
            point.avar *= ratio;
            point.interpolation *= ratio;
            point.low *= ratio;
            point.high *= ratio;
        }
    }

    /// Subtracts `variance(n)`, in the square of the unit, from the point at averaging factor `n`, for every point. At
    /// most nine tenths of a measured variance are subtracted in all.
    #[cfg(feature = "host")]
    pub fn subtract_interpolation(&mut self, variance: impl Fn(u64) -> f64) {
        for point in &mut self.points {
            let measured = point.avar + point.interpolation;
            let added = AddedVariance { variance: point.interpolation + variance(point.n), replaced: point.replaced };
            point.interpolation = added.subtracted(measured);
            point.avar = measured - point.interpolation;
        }
        self.reset_confidence();
    }

    #[cfg(feature = "host")]
    pub(crate) fn reset_confidence(&mut self) {
        self.classify();
        self.set_confidence(&mut |point| point.power_law.variance_fractions());
    }

    /// Copies another curve in place, without a copy on the stack.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        (self.sample_period, self.samples) = (other.sample_period, other.samples);
        self.points.clear();
        self.points.extend(other.points.iter().copied());
    }

    /// Returns the curve with degrees of freedom and bounds from the variance fractions that `fractions` returns for
    /// each point.
    #[must_use]
    pub fn with_confidence(mut self, mut fractions: impl FnMut(&AllanPoint) -> VarianceFractions) -> Self {
        self.set_confidence(&mut fractions);
        self
    }
}
