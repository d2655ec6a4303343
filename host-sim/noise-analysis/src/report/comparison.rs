//! Tests of estimates that differ by more than their intervals allow, one pair or many.

use crate::bounds::BoundedEstimate;
use crate::distributions::upper_tail;
use allan_core::confidence::NORMAL_975;
use serde::Serialize;

/// Probability that estimates of equal truths are said to differ anywhere in one comparison.
pub const COMPARISON_SIGNIFICANCE: f64 = 0.05;

/// The verdict on the second of two estimates of a noise against the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    Better,
    Worse,
    /// The intervals do not tell.
    NotDistinguishable,
}

/// Probability that two estimates of one truth differ at least as much.
///
/// Each interval is taken for that of a normal distribution with a width of its own on either side, and of each estimate the
/// side that faces the other counts. An estimate without an interval, such as a data sheet's, is exact; a term that the data
/// does not show is 0 with its upper bound on the one side that it has.
#[must_use]
pub fn difference_p_value(one: &BoundedEstimate, other: &BoundedEstimate) -> f64 {
    let (less, more) = if one.value <= other.value { (one, other) } else { (other, one) };
    let deviation = (less.high - less.value).hypot(more.value - more.low) / NORMAL_975;
    let difference = more.value - less.value;
    if difference <= 0.0 || !difference.is_finite() || deviation.is_nan() || deviation == f64::INFINITY {
        return 1.0;
    }
    2.0 * upper_tail(difference / deviation)
}

/// The verdict on each second estimate, with the p-value of the difference: [`COMPARISON_SIGNIFICANCE`] holds for all pairs together.
#[must_use]
pub fn verdicts(pairs: &[(BoundedEstimate, BoundedEstimate)]) -> Vec<(Verdict, f64)> {
    let p_values: Vec<f64> = pairs.iter().map(|(one, other)| difference_p_value(one, other)).collect();
    let different = rejected(&p_values, COMPARISON_SIGNIFICANCE);
    let verdict = |((one, other), different): (&(BoundedEstimate, BoundedEstimate), bool)| match different {
        true if other.value < one.value => Verdict::Better,
        true => Verdict::Worse,
        false => Verdict::NotDistinguishable,
    };
    pairs.iter().zip(different).map(verdict).zip(p_values).collect()
}

/// Which of several hypotheses are rejected, so that any true one is with at most the probability `significance`: the smallest
/// p-value is held against the significance over their number, the next against that over one less, and so on until one is
/// larger (S. Holm, Scand. J. Statist. 6, 1979).
pub(crate) fn rejected(p_values: &[f64], significance: f64) -> Vec<bool> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let is_rejected = |&(rank, &at): &(usize, &usize)| p_values[at] < significance / (p_values.len() - rank) as f64;
    let mut rejected = vec![false; p_values.len()];
    order.iter().enumerate().take_while(is_rejected).for_each(|(_, &at)| rejected[at] = true);
    rejected
}

#[cfg(test)]
mod tests {
    use super::{BoundedEstimate, Verdict, difference_p_value, rejected, verdicts};

    fn estimate(value: f64, low: f64, high: f64) -> BoundedEstimate {
        BoundedEstimate { value, low, high }
    }

    #[test]
    fn p_values_are_those_of_the_normal_distribution() {
        // 1 ± 0.1 and 1.2 ± 0.1 (95 %): 0.2 over 0.1·√2/1.96 is 2.772 standard deviations, two-sided 0.00557.
        let p = difference_p_value(&estimate(1.0, 0.9, 1.1), &estimate(1.2, 1.1, 1.3));
        assert!((p - 0.005_57).abs() < 1e-5, "{p}");
        // Only the sides that face each other count.
        assert_eq!(p, difference_p_value(&estimate(1.2, 1.1, 9.0), &estimate(1.0, 0.0, 1.1)));
        // Against an exact value at the bound of the other: 5 %.
        let p = difference_p_value(&estimate(0.9, 0.9, 0.9), &estimate(1.0, 0.9, 1.2));
        assert!((p - 0.05).abs() < 1e-9, "{p}");
        assert_eq!(difference_p_value(&estimate(1.0, 1.0, 1.0), &estimate(1.0, 1.0, 1.0)), 1.0);
        assert_eq!(difference_p_value(&estimate(0.0, 0.0, f64::INFINITY), &estimate(1.0, 1.0, 1.0)), 1.0);
        assert_eq!(difference_p_value(&estimate(1.0, 1.0, 1.0), &estimate(2.0, 2.0, 2.0)), 0.0);
    }

    /// Holm's levels for three hypotheses at 5 %: 0.0167, 0.025, 0.05.
    #[test]
    fn of_several_differences_the_level_is_that_of_all() {
        assert_eq!(rejected(&[0.03, 0.016, 0.02], 0.05), [true, true, true]);
        assert_eq!(rejected(&[0.03, 0.017, 0.02], 0.05), [false, false, false]);
        assert_eq!(rejected(&[0.2, 0.01, 0.026], 0.05), [false, true, false]);
        let verdict = verdicts(&[
            (estimate(1.0, 0.99, 1.01), estimate(0.5, 0.4, 0.6)),
            (estimate(1.0, 0.99, 1.01), estimate(1.5, 1.4, 1.6)),
            (estimate(1.0, 0.9, 1.1), estimate(1.05, 0.9, 1.2)),
        ]);
        let words: Vec<Verdict> = verdict.iter().map(|(verdict, _)| *verdict).collect();
        assert_eq!(words, [Verdict::Better, Verdict::Worse, Verdict::NotDistinguishable]);
    }
}
