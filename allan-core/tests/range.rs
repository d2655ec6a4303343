//! Long records, and samples at and beyond the limits of the range.

#[path = "support/late_state.rs"]
mod late_state;

use allan_core::Cascade;
use late_state::after_constant;
use proptest::prelude::*;

const FULL_SCALE: i32 = 1 << 23;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_late_state_of_these_tests_is_the_one_after_pushing(sample in any::<i32>(), samples in 0..3_000_u64) {
        let mut pushed = Cascade::<9, 8>::new();
        (0..samples).for_each(|_| pushed.push(sample));
        prop_assert!(after_constant::<9, 8>(sample, samples) == pushed);
    }

    #[test]
    fn sums_are_exact_after_2_to_the_40_samples_whose_running_sum_has_wrapped(
        tail in prop::collection::vec(-FULL_SCALE..FULL_SCALE, 1..2_000), early in 0..100_u64
    ) {
        const OCTAVES: usize = 9;
        // The running sum passes −2⁶³ on the way.
        let before = (1 << 40) - early;
        let mut cascade = after_constant::<OCTAVES, 8>(-FULL_SCALE, before);
        let (one_by_one, slice) = tail.split_at(tail.len() / 2);
        one_by_one.iter().for_each(|&sample| cascade.push(sample));
        cascade.push_slice(slice);
        prop_assert_eq!(cascade.len(), before + tail.len() as u64);

        for octave in 0..OCTAVES {
            let n = 1_i64 << octave;
            let stride = (n / 8).max(1);
            let at = |k: i64| i128::from(if k <= 0 { -FULL_SCALE } else { tail[k as usize - 1] });
            // Sums of n samples that end at sample k of the tail; differences before it are 0.
            let sum = |end: i64| (end - n + 1..=end).map(at).sum::<i128>();
            let ends = (1..=tail.len() as i64).filter(|k| (before as i64 + k) % stride == 0);
            let squares: u128 = ends.map(|end| (sum(end) - sum(end - n)).unsigned_abs().pow(2)).sum();
            let count = (before as i64 + tail.len() as i64) / stride - 2 * (n / stride) + 1;
            prop_assert_eq!(cascade.sum_of_squares(octave), Some((squares, count as u64)), "n = {}", n);
        }
    }
}

/// Full swing of 24 bits at the longest averaging time: the largest sum of squares that 2⁴⁰ samples can make.
#[test]
fn the_largest_sum_of_2_to_the_40_samples_of_24_bits_fits() {
    const HALF_PERIOD: usize = 1 << 23;
    let mut cascade = Cascade::<24, 16>::new();
    for sample in [-FULL_SCALE, FULL_SCALE - 1, -FULL_SCALE, FULL_SCALE - 1] {
        (0..HALF_PERIOD / 4096).for_each(|_| cascade.push_slice(&[sample; 4096]));
    }
    let (square, count) = cascade.sum_of_squares(23).unwrap();
    // If a window lies half a stride off, the difference is smaller; the peaks are n·(2²⁴ − 1).
    assert!(square > u128::from(count) * ((1 << 46) - 1_u128).pow(2));
    for _ in 0..15 {
        cascade.merge(&cascade.clone());
    }
    assert_eq!(cascade.len(), 1 << 40);
    assert_eq!(cascade.sum_of_squares(23), Some((square << 15, count << 15)));
    assert!(square << 15 < 1 << 115, "the bound of the documentation");
    assert!(!cascade.is_saturated());
}

#[test]
fn wider_samples_saturate_the_sums_and_are_reported() {
    let mut cascade = Cascade::<20, 8>::new();
    for sample in [i32::MIN, i32::MAX, i32::MIN, i32::MAX] {
        (0..1 << 7).for_each(|_| cascade.push_slice(&[sample; 1 << 12]));
    }
    let mut before = 0;
    for _ in 0..40 {
        let (square, _) = cascade.sum_of_squares(19).unwrap();
        assert!(square >= before, "no sum ever wraps");
        assert_eq!(cascade.is_saturated(), square == (1 << 127) - 1);
        before = square;
        cascade.merge(&cascade.clone());
    }
    assert!(cascade.is_saturated());
    assert_eq!(cascade.curve(1.0).points()[19].kurtosis, None);
}

#[test]
fn the_kurtosis_is_known_for_2_to_the_40_samples_within_the_documented_range() {
    // White noise of ±2¹⁷ counts, and a square wave of 2¹⁰ counts at n = 2²³.
    let mut state = 1_u64;
    let mut next = || {
        state = state * 16_807 % 2_147_483_647;
        if state & 1 == 0 { -(1 << 17) } else { 1 << 17 }
    };
    let mut white = Cascade::<24, 8>::new();
    (0..1 << 20).for_each(|_| white.push(next()));
    (0..20).for_each(|_| white.merge(&white.clone()));
    assert_eq!(white.len(), 1 << 40);
    assert!(white.curve(1.0).points().iter().all(|point| point.kurtosis.is_some()));

    let mut square = Cascade::<24, 8>::new();
    for sample in [0, 1 << 10, 0, 1 << 10] {
        (0..1 << 11).for_each(|_| square.push_slice(&[sample; 1 << 12]));
    }
    (0..15).for_each(|_| square.merge(&square.clone()));
    assert_eq!(square.len(), 1 << 40);
    assert!(square.curve(1.0).points().iter().all(|point| point.kurtosis.is_some()));
}
