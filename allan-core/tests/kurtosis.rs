//! Excess kurtosis of the differences: against its definition, and for a telegraph and a Markov process.

use allan_core::Cascade;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const OCTAVES: usize = 10;

/// Σd², Σd⁴ and the number of differences in one stretch, by definition.
fn moments(samples: &[i32], n: usize) -> (u128, u128, u64) {
    let block = |start: usize| samples[start..start + n].iter().map(|&x| i128::from(x)).sum::<i128>();
    let starts = (0..).step_by((n / 8).max(1)).take_while(|start| start + 2 * n <= samples.len());
    let differences = starts.map(|start| (block(start + n) - block(start)).unsigned_abs());
    differences.fold((0, 0, 0), |(square, fourth, count), d| (square + d.pow(2), fourth + d.pow(4), count + 1))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_kurtosis_is_the_ratio_of_exact_sums(
        samples in prop::collection::vec(-(1 << 23)..1_i32 << 23, 1..3_000), shift in 0..24_u32, cut in 0.0..1.0
    ) {
        let samples: Vec<i32> = samples.iter().map(|sample| sample >> shift).collect();
        let (one_by_one, sliced) = samples.split_at((samples.len() as f64 * cut) as usize);
        let mut cascade = Cascade::<OCTAVES, 8>::new();
        one_by_one.iter().for_each(|&sample| cascade.push(sample));
        cascade.push_slice(sliced);
        for point in cascade.curve(1.0).points() {
            // Nothing is rounded up to n = 2¹⁰; see below for what is.
            let (squares, fourths, count) = moments(&samples, point.n as usize);
            let expected = (squares > 0).then(|| {
                let squares = squares as f64;
                fourths as f64 * count as f64 / (squares * squares) - 3.0
            });
            prop_assert_eq!(point.kurtosis, expected, "n = {}", point.n);
        }
    }
}

#[test]
fn rounding_of_long_differences_changes_the_kurtosis_by_less_than_its_scatter() {
    // White noise of one count, the least that a converter can dither.
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let samples: Vec<i32> =
        (0..1 << 21).map(|_| Distribution::<f64>::sample(&StandardNormal, &mut rng).round() as i32).collect();
    let mut cascade = Cascade::<18, 8>::new();
    cascade.push_slice(&samples);
    for point in &cascade.curve(1.0).points()[10..] {
        let (squares, fourths, count) = moments(&samples, point.n as usize);
        let exact = fourths as f64 * count as f64 / (squares as f64 * squares as f64) - 3.0;
        let rounded = point.kurtosis.unwrap();
        // Rounding errors e of a unit, 1/32 of the deviation σ at most: 6·E e²/σ² on average, and four deviations
        // 4·√(E e²·15σ⁶/edf)/σ⁴ of chance, E e² = 1/4 for whole counts rounded to even ones.
        let tolerance = 1.5 / 1024.0 + 4.0 * 4.0 * (15.0 / 4.0 / point.edf).sqrt() / 32.0;
        assert!((rounded - exact).abs() < tolerance, "n = {}: {rounded} instead of {exact}", point.n);
    }
}

/// Levels 0 and `step`; up with probability 1/60 a sample, down with 1/30.
fn telegraph(samples: usize, step: i32, seed: u64) -> Cascade<OCTAVES, 8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut cascade, mut high) = (Cascade::new(), false);
    for _ in 0..samples {
        high ^= rng.random_bool(if high { 1.0 / 30.0 } else { 1.0 / 60.0 });
        cascade.push(if high { step } else { 0 });
    }
    cascade
}

/// A first-order Markov process with the telegraph's autocovariance.
fn markov(samples: usize, step: f64, seed: u64) -> Cascade<OCTAVES, 8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut cascade, mut value) = (Cascade::new(), 0.0);
    let (keep, deviation): (f64, f64) = (1.0 - 1.0 / 60.0 - 1.0 / 30.0, (2.0_f64 / 9.0).sqrt() * step);
    for _ in 0..samples {
        let normal: f64 = StandardNormal.sample(&mut rng);
        value = keep * value + (1.0 - keep * keep).sqrt() * deviation * normal;
        cascade.push(value.round() as i32);
    }
    cascade
}

#[test]
fn the_kurtosis_differs_between_a_telegraph_and_a_markov_process_of_the_same_variance() {
    const SAMPLES: usize = 1 << 20;
    let (telegraph, markov) = (telegraph(SAMPLES, 1_000, 1).curve(1.0), markov(SAMPLES, 1_000.0, 2).curve(1.0));
    let at_1 = telegraph.points()[0];
    // A change, up or down, at 1 sample in 45: exactly 45 − 3, but for the chance of how many there were.
    let changes = SAMPLES as f64 / 45.0;
    assert!((at_1.kurtosis.unwrap() - 42.0).abs() < 4.0 * 45.0 / changes.sqrt(), "{:?}", at_1.kurtosis);
    for (expected, point) in [42.0, 21.0, 8.8, 3.5, 1.1, 0.0, -0.3].into_iter().zip(telegraph.points()) {
        let found = point.kurtosis.unwrap();
        // The published values have two digits and come from a run of their own.
        let tolerance = 0.05 + 0.06 * f64::abs(expected);
        assert!((found - expected).abs() < tolerance, "n = {}: {found} instead of {expected}", point.n);
    }
    for (telegraph, markov) in telegraph.points().iter().zip(markov.points()) {
        // Four standard deviations of both.
        let tolerance = 4.0 * (2.0 / telegraph.edf + 2.0 / markov.edf).sqrt();
        assert!((telegraph.avar / markov.avar - 1.0).abs() < tolerance.max(0.04), "n = {}", markov.n);
        // √(24/edf) is the standard deviation of the kurtosis of so many Gaussian values.
        assert!(markov.kurtosis.unwrap().abs() < 4.0 * (24.0 / markov.edf).sqrt(), "n = {}", markov.n);
    }
}
