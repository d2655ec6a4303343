//! What a spectrum would be without lines: a smooth shape, corrected by medians, which lines hardly move.

use super::shape::{Band, Shape};
use std::ops::Range;

/// Ordinates below this multiple of the resolution belong to the drift of the record.
const LOWEST: usize = 3;
/// Bands to the linear part of the spectrum: narrow enough for the nulls of the part's filter.
const BANDS: usize = 512;
/// Ordinates on either side that a local median looks at, at most.
const WINDOW: usize = 512;
/// A median of exponential variables varies as much as the mean of fewer of them, by this factor: 1/ln²2.
const MEDIAN_LOSS: f64 = 2.08;
/// Below this share of the middle band's density, what the record's taper leaks hides the spectrum.
const FLOOR: f64 = 1e-7;

/// The shape and its local correction.
pub(super) struct Background<'a> {
    /// What the shape is to be multiplied with.
    known: &'a dyn Fn(f64) -> f64,
    shape: Shape,
    floor: f64,
    resolution: f64,
    ordinates: usize,
}

/// The level around an ordinate, and how many ordinates' mean it is worth.
#[derive(Debug, Clone, Copy)]
pub(super) struct Level {
    pub value: f64,
    pub ordinates: f64,
}

impl<'a> Background<'a> {
    /// Of `density` at the multiples of `resolution` Hz from 0 on; `None` if there is too little of it, or no power.
    pub(super) fn of(
        density: &[f64],
        known: &'a dyn Fn(f64) -> f64,
        resolution: f64,
        sample_period: f64,
    ) -> Option<Self> {
        let bands: Vec<Band> = bands(density.len())
            .map(|range| {
                let frequency = resolution * (range.start + range.end - 1) as f64 / 2.0;
                let median = median(&mut density[range.clone()].to_vec());
                Band {
                    frequency,
                    density: median / expected_median(range.len()) / known(frequency),
                    ordinates: (range.len() as f64 / MEDIAN_LOSS).max(1.0),
                }
            })
            .collect();
        let enough = bands.len() >= 8 && bands.iter().all(|band| band.density > 0.0);
        enough.then(|| Self {
            known,
            shape: Shape::fit(&bands, sample_period),
            floor: FLOOR * median(&mut bands.iter().map(|band| band.density).collect::<Vec<f64>>()),
            resolution,
            ordinates: density.len(),
        })
    }

    /// Density at `bin` resolutions, before the local correction.
    pub(super) fn shape_at(&self, bin: f64) -> f64 {
        let frequency = bin * self.resolution;
        (self.known)(frequency) * (self.shape.density(frequency) + self.floor)
    }

    /// Median level of ordinates that are divided by the shape, around `bin`.
    pub(super) fn level(&self, whitened: &[f64], bin: usize) -> Level {
        let widest = WINDOW.min(self.ordinates / 16).max(8);
        let low = bin.saturating_sub(widest.min(bin * 2 / 3)).max(LOWEST);
        // The last ordinate has a single degree of freedom.
        let high = (bin + widest.min(2 * bin)).min(self.ordinates - 2);
        let mut window = whitened[low..=high].to_vec();
        let value = median(&mut window) / expected_median(window.len());
        Level { value, ordinates: window.len() as f64 / MEDIAN_LOSS }
    }
}

/// Bands of ordinates up to a spectrum's end: an eighth of the frequency wide, later all of one width.
fn bands(ordinates: usize) -> impl Iterator<Item = Range<usize>> {
    let widest = (ordinates / BANDS).max(1);
    let mut start = LOWEST;
    std::iter::from_fn(move || {
        let range = start..start + (start / 8).clamp(1, widest);
        start = range.end;
        (range.end < ordinates).then_some(range)
    })
}

/// The middle value, or the mean of the two in the middle; 0 for nothing.
pub(super) fn median(values: &mut [f64]) -> f64 {
    let Some(last) = values.len().checked_sub(1) else {
        return 0.0;
    };
    let (lower, &mut upper, _) = values.select_nth_unstable_by(values.len() / 2, f64::total_cmp);
    if last % 2 == 0 { upper } else { (upper + lower.iter().copied().fold(0.0, f64::max)) / 2.0 }
}

/// Expected median of `count` exponential variables of mean 1: the order statistic `j` has `Σ 1/i` over the last `j` of
/// `1 … count`.
fn expected_median(count: usize) -> f64 {
    let order = |rank: usize| (count - rank + 1..=count).map(|i| 1.0 / i as f64).sum::<f64>();
    match count {
        0 => 1.0,
        odd if odd % 2 == 1 => order(odd / 2 + 1),
        even => (order(even / 2) + order(even / 2 + 1)) / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_expected_median_of_exponential_variables() {
        for (count, expected) in [(1, 1.0), (2, 1.0), (3, 1.0 / 3.0 + 0.5), (100_001, std::f64::consts::LN_2)] {
            assert!((expected_median(count) - expected).abs() < 1e-5, "{count}");
        }
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [3.0, 1.0, 2.0, 9.0]), 2.5);
    }
}
