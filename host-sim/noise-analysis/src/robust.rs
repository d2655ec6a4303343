//! The median, and the scatter that it tells of where a part of the values is disturbed.

/// Median of the absolute value of a standard normal number.
const NORMAL_MEDIAN: f64 = 0.674_489_75;

/// The middle value, or the mean of the two in the middle; 0 of an empty slice. Changes the order of the values.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    let Some(last) = values.len().checked_sub(1) else {
        return 0.0;
    };
    let (lower, &mut upper, _) = values.select_nth_unstable_by(values.len() / 2, f64::total_cmp);
    if last % 2 == 0 { upper } else { (upper + lower.iter().copied().fold(f64::NEG_INFINITY, f64::max)) / 2.0 }
}

/// Standard deviation of normal numbers whose distances from 0 have the same median as those of `values`; 0 of none.
pub(crate) fn deviation_from_zero(values: impl Iterator<Item = f64>) -> f64 {
    median(&mut values.map(f64::abs).collect::<Vec<f64>>()) / NORMAL_MEDIAN
}

/// The median, and the standard deviation of normal numbers of the same median distance from it.
pub(crate) fn median_and_deviation(values: &[f64]) -> (f64, f64) {
    let middle = median(&mut values.to_vec());
    (middle, deviation_from_zero(values.iter().map(|value| value - middle)))
}

#[cfg(test)]
mod tests {
    use super::{median, median_and_deviation};

    #[test]
    fn an_outlier_moves_neither_the_median_nor_the_deviation() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [-3.0, -1.0, -2.0, -9.0]), -2.5);
        assert_eq!(median(&mut []), 0.0);
        // Quantiles of the normal distribution at (i − ½)/8, from tables, with one value far away.
        let quantiles = [-1.534, -0.887, -0.489, -0.157, 0.157, 0.489, 0.887, 1e6];
        let (middle, deviation) = median_and_deviation(&quantiles);
        assert!(middle.abs() < 1e-9 && (deviation - 1.0).abs() < 0.05, "{middle} {deviation}");
    }
}
