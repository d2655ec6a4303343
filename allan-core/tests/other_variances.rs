//! The statistics that are made of a cascade's running sums: Hadamard variance and factors between the octaves.

use allan_core::{Cascade, FractionalOctaves, Hadamard, VarianceFractions};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const OCTAVES: usize = 9;
const MODULUS: i64 = 2_147_483_647;

struct Estimators<const OVERLAP: usize> {
    cascade: Cascade<OCTAVES, OVERLAP>,
    hadamard: Hadamard<OCTAVES, OVERLAP>,
    fractional: FractionalOctaves<OCTAVES, OVERLAP>,
}

fn estimate<const OVERLAP: usize>(stretches: &[Vec<i32>]) -> Estimators<OVERLAP> {
    let mut all =
        Estimators { cascade: Cascade::new(), hadamard: Hadamard::new(), fractional: FractionalOctaves::new() };
    let mut elapsed: usize = 0;
    for stretch in stretches {
        // Too long for every octave to bridge, and up to a multiple of all strides.
        let start = elapsed.next_multiple_of(1 << OCTAVES) + (1 << OCTAVES);
        all.cascade.gap((start - elapsed) as u32);
        elapsed = start + stretch.len();
        for &sample in stretch {
            all.cascade.push(sample);
            all.hadamard.observe(&all.cascade);
            all.fractional.observe(&all.cascade);
        }
    }
    all
}

/// Sum and number of the squared differences of sums of `n` samples with the weights `binomials`, by definition.
fn by_definition(stretches: &[Vec<i32>], n: usize, stride: usize, binomials: &[i128]) -> (u128, u64) {
    let mut total = (0, 0);
    for stretch in stretches {
        let block = |start: usize| stretch[start..start + n].iter().map(|&x| i128::from(x)).sum::<i128>();
        let span = n * binomials.len();
        for start in (0..).step_by(stride).take_while(|start| start + span <= stretch.len()) {
            let difference: i128 = binomials.iter().enumerate().map(|(k, weight)| weight * block(start + k * n)).sum();
            total = (total.0 + difference.unsigned_abs().pow(2), total.1 + 1);
        }
    }
    total
}

fn assert_exact<const OVERLAP: usize>(stretches: &[Vec<i32>]) {
    let found = estimate::<OVERLAP>(stretches);
    for octave in 0..OCTAVES - 1 {
        let n = 1 << octave;
        let expected = by_definition(stretches, n, (2 * n / OVERLAP).max(1), &[1, -2, 1]);
        assert_eq!(found.hadamard.sum_of_squares(octave), Some(expected), "P = {OVERLAP}, n = {n}");
    }
    for n in [5_usize, 6, 7, 10, 12, 14, 20, 24, 28, 80, 96, 112, 160, 192, 224] {
        let stride = (1_usize << n.ilog2()) * 2 / OVERLAP;
        let expected = by_definition(stretches, n, stride.max(1), &[-1, 1]);
        assert_eq!(found.fractional.sum_of_squares(n as u64), Some(expected), "P = {OVERLAP}, n = {n}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn sums_are_exact(
        stretches in prop::collection::vec(prop::collection::vec(-(1 << 23)..1_i32 << 23, 1..900), 1..3)
    ) {
        assert_exact::<8>(&stretches);
        assert_exact::<16>(&stretches);
    }

    #[test]
    fn merging_two_stretches_equals_a_gap_between_them(
        first in prop::collection::vec(any::<i32>(), 0..600), second in prop::collection::vec(any::<i32>(), 0..600)
    ) {
        let whole = estimate::<8>(&[first.clone(), second.clone()]);
        let (mut early, late) = (estimate::<8>(&[first]), estimate::<8>(&[second]));
        early.hadamard.merge(&late.hadamard);
        early.fractional.merge(&late.fractional);
        prop_assert_eq!(early.hadamard, whole.hadamard);
        prop_assert_eq!(early.fractional, whole.fractional);
    }
}

#[test]
fn hadamard_deviations_are_those_of_the_published_sets() {
    // NIST SP 1065: OHDEV of the nine values, and of the 1000-point set at n = 1.
    let nine = [892, 809, 823, 798, 671, 644, 883, 903, 677];
    let estimators = estimate::<8>(&[nine.to_vec()]);
    let points = estimators.hadamard.points(&estimators.cascade, 1.0);
    assert!((points[0].hvar.sqrt() - 70.80607).abs() < 5e-6 + 1e-5, "{}", points[0].hvar.sqrt());
    assert!((points[1].hvar.sqrt() - 85.61487).abs() < 5e-6, "{}", points[1].hvar.sqrt());
    let thousand = std::iter::successors(Some(1_234_567_890_i64), |n| Some(16_807 * n % MODULUS)).take(1_000);
    let estimators = estimate::<8>(&[thousand.map(|n| n as i32).collect()]);
    let points = estimators.hadamard.points(&estimators.cascade, 1.0);
    assert!((points[0].hvar.sqrt() / MODULUS as f64 - 2.943_883e-1).abs() < 5e-8);
}

#[test]
fn the_deviation_between_octaves_is_that_of_the_published_set() {
    // OADEV at n = 10, which 16-fold overlap takes at every sample.
    let thousand = std::iter::successors(Some(1_234_567_890_i64), |n| Some(16_807 * n % MODULUS)).take(1_000);
    let found = estimate::<16>(&[thousand.map(|n| n as i32).collect()]);
    let curve = found.fractional.curve::<36>(&found.cascade, 1.0).scaled(1.0 / MODULUS as f64);
    let point = curve.points().iter().find(|point| point.n == 10).unwrap();
    assert!((point.avar.sqrt() - 9.159_953e-2).abs() < 5e-9, "{}", point.avar.sqrt());
}

#[test]
fn a_narrow_line_is_largest_at_a_factor_between_the_octaves() {
    // σ² of a sampled sinusoid: A² sin⁴(πfn)/(n² sin²(πf)); largest at f·n = 0.371, here n = 96 = 1.5·64.
    let (amplitude, frequency) = (1e5, 0.371 / 96.0);
    let phase = |k: u32| std::f64::consts::TAU * frequency * f64::from(k);
    let samples = (0..1 << 18).map(|k| (amplitude * phase(k).sin()).round() as i32).collect();
    let found = estimate::<8>(&[samples]);
    let curve = found.fractional.curve::<36>(&found.cascade, 1.0);
    let peak = curve.points().iter().max_by(|a, b| a.avar.total_cmp(&b.avar)).unwrap();
    assert_eq!(peak.n, 96);
    for point in curve.points().iter().filter(|point| point.n >= 16) {
        let half = std::f64::consts::PI * frequency;
        let expected = (amplitude * (half * point.n as f64).sin().powi(2) / (point.n as f64 * half.sin())).powi(2);
        assert!((point.avar / expected - 1.0).abs() < 1e-3, "n = {}: {} instead of {expected}", point.n, point.avar);
    }
}

fn white(samples: usize, drift: i32, seed: u64) -> Vec<i32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    (0..samples as i32).map(|k| (1_000.0 * normal()).round() as i32 + drift * k).collect()
}

#[test]
fn a_drift_does_not_change_the_hadamard_variance() {
    let level = estimate::<8>(&[white(1 << 14, 0, 1)]);
    let drifting = estimate::<8>(&[white(1 << 14, 50, 1)]);
    assert_eq!(drifting.hadamard, level.hadamard);
    let last = |found: &Estimators<8>| found.cascade.curve(1.0).points()[OCTAVES - 1].avar;
    assert!(last(&drifting) > 100.0 * last(&level), "the Allan variance rises with τ²");
}

#[test]
fn hadamard_bounds_cover_the_variance_of_white_noise_in_95_percent() {
    const RECORDS: usize = 2_000;
    let mut covered = [0_u32; OCTAVES - 1];
    let mut dof = [0.0; OCTAVES - 1];
    for seed in 0..RECORDS {
        let Estimators { cascade, hadamard, .. } = estimate::<8>(&[white(680, 0, seed as u64)]);
        let points = hadamard.points_with(&cascade, 1.0, |_| VarianceFractions::WHITE);
        for (octave, point) in points.iter().enumerate() {
            covered[octave] += u32::from((point.low..=point.high).contains(&(1e6 / point.n as f64)));
            dof[octave] = point.edf;
        }
    }
    for octave in (0..OCTAVES - 1).filter(|&octave| dof[octave] >= 3.0) {
        let coverage = f64::from(covered[octave]) / RECORDS as f64;
        // Four standard deviations of a binomial proportion of 2,000 trials.
        assert!((coverage - 0.95).abs() < 0.02, "n = 2^{octave}, edf {}: {coverage}", dof[octave]);
    }
    assert!(dof[7] > 3.0 && dof[7] < 5.0, "edf of the last octave: {}", dof[7]);
}
