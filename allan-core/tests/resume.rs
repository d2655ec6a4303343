//! An estimator that was stored and gone on from is one with a gap at the restart.

use allan_core::Cascade;

type Estimator = Cascade<12, 8>;

fn sample(k: i64) -> i32 {
    (k * k % 30_011 - 15_005) as i32
}

#[test]
fn what_was_learnt_goes_on_at_every_split() {
    for split in [0, 1, 2, 7, 16, 100, 4_095, 4_096, 5_000] {
        let mut unbroken = Estimator::new();
        let mut before = Estimator::new();
        (0..split).for_each(|k| unbroken.push(sample(k)));
        (0..split).for_each(|k| before.push(sample(k)));
        let learnt = core::array::from_fn(|octave| before.learnt(octave).unwrap());
        let mut after = Estimator::resumed(before.len(), before.missing(), &learnt);
        unbroken.gap(3);
        after.gap(3);
        (split..9_000).for_each(|k| unbroken.push(sample(k)));
        (split..9_000).for_each(|k| after.push(sample(k)));
        assert_eq!(after, unbroken, "{split}");
    }
    assert_eq!(Estimator::new().learnt(12), None);
}
