//! A uniformly sampled channel for transforms and filters; missing samples are `NaN`.

use crate::samples::interpolation::{ALL_NEIGHBOURS, Autocovariance, Neighbours, PartialInterpolation, REACH};
use crate::samples::rounding::Rounding;
use crate::samples::series::Series;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

#[derive(Debug, Clone, PartialEq)]
pub struct UniformSeries {
    sample_period: f64,
    values: Vec<f64>,
    /// Rounding of the samples behind the values.
    rounding: Rounding,
    read_every: u32,
}

/// Longest gap, samples, that never splits a series.
const SHORT_GAP: u64 = 16;
/// Least samples of a part per sample of its longest gap. The side lobes of a sinusoid are then an eighth or less.
const SAMPLES_PER_GAP: u64 = 8;

impl UniformSeries {
    /// `values` every `sample_period` seconds; one that is not finite is missing.
    #[must_use]
    pub fn new(sample_period: f64, values: Vec<f64>) -> Self {
        Self { sample_period, values, rounding: Rounding::default(), read_every: 1 }
    }

    /// The samples over the span of the record; long gaps split it, and the part with the most samples is returned.
    ///
    /// A gap is long with over an eighth of the samples of the longest part between such gaps: drift and lines leak to all frequencies.
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

    pub(crate) fn with_rounding(self, rounding: Rounding) -> Self {
        Self { rounding, ..self }
    }

    pub(crate) fn rounding(&self) -> &Rounding {
        &self.rounding
    }

    pub(crate) fn with_one_of(self, read_every: u32) -> Self {
        Self { read_every, ..self }
    }

    /// Sensor values per sample; 1 for means, or if unknown.
    pub(crate) fn read_every(&self) -> u32 {
        self.read_every
    }

    pub(crate) fn with_values(&self, values: Vec<f64>) -> Self {
        Self { values, rounding: self.rounding.clone(), ..*self }
    }

    /// Seconds between samples.
    #[must_use]
    pub fn sample_period(&self) -> f64 {
        self.sample_period
    }

    /// In order; `NaN` for a missing sample.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Number of samples that are not missing.
    #[must_use]
    pub fn present(&self) -> usize {
        self.values.iter().filter(|value| value.is_finite()).count()
    }

    /// The longest part whose gaps [`interpolated`](Self::interpolated) closes.
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

    /// Sample periods, missing ones included, in s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.sample_period * self.values.len() as f64
    }

    /// Mean of the present samples; 0 without any.
    #[must_use]
    pub fn mean(&self) -> f64 {
        mean(self.values.iter().copied())
    }

    /// The series with gaps of up to six samples closed by best linear interpolation from six neighbours a side, and the replaced share.
    ///
    /// Zeros in their place would spread power over all frequencies.
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

    /// Around `level`, from the pairs that are present.
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

    /// Block averages over the least power of two at which fewer than half of the pairs a block apart are equal: rounding acts as noise.
    ///
    /// An output that stays at one step of the quantizer for several samples has a correlated rounding error, which would show as lines.
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

    /// Means of blocks of `size` samples, at least half of which are there, at `size` times the period; an incomplete last one is left out.
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
            rounding: self.rounding.clone(),
            read_every: if size > 1 { 1 } else { self.read_every },
        }
    }
}

/// Positions of the longest part without a long gap, and the longest gap, samples, that is not long.
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
        // Many shorter gaps must not make up nearly all of it.
        let is_filled = part.end > first && slots[part.end - 1] - slots[first] <= SHORT_GAP * samples;
        if is_filled && samples >= SAMPLES_PER_GAP * longest_gap {
            return (part, longest_gap);
        }
        longest_gap /= 2;
    }
    (longest_without(SHORT_GAP), SHORT_GAP)
}

/// Mean of the finite values; 0 without any.
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
        // A multiplicative sequence, uniform in ±0.5.
        let white = |at: usize| (at as f64 * 0.754_877_666 * (at as f64 + 3.0)).fract() - 0.5;
        let with_losses = lossy(&white);
        let (closed, _) = with_losses.interpolated();
        let replaced = (20..1980).filter(|&at| is_lost(at) && at < 600).map(|at| closed.values()[at].abs());
        assert!(replaced.fold(0.0, f64::max) < 0.2, "near the mean of 0");
    }

    #[test]
    fn averages_until_neighbours_are_rarely_equal() {
        // Each value lasts ten samples: four apart six of ten are equal, eight apart two.
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
        // Stretches of 1000 samples: gaps of up to 125 leave them together.
        let stretches = |gap: u64| (0..5000).map(|at: u64| at + at / 1000 * gap).collect();
        assert_eq!(UniformSeries::from_series(&series(stretches(125))).values().len(), 5500);
        assert_eq!(UniformSeries::from_series(&series(stretches(1000))).values().len(), 1000);
        // One sample in a thousand is no record with gaps.
        assert!(UniformSeries::from_series(&series((0..5000).map(|at| 1000 * at).collect())).values().len() < 20);
    }
}
