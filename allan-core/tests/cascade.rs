//! The sums of the estimator: against their definition, published values, gaps, merging and restoring.

use allan_core::confidence::edf;
use allan_core::{Cascade, VarianceFractions};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const OCTAVES: usize = 9;

/// Sum and number of the squared second differences of block sums inside one stretch without gaps, by definition.
fn sum_of_squares(stretch: &[i32], n: usize, stride: usize) -> (u128, u64) {
    let block = |start: usize| stretch[start..start + n].iter().map(|&x| i128::from(x)).sum::<i128>();
    let starts = (0..).step_by(stride).take_while(|start| start + 2 * n <= stretch.len());
    starts.map(|start| block(start + n) - block(start)).fold((0, 0), |(sum, count), difference| {
        (sum + difference.unsigned_abs() * difference.unsigned_abs(), count + 1)
    })
}

fn assert_exact<const OVERLAP: usize>(stretches: &[Vec<i32>]) {
    let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
    for (k, stretch) in stretches.iter().enumerate() {
        if k > 0 {
            cascade.gap(7);
        }
        cascade.push_slice(stretch);
    }
    for octave in 0..OCTAVES {
        let n = 1 << octave;
        let expected = stretches
            .iter()
            .map(|stretch| sum_of_squares(stretch, n, (n / OVERLAP).max(1)))
            .fold((0, 0), |sum, part| (sum.0 + part.0, sum.1 + part.1));
        assert_eq!(cascade.sum_of_squares(octave), Some(expected), "P = {OVERLAP}, n = {n}");
    }
    assert_eq!(cascade.len(), stretches.iter().map(|stretch| stretch.len() as u64).sum::<u64>());
    assert_eq!(cascade.missing(), 7 * (stretches.len() as u64 - 1));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn sums_of_24_bit_samples_with_gaps_are_exact(
        stretches in prop::collection::vec(prop::collection::vec(-(1 << 23)..1_i32 << 23, 1..700), 1..4)
    ) {
        assert_exact::<1>(&stretches);
        assert_exact::<2>(&stretches);
        assert_exact::<4>(&stretches);
        assert_exact::<8>(&stretches);
        assert_exact::<16>(&stretches);
    }

    #[test]
    fn merging_two_stretches_equals_a_gap_between_them(
        samples in prop::collection::vec(any::<i32>(), 2..600), seam in 0.0..1.0
    ) {
        let (first, second) = samples.split_at((samples.len() as f64 * seam) as usize);
        let (mut merged, mut later, mut gapped) = (Cascade::<9, 8>::new(), Cascade::<9, 8>::new(), Cascade::<9, 8>::new());
        merged.push_slice(first);
        later.push_slice(second);
        merged.merge(&later);
        gapped.push_slice(first);
        gapped.gap(1);
        gapped.push_slice(second);
        for octave in 0..9 {
            prop_assert_eq!(merged.sum_of_squares(octave), gapped.sum_of_squares(octave));
        }
        prop_assert_eq!(merged.len(), samples.len() as u64);
    }
}

#[test]
fn an_offset_of_the_samples_does_not_change_the_sums() {
    let plain: Vec<i32> = (0..500).map(|k| (k * k * 31 + k * 7) % 256).collect();
    let offset: Vec<i32> = plain.iter().map(|x| i32::MIN + x).collect();
    let (mut a, mut b) = (Cascade::<8, 8>::new(), Cascade::<8, 8>::new());
    a.push_slice(&plain);
    b.push_slice(&offset);
    assert!((0..8).all(|octave| a.sum_of_squares(octave) == b.sum_of_squares(octave)));
}

#[test]
fn the_curve_of_no_samples_is_empty() {
    let cascade = Cascade::<24, 8>::new();
    assert!(cascade.is_empty());
    assert!(cascade.curve(0.01).points().is_empty());
}

#[test]
fn an_estimator_with_24_octaves_takes_less_than_2_4_kb_at_overlap_4_and_4_kb_at_overlap_8() {
    let bytes = [Cascade::<24, 4>::memory(), Cascade::<24, 8>::memory(), Cascade::<24, 16>::memory()];
    println!("24 octaves at P = 4, 8, 16: {bytes:?} bytes");
    assert!(bytes[0] <= 2_400 && bytes[1] <= 4_000, "{bytes:?}");
}

proptest! {
    #[test]
    fn slices_and_single_samples_give_the_same_state(
        slices in prop::collection::vec((prop::collection::vec(any::<i32>(), 0..2_500), 0..3_u32, 0..32_u32), 1..6)
    ) {
        let (mut sliced, mut single) = (Cascade::<13, 8>::new(), Cascade::<13, 8>::new());
        for (slice, missing, shift) in &slices {
            let samples: Vec<i32> = slice.iter().map(|sample| sample >> shift).collect();
            sliced.push_slice(&samples);
            samples.iter().for_each(|&sample| single.push(sample));
            sliced.gap(*missing);
            single.gap(*missing);
        }
        // The sums and the delay lines.
        prop_assert!(sliced == single);
    }
}

type Estimator = Cascade<12, 8>;

fn sample(k: i64) -> i32 {
    (k * k % 30_011 - 15_005) as i32
}

#[test]
fn a_restored_estimator_equals_one_with_a_gap_at_the_restart() {
    for split in [0, 1, 2, 7, 16, 100, 4_095, 4_096, 5_000] {
        let mut unbroken = Estimator::new();
        let mut before = Estimator::new();
        (0..split).for_each(|k| unbroken.push(sample(k)));
        (0..split).for_each(|k| before.push(sample(k)));
        let mut after = Estimator::new();
        after.restore(before.len(), before.missing(), |octave| before.octave_sums(octave).unwrap());
        unbroken.gap(3);
        after.gap(3);
        (split..9_000).for_each(|k| unbroken.push(sample(k)));
        (split..9_000).for_each(|k| after.push(sample(k)));
        assert_eq!(after, unbroken, "{split}");
    }
    assert_eq!(Estimator::new().octave_sums(12), None);
}

const MODULUS: i64 = 2_147_483_647;

/// The integers of the NBS14 1000-point set. The published values (NIST SP 1065, and values of other programs for octaves
/// with partial overlap) are for these integers divided by the modulus.
fn nbs14() -> impl Iterator<Item = i32> {
    std::iter::successors(Some(1_234_567_890_i64), |n| Some(16_807 * n % MODULUS)).take(1_000).map(|n| n as i32)
}

fn assert_adev<const OVERLAP: usize>(expected: &[(u64, f64)], windows: &[(u64, u64)], digits: f64) {
    let mut cascade = Cascade::<10, OVERLAP>::new();
    nbs14().for_each(|sample| cascade.push(sample));
    let curve = cascade.curve(1.0).scaled(1.0 / MODULUS as f64);
    for &(n, adev) in expected {
        let point = curve.points().iter().find(|point| point.n == n).expect("every octave up to 256");
        assert!((point.avar.sqrt() - adev).abs() <= digits, "P = {OVERLAP}, n = {n}: {}", point.avar.sqrt());
    }
    for &(n, count) in windows {
        assert_eq!(curve.points().iter().find(|point| point.n == n).expect("octave").count, count);
    }
}

#[test]
fn nbs14_deviations_without_overlap() {
    let expected = [
        (1, 2.922_318_781e-1),
        (2, 2.051_016_156e-1),
        (4, 1.494_271_424e-1),
        (8, 1.101_348_033e-1),
        (16, 6.238_133_981e-2),
        (32, 5.623_294_473e-2),
        (64, 3.254_990_544e-2),
        (128, 3.385_519_512e-2),
        (256, 1.079_927_226e-2),
    ];
    assert_adev::<1>(&expected, &[], 5e-11);
}

#[test]
fn nbs14_deviations_with_full_overlap() {
    let expected = [
        (1, 2.922_318_781e-1),
        (2, 2.010_160_422e-1),
        (4, 1.447_913_072e-1),
        (8, 1.057_038_501e-1),
        (16, 6.191_477_842e-2),
    ];
    assert_adev::<16>(&expected, &[], 5e-11);
    assert_adev::<8>(&expected[..4], &[], 5e-11);
}

#[test]
fn nbs14_deviations_with_partial_overlap() {
    assert_adev::<4>(
        &[
            (8, 1.043_766_441e-1),
            (16, 6.318_483_727e-2),
            (32, 4.876_785_674e-2),
            (64, 3.836_685_149e-2),
            (128, 3.105_885_750e-2),
        ],
        &[(8, 493), (16, 243), (32, 118), (64, 55), (128, 24)],
        5e-11,
    );
    assert_adev::<8>(
        &[(16, 6.166_307_060e-2), (32, 4.793_906_114e-2), (64, 3.718_615_571e-2), (128, 2.925_541_291e-2)],
        &[(16, 485), (32, 235), (64, 110), (128, 47)],
        5e-11,
    );
    assert_adev::<16>(
        &[(32, 4.752_266_711e-2), (64, 3.688_913_691e-2), (128, 2.850_658_259e-2)],
        &[(32, 469), (64, 219), (128, 94)],
        5e-11,
    );
}

#[test]
fn losing_two_percent_of_the_samples_does_not_bias_the_variance() {
    const OVERLAP: u64 = 8;
    const SAMPLES: u64 = 1 << 20;
    const LOST: f64 = 0.02;
    const DEVIATION: f64 = 1_000.0;
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut cascade = Cascade::<8, { OVERLAP as usize }>::new();
    let mut lost = 0;
    for _ in 0..SAMPLES {
        let normal: f64 = StandardNormal.sample(&mut rng);
        if rng.random_bool(LOST) {
            cascade.gap(1);
            lost += 1;
        } else {
            cascade.push((7e6 + DEVIATION * normal).round() as i32);
        }
    }
    assert_eq!((cascade.missing(), cascade.len()), (lost, SAMPLES - lost));
    for point in cascade.curve(1.0).points() {
        let kept = f64::powf(1.0 - LOST, 2.0 * point.n as f64);
        let stride = (point.n / OVERLAP).max(1) as f64;
        // A stretch of L samples has differences that end at 2n, 2n + stride … L; L is geometrically distributed.
        let expected = SAMPLES as f64 * LOST * kept / (1.0 - f64::powf(1.0 - LOST, stride));
        // Number of stretches that reach 2n, each with an exponentially distributed number of differences: the variance is
        // twice their number.
        let tolerance = 4.0 * (2.0 / (SAMPLES as f64 * LOST * kept)).sqrt();
        assert!(
            (point.count as f64 / expected - 1.0).abs() < tolerance,
            "n = {}: {} of {expected}",
            point.n,
            point.count
        );

        // Four standard deviations. Differences in different stretches are independent, so the true deviation is smaller.
        let edf = edf(point.n, point.count, point.overlap, VarianceFractions::WHITE);
        let ratio = point.avar * point.n as f64 / (DEVIATION * DEVIATION);
        assert!((ratio - 1.0).abs() < 4.0 * (2.0 / edf).sqrt(), "n = {}: {ratio}", point.n);
    }
    assert_eq!(cascade.curve(1.0).points().len(), 8);
}
