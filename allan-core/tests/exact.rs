//! Bit for bit against sums over all the samples at once.

use allan_core::Cascade;
use proptest::prelude::*;

const OCTAVES: usize = 9;

/// Second differences of block sums inside one gapless stretch, straight from the definition.
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
    fn any_24_bit_samples_with_any_gaps(
        stretches in prop::collection::vec(prop::collection::vec(-(1 << 23)..1_i32 << 23, 1..700), 1..4)
    ) {
        assert_exact::<1>(&stretches);
        assert_exact::<2>(&stretches);
        assert_exact::<4>(&stretches);
        assert_exact::<8>(&stretches);
        assert_exact::<16>(&stretches);
    }

    #[test]
    fn merging_is_a_gap_at_the_seam(
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
fn an_offset_that_fills_the_word_changes_nothing() {
    let plain: Vec<i32> = (0..500).map(|k| (k * k * 31 + k * 7) % 256).collect();
    let offset: Vec<i32> = plain.iter().map(|x| i32::MIN + x).collect();
    let (mut a, mut b) = (Cascade::<8, 8>::new(), Cascade::<8, 8>::new());
    a.push_slice(&plain);
    b.push_slice(&offset);
    assert!((0..8).all(|octave| a.sum_of_squares(octave) == b.sum_of_squares(octave)));
}

#[test]
fn nothing_pushed_gives_an_empty_curve() {
    let cascade = Cascade::<24, 8>::new();
    assert!(cascade.is_empty());
    assert!(cascade.curve(0.01).points().is_empty());
}

#[test]
fn a_channel_at_8_fold_overlap_and_24_octaves_takes_less_than_4_kb() {
    let bytes = [Cascade::<24, 4>::memory(), Cascade::<24, 8>::memory(), Cascade::<24, 16>::memory()];
    println!("24 octaves at P = 4, 8, 16: {bytes:?} bytes");
    assert!(bytes[0] <= 2_400 && bytes[1] <= 4_000, "{bytes:?}");
}

proptest! {
    #[test]
    fn slices_of_any_length_and_single_samples_are_the_same(
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
        // What was learnt, and what is still in the rings.
        prop_assert!(sliced == single);
    }
}
