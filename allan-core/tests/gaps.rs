//! What missing samples do to a curve: records with losses against the same records without, and against the formula for
//! white noise.

use allan_core::{AllanPoint, Cascade, FractionalOctaves, Hadamard};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::ops::Range;

const OCTAVES: usize = 14;
const SAMPLES: usize = 1 << 15;

/// Estimators of one channel that see every sample.
struct Estimators {
    cascade: Cascade<OCTAVES, 8>,
    hadamard: Hadamard<OCTAVES, 8>,
    fractional: FractionalOctaves<OCTAVES, 8>,
}

impl Estimators {
    /// The estimators of a record that lacks the samples of these stretches.
    fn new(record: &[i32], gaps: &[Range<usize>]) -> Self {
        let mut all = Self { cascade: Cascade::new(), hadamard: Hadamard::new(), fractional: FractionalOctaves::new() };
        let mut next = 0;
        for gap in gaps.iter().chain([&(record.len()..record.len())]) {
            for &sample in &record[next..gap.start] {
                all.cascade.push(sample);
                all.hadamard.observe(&all.cascade);
                all.fractional.observe(&all.cascade);
            }
            all.cascade.gap(gap.len() as u32);
            next = gap.end;
        }
        all
    }

    /// Averaging factor, variance and subtracted variance of all points of all statistics, the Allan variance first.
    fn variances(&self) -> Vec<(u64, f64, f64)> {
        let allan = |point: &AllanPoint| (point.n, point.avar, point.interpolation);
        let curve = self.fractional.curve::<{ 4 * OCTAVES }>(&self.cascade, 1.0);
        let hadamard = self.hadamard.points(&self.cascade, 1.0);
        let hadamard = hadamard.iter().map(|point| (point.n, point.hvar, point.interpolation));
        curve.points().iter().map(allan).chain(hadamard).collect()
    }
}

/// White noise of 1,000 counts and a walk with steps of `step` counts.
fn record(step: f64, seed: u64) -> Vec<i32> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let mut walk = 0.0;
    let mut sample = || {
        walk += step * normal();
        (walk + 1_000.0 * normal()).round() as i32
    };
    (0..SAMPLES).map(|_| sample()).collect()
}

/// Losses at random times of a probability per sample, each `length` samples long, with at least `apart` samples between.
fn losses(probability: f64, length: Range<usize>, apart: usize, seed: u64) -> Vec<Range<usize>> {
    let mut random = ChaCha8Rng::seed_from_u64(1_000 + seed);
    let mut gaps = Vec::new();
    let mut at = 1;
    while at + length.end < SAMPLES {
        if random.random_bool(probability) {
            let end = at + random.random_range(length.clone());
            gaps.push(at..end);
            at = end + apart;
        } else {
            at += 1;
        }
    }
    gaps
}

/// Mean of values and its standard error.
fn mean(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

/// Compares 64 records with losses to the complete ones: the mean of each variance agrees within 4.5 standard errors of the
/// differences (0.3 % for all 140 comparisons of a call together), and would not without the correction where `visible`.
fn assert_unbiased(step: f64, losses: impl Fn(u64) -> Vec<Range<usize>>, visible: impl Fn(u64) -> bool) {
    let pairs: Vec<_> = (0..64)
        .map(|seed| {
            let record = record(step, seed);
            let [complete, lossy] = [&[][..], &losses(seed)].map(|gaps| Estimators::new(&record, gaps).variances());
            assert_eq!(complete.len(), lossy.len(), "the longest averaging time is that of the complete record");
            (complete, lossy)
        })
        .collect();
    let mut seen = 0;
    for at in 0..pairs[0].0.len() {
        let n = pairs[0].0[at].0;
        let differences: Vec<f64> = pairs.iter().map(|(complete, lossy)| lossy[at].1 - complete[at].1).collect();
        let added: Vec<f64> = pairs.iter().map(|(_, lossy)| lossy[at].2).collect();
        let (bias, error) = mean(&differences);
        assert!(bias.abs() <= 4.5 * error, "point {at}, n = {n}: {bias} ± {error}");
        if visible(n) {
            let uncorrected = bias + mean(&added).0;
            assert!(uncorrected > 5.0 * error, "point {at}, n = {n}: {uncorrected} ± {error} without the correction");
            seen += 1;
        }
    }
    assert!(seen >= 4, "{seen} points show the effect of replaced samples");
}

#[test]
fn single_losses_do_not_bias_the_variances_of_white_noise() {
    assert_unbiased(0.0, |seed| losses(0.02, 1..2, 1, seed), |n| (16..=32).contains(&n));
}

#[test]
fn single_losses_do_not_bias_the_variances_of_a_walk() {
    // The walk exceeds the white noise from 32 samples on.
    assert_unbiased(54.0, |seed| losses(0.02, 1..2, 1, seed), |n| n == 16 || n == 20 || n == 24);
}

#[test]
fn losses_in_a_row_do_not_bias_the_variances_of_white_noise() {
    // 1.5 % of the samples, 6 in a row on average: more than five are tested on a coarser grid.
    assert_unbiased(0.0, |seed| losses(0.003, 1..12, 40, seed), |n| (128..=192).contains(&n));
}

#[test]
fn the_subtracted_variance_of_white_noise_is_that_of_the_formula() {
    let mut replaced = 0.0;
    let mut interpolation = [0.0; OCTAVES];
    let mut variance = [0.0; OCTAVES];
    for seed in 0..40 {
        let lossy = Estimators::new(&record(0.0, seed), &losses(0.01, 1..2, 4, seed));
        for (octave, point) in lossy.cascade.curve(1.0).points().iter().enumerate() {
            assert_eq!(point.replaced > 0.0, octave >= 3, "shorter octaves leave out the differences over a gap");
            interpolation[octave] += point.interpolation / 40.0;
            variance[octave] += 1e6 / point.n as f64 / 40.0;
            replaced += if octave == 3 { point.replaced / 40.0 } else { 0.0 };
        }
    }
    assert!((0.008..0.01).contains(&replaced));
    for octave in 3..OCTAVES - 1 {
        let n = f64::from(1 << octave);
        // Each replaced sample has 3/2 of the variance of a sample, those at an edge of a difference less.
        let expected = 1.5 * replaced * (1.0 - 2.0 / n) * variance[octave];
        // 40 · 32,768 · 0.0097 tests, each a squared normal value: four standard deviations.
        let tolerance = 4.0 * (2.0 / (40.0 * SAMPLES as f64 * 0.0097_f64)).sqrt();
        assert!((interpolation[octave] / expected - 1.0).abs() < tolerance, "n = {n}: {}", interpolation[octave]);
    }
}

#[test]
fn losses_of_a_few_percent_cost_few_degrees_of_freedom_and_no_octave() {
    let record = record(0.0, 1);
    let gaps = losses(0.02, 1..2, 1, 1);
    let share = gaps.len() as f64 / SAMPLES as f64;
    let [complete, lossy] = [&[][..], &gaps].map(|gaps| Estimators::new(&record, gaps).cascade.curve(1.0));
    assert_eq!(complete.points().len(), lossy.points().len());
    for (complete, lossy) in complete.points().iter().zip(lossy.points()).skip(3).take(5) {
        let left = lossy.edf / complete.edf;
        // Differences that touch two neighbouring losses, which n = 8 leaves out, and (1 + 3p/2)² for the subtraction.
        let most = 1.0 - 3.2 * share - (2.0 * 8.0 + 2.0) * share * share;
        assert!((most..=1.0).contains(&left), "n = {}: {left}, at least {most}", lossy.n);
    }
}

#[test]
fn a_burst_every_second_leaves_the_kurtosis_of_gaussian_noise() {
    let record = record(0.0, 3);
    let gaps: Vec<_> = (100..SAMPLES - 100).step_by(200).map(|start| start..start + 1).collect();
    let curve = Estimators::new(&record, &gaps).cascade.curve(1.0);
    for point in curve.points().iter().filter(|point| point.edf > 200.0) {
        // The kurtosis of so many independent Gaussian values has a standard deviation of √(24/edf).
        let kurtosis = point.kurtosis.expect("differences that are not 0");
        assert!(kurtosis.abs() < 4.0 * (24.0 / point.edf).sqrt(), "n = {}: {kurtosis}", point.n);
    }
}

#[test]
fn a_gap_before_the_first_sample_or_after_the_last_changes_nothing() {
    let record = record(0.0, 5);
    let plain = Estimators::new(&record, &[]);
    let mut late = Cascade::<OCTAVES, 8>::new();
    late.gap(1 << OCTAVES);
    late.push_slice(&record);
    late.gap(9);
    assert_eq!(late.curve(1.0).points(), plain.cascade.curve(1.0).points());
    assert_eq!((late.missing(), late.len()), ((1 << OCTAVES) + 9, SAMPLES as u64));
}

#[test]
fn the_longest_gaps_are_counted_and_cut_out() {
    let mut cascade = Cascade::<24, 8>::new();
    for _ in 0..3 {
        cascade.push_slice(&[1, 2, 3, 4]);
        cascade.gap(u32::MAX);
        cascade.gap(u32::MAX);
    }
    assert_eq!(cascade.missing(), 6 * u64::from(u32::MAX));
    assert_eq!(cascade.sum_of_squares(0), Some((9, 9)));
    assert_eq!(cascade.sum_of_squares(1), Some((3 * 16, 3)));
    assert_eq!(cascade.sum_of_squares(2), Some((0, 0)));
}

#[test]
fn the_variance_of_one_octave_is_that_of_the_curve() {
    let lossy = Estimators::new(&record(0.0, 9), &losses(0.02, 1..9, 1, 9)).cascade;
    for (octave, point) in lossy.curve(1.0).points().iter().enumerate() {
        assert_eq!(lossy.allan_variance(octave), Some(point.avar), "n = {}", point.n);
    }
    assert_eq!(lossy.allan_variance(OCTAVES), None);
    assert_eq!(Cascade::<OCTAVES, 8>::new().allan_variance(0), None);
}
