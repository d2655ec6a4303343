//! A channel sampled at a constant period, with missing samples as `NaN`: the input of transforms and filters.

use crate::samples::interpolation::{ALL_NEIGHBOURS, Autocovariance, Neighbours, PartialInterpolation, REACH};
use crate::samples::rounding::Rounding;
use crate::samples::series::Series;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

/// Samples one period apart; `NaN` marks a missing sample.
#[derive(Debug, Clone, PartialEq)]
pub struct UniformSeries {
    sample_period: f64,
    values: Vec<f64>,
    /// Of the samples that the values are made of.
    rounding: Rounding,
    /// Values of the sensor for each of these.
    read_every: u32,
}

/// Gaps of up to so many samples never split a series.
const SHORT_GAP: u64 = 16;
/// Least number of samples of a part for each sample of its longest gap. The gap leaves side lobes of an eighth of a
/// sinusoid's amplitude or less.
const SAMPLES_PER_GAP: u64 = 8;

impl UniformSeries {
    /// `values` taken every `sample_period` seconds; a value that is not finite counts as missing.
    #[must_use]
    pub fn new(sample_period: f64, values: Vec<f64>) -> Self {
        Self { sample_period, values, rounding: Rounding::default(), read_every: 1 }
    }

    /// The samples of a channel over the whole span of its record, with a `NaN` for each missing one.
    ///
    /// Long gaps split it, and only the part with the most samples is returned: drift and lines of a record that is mostly
    /// gaps leak to all frequencies. A gap is long if it has more than an eighth of the samples of the longest part between
    /// such gaps.
    #[must_use]
    pub fn from_series(series: &Series) -> Self {
        let slots = &series.slots;
        let (part, longest_gap) = longest_part(slots);
        let missing = |from: u64, to: u64| {
            let missing = to.saturating_sub(from);
            if missing <= longest_gap { missing as usize } else { 0 }
        };
        let mut values = Vec::with_capacity(part.len());
        let mut next = if part.start == 0 { series.span.start } else { slots[part.start] };
        for at in part.clone() {
            values.resize(values.len() + missing(next, slots[at]), f64::NAN);
            values.push(series.values[at]);
            next = slots[at] + 1;
        }
        if part.end == slots.len() && !values.is_empty() {
            values.resize(values.len() + missing(next, series.span.end), f64::NAN);
        }
        Self::new(series.period_s, values).with_rounding(Rounding::white(series.resolution, series.period_s))
    }

    /// The same values, of samples with these rounding errors.
    pub(crate) fn with_rounding(self, rounding: Rounding) -> Self {
        Self { rounding, ..self }
    }

    /// The errors of rounding the samples to counts.
    pub(crate) fn rounding(&self) -> &Rounding {
        &self.rounding
    }

    /// The same values, each of them one of so many of the sensor.
    pub(crate) fn with_one_of(self, read_every: u32) -> Self {
        Self { read_every, ..self }
    }

    /// Of how many values of the sensor each sample is one; 1 where they are means, or where that is not known.
    pub(crate) fn read_every(&self) -> u32 {
        self.read_every
    }

    /// The series with other values at the same times.
    pub(crate) fn with_values(&self, values: Vec<f64>) -> Self {
        Self { values, rounding: self.rounding.clone(), ..*self }
    }

    /// Seconds between samples.
    #[must_use]
    pub fn sample_period(&self) -> f64 {
        self.sample_period
    }

    /// All samples in order, `NaN` for a missing one.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Number of samples that are not missing.
    #[must_use]
    pub fn present(&self) -> usize {
        self.values.iter().filter(|value| value.is_finite()).count()
    }

    /// The longest part whose gaps [`interpolated`](Self::interpolated) closes, as it is.
    pub(crate) fn longest_interpolated(&self) -> Self {
        let (closed, _) = self.interpolated();
        let mut from = 0;
        let part = |part: &[f64]| {
            let range = from..from + part.len();
            from = range.end + 1;
            range
        };
        let parts = closed.values.split(|value| !value.is_finite()).map(part);
        let longest = parts.max_by_key(ExactSizeIterator::len).unwrap_or_default();
        self.with_values(self.values[longest].to_vec())
    }

    /// Number of values, missing ones included, times the sample period, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.sample_period * self.values.len() as f64
    }

    /// Mean of the samples that are not missing; 0 if all are.
    #[must_use]
    pub fn mean(&self) -> f64 {
        mean(self.values.iter().copied())
    }

    /// The series with gaps of up to six samples closed, for transforms: each missing sample is the best linear
    /// interpolation from those of the six before it and the six after it that are there. Longer gaps, and the ends, stay
    /// missing. With it the share of all samples that was replaced.
    ///
    /// A transform that takes missing samples for zeros spreads their share of the power over all frequencies, and hides what
    /// is small behind a filter or beside drift.
    #[must_use]
    pub fn interpolated(&self) -> (Cow<'_, Self>, f64) {
        let missing: Vec<usize> = (0..self.values.len()).filter(|&at| !self.values[at].is_finite()).collect();
        if missing.is_empty() || missing.len() == self.values.len() {
            return (Cow::Borrowed(self), 0.0);
        }
        let level = self.mean();
        let covariance = self.autocovariance(level);
        let mut known: BTreeMap<Neighbours, Option<PartialInterpolation>> = BTreeMap::new();
        let (mut values, mut replaced) = (self.values.clone(), 0_usize);
        for at in missing {
            let neighbour = |bit: usize| {
                let other = if bit < REACH { at.checked_sub(bit + 1) } else { Some(at + bit - REACH + 1) };
                other
                    .and_then(|other| self.values.get(other))
                    .filter(|value| value.is_finite())
                    .map(|value| value - level)
            };
            let neighbours: [Option<f64>; 2 * REACH] = std::array::from_fn(neighbour);
            let present = neighbours.iter().enumerate().fold(0, |present: Neighbours, (bit, neighbour)| {
                present | Neighbours::from(neighbour.is_some()) << bit
            });
            // Distances to the samples at either end of the gap.
            let [before, after] = [present & (ALL_NEIGHBOURS >> REACH), present >> REACH];
            if before == 0 || after == 0 || (before.trailing_zeros() + after.trailing_zeros()) as usize + 1 > REACH {
                continue;
            }
            let best = known.entry(present).or_insert_with(|| PartialInterpolation::best(&covariance, present));
            if let Some(best) = best {
                let terms = best.weights.iter().zip(&neighbours).filter_map(|(weight, value)| Some(weight * (*value)?));
                values[at] = level + terms.sum::<f64>();
                replaced += 1;
            }
        }
        (Cow::Owned(self.with_values(values)), replaced as f64 / self.values.len() as f64)
    }

    /// Autocovariance around `level`, of the pairs that are there.
    fn autocovariance(&self, level: f64) -> Autocovariance {
        std::array::from_fn(|lag| {
            let pairs = self.values.iter().zip(&self.values[lag.min(self.values.len())..]);
            let products = pairs.map(|(a, b)| (a - level) * (b - level)).filter(|product| product.is_finite());
            let (sum, count) = products.fold((0.0, 0.0), |(sum, count), product| (sum + product, count + 1.0));
            sum / f64::max(count, 1.0)
        })
    }

    /// The samples minus their least-squares straight line.
    #[must_use]
    pub fn detrended(&self) -> Self {
        let middle = (self.values.len() as f64 - 1.0) / 2.0;
        let present = || self.values.iter().enumerate().filter(|(_, value)| value.is_finite());
        let mean_position = mean(present().map(|(at, _)| at as f64 - middle));
        let mean = self.mean();
        let (xx, xy) = present().fold((0.0, 0.0), |(xx, xy), (at, value)| {
            let x = at as f64 - middle - mean_position;
            (xx + x * x, xy + x * (value - mean))
        });
        let slope = if xx > 0.0 { xy / xx } else { 0.0 };
        let line = |at: usize| mean + slope * (at as f64 - middle - mean_position);
        self.with_values(self.values.iter().enumerate().map(|(at, value)| value - line(at)).collect())
    }

    /// Block averages at a rate at which rounding acts as noise. The block is the smallest power of two such that fewer
    /// than half of all pairs of samples one block apart are equal; no whole block, and so no value, remains of a series
    /// that never changes.
    ///
    /// Where the output stays at one step of the quantizer for several samples, the rounding error is correlated and
    /// would show as lines.
    pub(crate) fn averaged_until_dithered(self) -> Self {
        let equal_apart = |distance: usize| {
            let pairs = self.values.iter().zip(self.values.iter().skip(distance));
            let (equal, count) = pairs
                .filter(|(a, b)| a.is_finite() && b.is_finite())
                .fold((0, 0), |(equal, count), (a, b)| (equal + usize::from(a == b), count + 1));
            2 * equal >= count
        };
        let mut size = 1;
        while size < self.values.len() && equal_apart(size) {
            size *= 2;
        }
        if size == 1 { self } else { self.averaged(size) }
    }

    /// Means of blocks of `size` samples, at `size` times the period: of the samples that are there, where at least half are. An
    /// incomplete block at the end is left out.
    pub(crate) fn averaged(&self, size: usize) -> Self {
        let average = |chunk: &[f64]| {
            let (sum, count) = chunk
                .iter()
                .filter(|value| value.is_finite())
                .fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
            if 2 * count >= size { sum / count as f64 } else { f64::NAN }
        };
        Self {
            sample_period: self.sample_period * size as f64,
            values: self.values.chunks_exact(size).map(average).collect(),
            // An average has less of the error, at a lower rate.
            rounding: self.rounding.clone(),
            read_every: if size > 1 { 1 } else { self.read_every },
        }
    }
}

/// The positions of the longest part without a long gap, and the length of the gaps up to which none is long, samples.
fn longest_part(slots: &[u64]) -> (Range<usize>, u64) {
    let longest_without = |longest_gap: u64| {
        let mut longest = 0..0;
        let mut start = 0;
        for end in 1..=slots.len() {
            if end == slots.len() || slots[end] - slots[end - 1] - 1 > longest_gap {
                if end - start > longest.len() {
                    longest = start..end;
                }
                start = end;
            }
        }
        longest
    };
    let mut longest_gap = slots.len() as u64 / SAMPLES_PER_GAP;
    while longest_gap > SHORT_GAP {
        let part = longest_without(longest_gap);
        let (samples, first) = (part.len() as u64, part.start);
        // Nor may many shorter gaps make up nearly all of it.
        let is_filled = part.end > first && slots[part.end - 1] - slots[first] <= SHORT_GAP * samples;
        if is_filled && samples >= SAMPLES_PER_GAP * longest_gap {
            return (part, longest_gap);
        }
        longest_gap /= 2;
    }
    (longest_without(SHORT_GAP), SHORT_GAP)
}

/// Mean of the finite values; 0 if there are none.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) =
        values.filter(|value| value.is_finite()).fold((0.0, 0_u64), |(sum, count), value| (sum + value, count + 1));
    if count > 0 { sum / count as f64 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn detrending_removes_a_straight_line_with_gaps() {
        let values = (0..1000).map(|at| if at % 7 == 3 { f64::NAN } else { 5.0 - 0.25 * f64::from(at) }).collect();
        let rest = UniformSeries::new(0.1, values).detrended();
        assert_eq!(rest.present(), 857);
        assert!(rest.values().iter().filter(|value| value.is_finite()).all(|value| value.abs() < 1e-10));
    }

    #[test]
    fn short_gaps_are_closed_by_what_the_neighbours_tell() {
        // A sinusoid is known from its neighbours, white noise is not.
        let wave = |at: usize| (0.3 * at as f64).sin();
        let is_lost = |at: usize| at % 50 == 7 || (600..606).contains(&at) || (800..807).contains(&at);
        let lossy = |value: &dyn Fn(usize) -> f64| {
            UniformSeries::new(1.0, (0..2000).map(|at| if is_lost(at) { f64::NAN } else { value(at) }).collect())
        };
        let with_losses = lossy(&wave);
        let (closed, share) = with_losses.interpolated();
        let missing: Vec<usize> = (0..2000).filter(|&at| closed.values()[at].is_nan()).collect();
        assert_eq!(missing, (800..808).collect::<Vec<_>>(), "eight in a row are too many");
        assert_eq!(share, 45.0 / 2000.0);
        for at in (20..1980).filter(|&at| is_lost(at) && !missing.contains(&at)) {
            assert!((closed.values()[at] - wave(at)).abs() < 0.02, "{at}: {}", closed.values()[at]);
        }
        // Uniform in ±0.5, by a multiplicative sequence.
        let white = |at: usize| (at as f64 * 0.754_877_666 * (at as f64 + 3.0)).fract() - 0.5;
        let with_losses = lossy(&white);
        let (closed, _) = with_losses.interpolated();
        let replaced = (20..1980).filter(|&at| is_lost(at) && at < 600).map(|at| closed.values()[at].abs());
        assert!(replaced.fold(0.0, f64::max) < 0.2, "near the mean of 0");
    }

    #[test]
    fn averages_until_neighbours_are_rarely_equal() {
        // Each value lasts ten samples: four samples apart six of ten are equal, eight apart two.
        let values: Vec<f64> = (0..1000).map(|at| f64::from(at / 10 % 3)).collect();
        let averaged = UniformSeries::new(0.5, values).averaged_until_dithered();
        assert_eq!((averaged.sample_period(), averaged.values().len()), (4.0, 125));
        assert_eq!(averaged.values()[..2], [0.0, 6.0 / 8.0]);
        let noise = UniformSeries::new(0.5, vec![1.0, 2.0, 4.0, 8.0]);
        assert_eq!(noise.clone().averaged_until_dithered(), noise);
        assert!(UniformSeries::new(0.5, vec![1.0; 100]).averaged_until_dithered().values().is_empty());
    }

    #[test]
    fn gaps_become_nan_and_a_wide_gap_splits_the_record() {
        let slots = [3, 4, 7];
        let series = |slots: Vec<u64>| Series {
            values: (1..=slots.len()).map(|value| value as f64).collect(),
            span: slots.first().copied().unwrap_or(0)..slots.last().map_or(0, |last| last + 1),
            slots: slots.into(),
            period_s: 0.1,
            resolution: 1.0,
            unit: "g",
        };
        let uniform = UniformSeries::from_series(&series(slots.to_vec()));
        assert_eq!(
            uniform.values().iter().map(|value| value.is_finite()).collect::<Vec<_>>(),
            [true, true, false, false, true]
        );
        assert_eq!((uniform.present(), uniform.mean()), (3, 2.0));
        let far = UniformSeries::from_series(&series(vec![0, 1 << 40, (1 << 40) + 1]));
        assert_eq!(far.values(), [2.0, 3.0]);
        assert!(UniformSeries::from_series(&series(vec![])).values().is_empty());
        // Stretches of 1000 samples: gaps of up to 125 samples leave them together.
        let stretches = |gap: u64| (0..5000).map(|at: u64| at + at / 1000 * gap).collect();
        assert_eq!(UniformSeries::from_series(&series(stretches(125))).values().len(), 5500);
        assert_eq!(UniformSeries::from_series(&series(stretches(1000))).values().len(), 1000);
        // A sample of each thousand is no record that is mostly gaps.
        assert!(UniformSeries::from_series(&series((0..5000).map(|at| 1000 * at).collect())).values().len() < 20);
    }
}
