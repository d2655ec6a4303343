//! The effect of missing samples on a curve: records with losses against the same records without, and against the formula for
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

/// The 95 % bounds of what is left after a subtraction hold the variance of white noise, 10⁶/n, in 95 % of 600 records within four
/// binomial standard deviations, from 8 samples on: shorter averaging times leave out what touches a lost sample.
#[test]
fn bounds_hold_the_variance_where_much_was_subtracted() {
    const RECORDS: u64 = 600;
    let mut covered = [0_u32; OCTAVES];
    let mut most_subtracted = 0.0_f64;
    for seed in 0..RECORDS {
        let record = record(0.0, 5_000 + seed);
        let curve = Estimators::new(&record, &losses(0.4, 1..2, 2, seed)).cascade.curve(1.0);
        for (octave, point) in curve.points().iter().enumerate() {
            covered[octave] += u32::from((point.low..=point.high).contains(&(1e6 / point.n as f64)));
            most_subtracted = most_subtracted.max(point.interpolation / (point.avar + point.interpolation));
        }
    }
    let (mean, deviation) = (0.95 * RECORDS as f64, (0.95 * 0.05 * RECORDS as f64).sqrt());
    for (octave, covered) in covered.into_iter().enumerate().skip(3) {
        assert!((f64::from(covered) - mean).abs() < 4.0 * deviation, "n = {}: {covered} of {RECORDS}", 1 << octave);
    }
    assert!(most_subtracted > 0.2, "{most_subtracted}");
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

/// A sample that is lost when too few are known to test its replacement: it is off by its own noise and half of that of its two
/// neighbours, which the second and third differences over it share among all samples.
#[test]
fn a_gap_without_a_test_adds_what_white_noise_would() {
    let lossy = Estimators::new(&record(0.0, 2), std::slice::from_ref(&(2..3)));
    let curve = lossy.cascade.curve(1.0);
    let allan = curve.points().iter().map(|point| (point.n, point.interpolation));
    let hadamard = lossy.hadamard.points(&lossy.cascade, 1.0);
    let added = allan.chain(hadamard.iter().map(|point| (point.n, point.interpolation)));
    for (n, added) in added.filter(|&(n, _)| n >= 8) {
        let expected = 1.5 * curve.points()[0].avar / n as f64 / SAMPLES as f64;
        assert!((added / expected - 1.0).abs() < 1e-6, "n = {n}: {added}, expected {expected}");
    }
}

/// A record in which the missing samples have been replaced, as [`Cascade`] says, without a delay line: all samples are kept.
struct Filled<const OVERLAP: usize> {
    /// Running sums: of no sample, of the first, of the first two…
    sums: Vec<i64>,
    /// Samples before the first that an octave may use, and before the first after the last gap.
    resumed: [usize; OCTAVES],
    last_gap: usize,
    /// Sums of squares, numbers of differences; replaced and tested samples and squared errors of the tests.
    octaves: [(u128, u64); OCTAVES],
    interpolations: [(u32, u32, u128); OCTAVES],
}

impl<const OVERLAP: usize> Filled<OVERLAP> {
    /// Octave from which on single missing samples are bridged: the first at which they are at most 1/8 of the averaging time and an
    /// octave takes no more than one difference within.
    const SHORTEST: usize = if OVERLAP == 16 { 4 } else { 3 };

    fn new() -> Self {
        let (octaves, interpolations) = ([(0, 0); OCTAVES], [(0, 0, 0); OCTAVES]);
        Self { sums: vec![0], resumed: [0; OCTAVES], last_gap: 0, octaves, interpolations }
    }

    fn elapsed(&self) -> usize {
        self.sums.len() - 1
    }

    /// Sum of the samples of these numbers.
    fn sum(&self, samples: Range<usize>) -> i64 {
        self.sums[samples.end] - self.sums[samples.start]
    }

    /// Takes a sample, in the octaves from `first` on: one second difference at every multiple of the stride, `OVERLAP` in an
    /// averaging time.
    fn push(&mut self, sample: i64, first: usize) {
        self.sums.push(self.sums[self.elapsed()] + sample);
        let time = self.elapsed();
        for k in first..OCTAVES {
            let n = 1 << k;
            if time.is_multiple_of((n / OVERLAP).max(1)) && time >= self.resumed[k] + 2 * n {
                let difference = self.sum(time - n..time) - self.sum(time - 2 * n..time - n);
                self.octaves[k].0 += u128::from(difference.unsigned_abs()).pow(2);
                self.octaves[k].1 += 1;
            }
        }
    }

    /// Replaces `missing` samples before `next`.
    fn gap(&mut self, missing: usize, next: i64) {
        let (start, known) = (self.elapsed(), self.elapsed() - self.last_gap);
        let class = Self::SHORTEST + missing.next_power_of_two().ilog2() as usize;
        let bridging = if known > 0 { class.min(OCTAVES) } else { OCTAVES };
        self.resumed[..bridging].fill(start + missing);
        self.last_gap = start + missing;
        let mut replaced = 0;
        if bridging < OCTAVES {
            self.test(missing, bridging, start - known);
            // As many samples before as are missing on both sides, but for the one after; from where a sum is kept: each line has
            // twice the stride of the one before.
            let (mut before, mut stride) = (known.min(2 * missing - 1), 1);
            while before >= 2 * OVERLAP * stride {
                stride *= 2;
            }
            before = start - (start - before).next_multiple_of(stride);
            let sum = self.sum(start - before..start) + next;
            replaced = (i128::from(sum) * missing as i128).div_euclid(before as i128 + 1) as i64;
        }
        let each = replaced.div_euclid(missing as i64);
        for index in 1..=missing {
            self.push(if index < missing { each } else { replaced - each * (missing as i64 - 1) }, bridging);
        }
    }

    /// Replaces samples that are known, with the same number on both sides where there is a sample for each, else in multiples of the
    /// least power of two with which twenty of them are not too few, with twice as many before.
    fn test(&mut self, missing: usize, bridging: usize, first_known: usize) {
        self.interpolations[bridging].0 += missing as u32;
        let mut stride = 1;
        while (missing + stride / 2) / stride > (2 * OVERLAP - 1) / 3 {
            stride *= 2;
        }
        let (width, newest) = ((missing + stride / 2) / stride * stride, self.elapsed() / stride * stride);
        if width == 0 || newest < first_known + 3 * width {
            return;
        }
        let (end, after) = if stride == 1 { (newest - 1, self.sum(newest - 1..newest)) } else { (newest, 0) };
        let around = self.sum(newest - 3 * width..end - width) + after;
        let error = around.div_euclid(2) - self.sum(end - width..end);
        self.interpolations[bridging].1 += width as u32;
        self.interpolations[bridging].2 += u128::from(error.unsigned_abs()).pow(2);
    }
}

fn assert_filled<const OVERLAP: usize>(gaps: &[Range<usize>], seed: u64) {
    let record = record(54.0, seed);
    let (mut cascade, mut filled) = (Cascade::<OCTAVES, OVERLAP>::new(), Filled::<OVERLAP>::new());
    let mut next = 0;
    for gap in gaps.iter().chain([&(record.len()..record.len())]) {
        cascade.push_slice(&record[next..gap.start]);
        record[next..gap.start].iter().for_each(|&sample| filled.push(sample.into(), 0));
        next = gap.end;
        if let Some(&sample) = record.get(next) {
            cascade.gap(gap.len() as u32);
            filled.gap(gap.len(), sample.into());
        }
    }
    for k in 0..OCTAVES {
        let found = cascade.octave_sums(k).expect("an octave");
        assert_eq!((found.squares, found.count), filled.octaves[k], "overlap {OVERLAP}, seed {seed}, octave {k}");
        let gaps = found.interpolation;
        let gaps = (gaps.replaced(), gaps.tested(), gaps.squared_error());
        assert_eq!(gaps, filled.interpolations[k], "overlap {OVERLAP}, seed {seed}, gaps of octave {k}");
    }
}

/// The sums over a record with gaps are, bit for bit, those of the record with the missing samples replaced by the mean of as many
/// around them: single gaps, gaps with few samples between, gaps of all lengths up to those that every octave leaves out.
#[test]
fn the_sums_are_those_of_the_filled_record() {
    for seed in 0..8 {
        let gaps = [
            losses(0.02, 1..2, 1, seed),
            losses(0.1, 1..9, 1, seed),
            losses(0.003, 1..70, 1, seed),
            losses(0.0005, 1..3_000, 2, seed),
        ];
        for gaps in &gaps {
            assert_filled::<1>(gaps, seed);
            assert_filled::<8>(gaps, seed);
            assert_filled::<16>(gaps, seed);
        }
    }
}
