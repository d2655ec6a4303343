//! Samples at full scale.

/// Magnitudes of the largest counts of 16 bits: 32767 and -32768.
const FULL_SCALE_16_BITS: [i64; 2] = [i16::MAX as i64, i16::MIN as i64];

/// Positions of the samples of `counts` at full scale, in ascending order; `None` stands for a sample that is refused. `range_counts` is
/// the full scale where it is known; elsewhere it is that of 16 bits if the counts reach it and do not exceed it.
pub(crate) fn saturated(counts: &[Option<i32>], range_counts: Option<f64>) -> Vec<usize> {
    let known = || counts.iter().flatten().copied().map(i64::from);
    let reaches_16_bits = known().map(i64::abs).max().is_some_and(|largest| (32_767..=32_768).contains(&largest));
    let is_saturated = |count: i64| match range_counts {
        Some(range) => count.abs() as f64 >= range - 0.5,
        None => reaches_16_bits && FULL_SCALE_16_BITS.contains(&count),
    };
    let at = |count: &Option<i32>| count.is_some_and(|count| is_saturated(i64::from(count)));
    (0..counts.len()).filter(|&position| at(&counts[position])).collect()
}

#[cfg(test)]
mod tests {
    use super::saturated;

    /// Counts from 0 to 49.
    fn counts() -> Vec<Option<i32>> {
        (0..50_000).map(|at| Some(at * 7919 % 50)).collect()
    }

    #[test]
    fn samples_at_full_scale_are_found() {
        assert!(saturated(&counts(), None).is_empty());
        let mut seen = counts();
        seen[100..140].fill(Some(32_767));
        assert_eq!(saturated(&seen, None), (100..140).collect::<Vec<_>>());
        // Beyond 16 bits it is no full scale.
        seen[7] = Some(40_000);
        assert!(saturated(&seen, None).is_empty());
        // With a known range.
        let largest = counts().iter().filter(|count| **count == Some(49)).count();
        assert_eq!(saturated(&counts(), Some(49.0)).len(), largest);
        assert!(saturated(&[None; 5], None).is_empty() && saturated(&[], Some(1.0)).is_empty());
    }
}
