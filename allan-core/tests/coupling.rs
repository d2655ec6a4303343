//! Allan covariance: exact compensation, gaps, merging, overflow.

use allan_core::{Cascade, Coupling};
use proptest::prelude::*;

const OCTAVES: usize = 9;

struct Pair {
    y: Cascade<OCTAVES, 8>,
    c: Cascade<OCTAVES, 8>,
    coupling: Coupling<OCTAVES>,
}

impl Pair {
    fn new() -> Self {
        Self { y: Cascade::new(), c: Cascade::new(), coupling: Coupling::new() }
    }

    fn push(&mut self, (y, c): (i32, i32)) {
        self.y.push(y);
        self.c.push(c);
        self.coupling.observe(&self.y, &self.c);
    }

    /// A gap that every octave cuts out, after which samples continue at a multiple of all strides.
    fn cut(&mut self, samples: usize) {
        let missing = samples.next_multiple_of(32) - samples + 64;
        self.y.gap(missing as u32);
        self.c.gap(missing as u32);
    }
}

fn samples() -> impl Strategy<Value = Vec<(i32, i32)>> {
    let range = -(1 << 23)..1_i32 << 23;
    prop::collection::vec((range.clone(), range), 1..700)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_variance_after_compensation_follows_exactly_from_the_covariance(stretches in prop::collection::vec(samples(), 1..4), beta in -20..20_i32) {
        let (mut pair, mut compensated) = (Pair::new(), Cascade::<OCTAVES, 8>::new());
        for stretch in &stretches {
            // Too long for an estimator with nine octaves to bridge.
            pair.y.gap(64);
            pair.c.gap(64);
            compensated.gap(64);
            for &(y, c) in stretch {
                pair.push((y, c));
                compensated.push(y - beta * c);
            }
        }
        for octave in 0..OCTAVES {
            let (product, count) = pair.coupling.sum_of_products(octave).unwrap();
            let (y, c) = (pair.y.sum_of_squares(octave).unwrap(), pair.c.sum_of_squares(octave).unwrap());
            let beta = i128::from(beta);
            let left = y.0 as i128 - 2 * beta * product + beta * beta * c.0 as i128;
            prop_assert_eq!(compensated.sum_of_squares(octave), Some((left as u128, count)));
        }
        prop_assert_eq!(pair.coupling.out_of_step(), 0);
    }

    #[test]
    fn merging_two_stretches_equals_a_gap_between_them(samples in samples(), seam in 0.0..1.0) {
        let (first, second) = samples.split_at((samples.len() as f64 * seam) as usize);
        let (mut whole, mut early, mut late) = (Pair::new(), Pair::new(), Pair::new());
        first.iter().for_each(|&sample| { whole.push(sample); early.push(sample); });
        whole.cut(first.len());
        second.iter().for_each(|&sample| { whole.push(sample); late.push(sample); });
        early.coupling.merge(&late.coupling);
        prop_assert_eq!(early.coupling, whole.coupling);
    }
}

#[test]
fn a_sample_that_one_channel_lacks_costs_the_products_that_end_there_and_short_ones_over_it() {
    let mut pair = Pair::new();
    let mut ends = Vec::new();
    for k in 1..=2_000_usize {
        if k == 1_000 {
            pair.y.gap(1);
            pair.c.push(1);
        } else {
            pair.push(((k * k % 101) as i32, (k * k % 103) as i32));
            ends.push(k);
        }
    }
    for octave in 0..OCTAVES {
        let n = 1 << octave;
        let stride = (n / 8).max(1);
        // From n = 8 on a gap of one sample is bridged.
        let kept =
            |&&end: &&usize| end % stride == 0 && end >= 2 * n && (n >= 8 || end < 1_000 || end >= 1_000 + 2 * n);
        let expected = ends.iter().filter(kept).count() as u64;
        assert_eq!(pair.coupling.sum_of_products(octave).unwrap().1, expected, "n = {n}");
    }
    assert_eq!(pair.coupling.out_of_step(), 0);
}

#[test]
fn samples_are_counted_while_one_channel_lags_behind() {
    let mut pair = Pair::new();
    (0..100).for_each(|k| pair.push((k * k, k)));
    let before = pair.coupling.points();
    pair.y.push(1);
    (0..50).for_each(|k| pair.push((k * k, k)));
    assert_eq!(pair.coupling.points(), before);
    assert_eq!(pair.coupling.out_of_step(), 50);
    pair.c.push(1);
    pair.push((0, 0));
    assert_eq!(pair.coupling.out_of_step(), 50);
}

#[test]
fn an_octave_whose_sum_overflows_has_no_covariance() {
    // A full-scale square wave at n = 2⁸: the sum of products is 2⁸⁰; 48 doublings exceed 2¹²⁷.
    let mut pair = Pair::new();
    for k in 0..4 << OCTAVES {
        let level = if k >> (OCTAVES - 1) & 1 == 0 { i32::MIN } else { i32::MAX };
        pair.push((level, level));
    }
    assert!(pair.coupling.sum_of_products(OCTAVES - 1).unwrap().0 > 1 << 80);
    for _ in 0..48 {
        pair.coupling.merge(&pair.coupling.clone());
    }
    assert_eq!(pair.coupling.sum_of_products(OCTAVES - 1), None);
    assert!(pair.coupling.points().iter().all(|point| point.n < 1 << (OCTAVES - 1)));
}
