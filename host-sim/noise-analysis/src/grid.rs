//! A channel on the grid of its sample periods, as transforms and filters take it.

use crate::series::Series;

/// Samples one period apart; `NaN` where a sample is missing.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    sample_period: f64,
    values: Vec<f64>,
}

impl Grid {
    /// `values` every `sample_period` seconds; those that are not finite count as missing.
    #[must_use]
    pub fn new(sample_period: f64, values: Vec<f64>) -> Self {
        Self { sample_period, values }
    }

    /// The samples of a channel with the places of the missing ones.
    ///
    /// Where more samples are missing in a row than the record has, only the longer side is taken: to lay both on one
    /// grid would be mostly nothing.
    #[must_use]
    pub fn of(series: &Series) -> Self {
        let longest_gap = series.values.len() as u64;
        let mut values = Vec::with_capacity(series.values.len());
        let mut longest = Vec::new();
        let mut next = series.slots.first().copied().unwrap_or(0);
        for (&slot, &value) in series.slots.iter().zip(&series.values) {
            let missing = slot - next;
            if missing > longest_gap {
                let ended = std::mem::take(&mut values);
                if ended.len() > longest.len() {
                    longest = ended;
                }
            } else {
                values.resize(values.len() + missing as usize, f64::NAN);
            }
            values.push(value);
            next = slot + 1;
        }
        let values = if values.len() >= longest.len() { values } else { longest };
        Self::new(series.period_s, values)
    }

    /// Seconds between samples.
    #[must_use]
    pub fn sample_period(&self) -> f64 {
        self.sample_period
    }

    /// Samples and missing ones.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Samples that are there.
    #[must_use]
    pub fn present(&self) -> usize {
        self.values.iter().filter(|value| value.is_finite()).count()
    }

    /// Seconds from the first to the last place, both included.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.sample_period * self.values.len() as f64
    }

    /// Mean of the samples that are there; 0 for none.
    #[must_use]
    pub fn mean(&self) -> f64 {
        mean(self.values.iter().copied())
    }

    /// The same samples less their straight line of least squares.
    #[must_use]
    pub fn detrended(&self) -> Self {
        let middle = (self.values.len() as f64 - 1.0) / 2.0;
        let present = || self.values.iter().enumerate().filter(|(_, value)| value.is_finite());
        let mean_place = mean(present().map(|(at, _)| at as f64 - middle));
        let mean = self.mean();
        let (xx, xy) = present().fold((0.0, 0.0), |(xx, xy), (at, value)| {
            let x = at as f64 - middle - mean_place;
            (xx + x * x, xy + x * (value - mean))
        });
        let slope = if xx > 0.0 { xy / xx } else { 0.0 };
        let line = |at: usize| mean + slope * (at as f64 - middle - mean_place);
        let values = self.values.iter().enumerate().map(|(at, value)| value - line(at)).collect();
        Self { sample_period: self.sample_period, values }
    }

    /// The series at a rate at which its quantization is noise: averages over the least power of two of samples whose
    /// distance makes fewer than half of the values equal.
    ///
    /// Where a step of the quantizer lasts longer than a sample, it is part of the signal, and not a small one.
    #[must_use]
    pub fn dithered(self) -> Self {
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
        if size == 1 {
            return self;
        }
        let average = |chunk: &[f64]| chunk.iter().sum::<f64>() / size as f64;
        Self {
            sample_period: self.sample_period * size as f64,
            values: self.values.chunks_exact(size).map(average).collect(),
        }
    }
}

/// Mean of what is finite; 0 for nothing.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) =
        values.filter(|value| value.is_finite()).fold((0.0, 0_u64), |(sum, count), value| (sum + value, count + 1));
    if count > 0 { sum / count as f64 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_with_a_gap_leaves_nothing() {
        let values = (0..1000).map(|at| if at % 7 == 3 { f64::NAN } else { 5.0 - 0.25 * f64::from(at) }).collect();
        let rest = Grid::new(0.1, values).detrended();
        assert_eq!(rest.present(), 857);
        assert!(rest.values().iter().filter(|value| value.is_finite()).all(|value| value.abs() < 1e-10));
    }

    #[test]
    fn a_step_of_the_quantizer_that_lasts_is_averaged_over() {
        // Each value lasts ten samples: four samples apart six of ten are equal, eight apart two.
        let values: Vec<f64> = (0..1000).map(|at| f64::from(at / 10 % 3)).collect();
        let averaged = Grid::new(0.5, values).dithered();
        assert_eq!((averaged.sample_period(), averaged.values().len()), (4.0, 125));
        assert_eq!(averaged.values()[..2], [0.0, 6.0 / 8.0]);
        let noise = Grid::new(0.5, vec![1.0, 2.0, 4.0, 8.0]);
        assert_eq!(noise.clone().dithered(), noise);
        assert!(Grid::new(0.5, vec![1.0; 100]).dithered().values().is_empty());
    }

    #[test]
    fn gaps_keep_their_places_and_a_wide_one_ends_the_grid() {
        let slots = [3, 4, 7];
        let series = |slots: Vec<u64>| Series {
            values: (1..=slots.len()).map(|value| value as f64).collect(),
            slots,
            period_s: 0.1,
            resolution: 1.0,
            unit: "g",
        };
        let grid = Grid::of(&series(slots.to_vec()));
        assert_eq!(
            grid.values().iter().map(|value| value.is_finite()).collect::<Vec<_>>(),
            [true, true, false, false, true]
        );
        assert_eq!((grid.present(), grid.mean()), (3, 2.0));
        let far = Grid::of(&series(vec![0, 1 << 40, (1 << 40) + 1]));
        assert_eq!(far.values(), [2.0, 3.0]);
        assert!(Grid::of(&series(vec![])).values().is_empty());
    }
}
