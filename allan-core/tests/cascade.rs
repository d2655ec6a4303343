//! The sums of the estimator: against their definition, published values, gaps, merging and restoring.

use allan_core::Cascade;
use proptest::prelude::*;

const OCTAVES: usize = 9;

/// Sum and number of the squared second differences of block sums inside one stretch without gaps, by definition.
fn sum_of_squares(stretch: &[i32], n: usize, stride: usize) -> (u128, u64) {
    let block = |start: usize| stretch[start..start + n].iter().map(|&x| i128::from(x)).sum::<i128>();
    let starts = (0..).step_by(stride).take_while(|start| start + 2 * n <= stretch.len());
    starts.map(|start| block(start + n) - block(start)).fold((0, 0), |(sum, count), difference| {
        (sum + difference.unsigned_abs() * difference.unsigned_abs(), count + 1)
    })
}

/// A record with its gaps closed as the documentation of `Cascade` says, sample by sample.
#[derive(Default)]
struct Closed {
    samples: Vec<i128>,
    /// First and last missing sample of each gap, and the octave from which on it is bridged.
    gaps: Vec<(usize, usize, usize)>,
    /// Time of the end of the last gap.
    resumed: usize,
}

impl Closed {
    fn push(&mut self, stretch: &[i32]) {
        self.samples.extend(stretch.iter().map(|&sample| i128::from(sample)));
    }

    /// A gap of `missing` samples before a stretch that begins with `next`.
    fn gap(&mut self, missing: usize, next: i32, overlap: usize) {
        let start = self.samples.len();
        let before = (2 * missing - 1).min(start - self.resumed);
        let around: i128 = self.samples[start - before..].iter().sum::<i128>() + i128::from(next);
        let sum = (around * missing as i128).div_euclid(before as i128 + 1);
        let each = sum.div_euclid(missing as i128);
        let bridging = overlap.max(8).ilog2() + missing.next_power_of_two().ilog2();
        let bridging = if before == 0 { OCTAVES } else { (bridging as usize).min(OCTAVES) };
        self.samples.extend(std::iter::repeat_n(each, missing - 1));
        self.samples.push(sum - each * (missing as i128 - 1));
        self.gaps.push((start, start + missing - 1, bridging));
        self.resumed = self.samples.len();
    }

    /// Sum and number of the squared second differences at an octave that touch no gap that it does not bridge.
    fn sum_of_squares(&self, octave: usize, overlap: usize) -> (u128, u64) {
        let n = 1 << octave;
        let stride = (n / overlap).max(1);
        let ends = (2 * n..=self.samples.len()).filter(|end| end % stride == 0);
        let kept = ends.filter(|&end| {
            self.gaps.iter().all(|&(first, last, bridging)| octave >= bridging || last < end - 2 * n || first >= end)
        });
        let block = |start: usize| self.samples[start..start + n].iter().sum::<i128>();
        kept.map(|end| block(end - n) - block(end - 2 * n)).fold((0, 0), |(sum, count), difference| {
            (sum + difference.unsigned_abs() * difference.unsigned_abs(), count + 1)
        })
    }
}

/// `stretches` with a gap of the given length before each. The lengths are below the reach of the first delay line, so that
/// the mean before a gap is that of all samples that it is made of.
fn assert_exact<const OVERLAP: usize>(stretches: &[(usize, Vec<i32>)]) {
    let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
    let mut closed = Closed::default();
    let (mut taken, mut missing) = (0, 0);
    for (gap, stretch) in stretches {
        let gap = gap % (OVERLAP + 1);
        cascade.gap(gap as u32);
        if gap > 0 {
            closed.gap(gap, stretch[0], OVERLAP);
        }
        cascade.push_slice(stretch);
        closed.push(stretch);
        (taken, missing) = (taken + stretch.len(), missing + gap);
    }
    for octave in 0..OCTAVES {
        let expected = closed.sum_of_squares(octave, OVERLAP);
        assert_eq!(cascade.sum_of_squares(octave), Some(expected), "P = {OVERLAP}, n = 2^{octave}");
    }
    assert_eq!((cascade.len(), cascade.missing()), (taken as u64, missing as u64));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn sums_of_24_bit_samples_with_gaps_are_exact(
        stretches in prop::collection::vec(
            (0..17_usize, prop::collection::vec(-(1 << 23)..1_i32 << 23, 1..300)), 1..8)
    ) {
        assert_exact::<1>(&stretches);
        assert_exact::<2>(&stretches);
        assert_exact::<4>(&stretches);
        assert_exact::<8>(&stretches);
        assert_exact::<16>(&stretches);
    }

    #[test]
    fn sums_with_many_short_gaps_are_exact(
        stretches in prop::collection::vec(
            (0..3_usize, prop::collection::vec(-100..100_i32, 1..20)), 1..100)
    ) {
        assert_exact::<4>(&stretches);
        assert_exact::<8>(&stretches);
    }

    #[test]
    fn a_gap_too_long_for_every_octave_is_cut_out(
        first in prop::collection::vec(any::<i32>(), 1..600),
        second in prop::collection::vec(any::<i32>(), 1..600),
    ) {
        // 33 to 64 samples are bridged from n = 512 on, which an estimator with nine octaves does not have. The second
        // stretch starts at a multiple of all strides.
        let missing = first.len().next_multiple_of(32) + 64 - first.len();
        let mut cascade = Cascade::<OCTAVES, 8>::new();
        cascade.push_slice(&first);
        cascade.gap(missing as u32);
        cascade.push_slice(&second);
        for octave in 0..OCTAVES {
            let parts = [&first, &second].map(|part| sum_of_squares(part, 1 << octave, ((1 << octave) / 8).max(1)));
            let expected = (parts[0].0 + parts[1].0, parts[0].1 + parts[1].1);
            prop_assert_eq!(cascade.sum_of_squares(octave), Some(expected));
        }
    }

    #[test]
    fn merging_two_estimators_adds_their_sums(
        samples in prop::collection::vec(any::<i32>(), 2..600), seam in 0.0..1.0
    ) {
        let (first, second) = samples.split_at((samples.len() as f64 * seam) as usize);
        let mut merged = Cascade::<9, 8>::new();
        let mut later = Cascade::<9, 8>::new();
        merged.push_slice(first);
        later.push_slice(second);
        merged.merge(&later);
        for octave in 0..9 {
            let parts = [first, second].map(|part| sum_of_squares(part, 1 << octave, ((1 << octave) / 8).max(1)));
            let expected = (parts[0].0 + parts[1].0, parts[0].1 + parts[1].1);
            prop_assert_eq!(merged.sum_of_squares(octave), Some(expected));
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
fn an_estimator_with_24_octaves_takes_at_most_2_9_kb_at_overlap_4_and_3_7_kb_at_overlap_8() {
    let bytes = [Cascade::<24, 4>::memory(), Cascade::<24, 8>::memory(), Cascade::<24, 16>::memory()];
    println!("24 octaves at P = 4, 8, 16: {bytes:?} bytes");
    assert!(bytes[0] <= 2_900 && bytes[1] <= 3_700, "{bytes:?}");
}

proptest! {
    #[test]
    fn slices_and_single_samples_give_the_same_state(
        slices in prop::collection::vec((prop::collection::vec(any::<i32>(), 0..2_500), 0..700_u32, 0..32_u32), 1..6)
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
fn a_restored_estimator_equals_one_that_is_merged_with_the_later_samples() {
    for split in [0, 1, 2, 7, 16, 100, 4_095, 4_096, 5_000] {
        let (mut before, mut later) = (Estimator::new(), Estimator::new());
        for k in 0..split {
            before.push(sample(k));
            before.gap(u32::from(k % 100 == 50));
        }
        let mut restored = Estimator::new();
        restored.restore(before.len(), before.missing(), |octave| before.octave_sums(octave).unwrap());
        for k in split..9_000 {
            restored.push(sample(k));
            later.push(sample(k));
        }
        before.merge(&later);
        assert_eq!(restored, before, "{split}");
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
