//! Samples lost at random bias nothing and cost only the differences that they touch.

use allan_core::Cascade;
use allan_core::confidence::{Shares, edf};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const OVERLAP: u64 = 8;

#[test]
fn two_percent_lost_at_random() {
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
        // A stretch of L samples holds differences that end at 2n, 2n + stride … L; L is geometric.
        let expected = SAMPLES as f64 * LOST * kept / (1.0 - f64::powf(1.0 - LOST, stride));
        // So many stretches reach 2n, and each then holds an exponentially spread number: variance twice their number.
        let tolerance = 4.0 * (2.0 / (SAMPLES as f64 * LOST * kept)).sqrt();
        assert!(
            (point.count as f64 / expected - 1.0).abs() < tolerance,
            "n = {}: {} of {expected}",
            point.n,
            point.count
        );

        // Four standard deviations; differences in different stretches are independent, which is the better case.
        let edf = edf(point.n, point.count, point.overlap, Shares::WHITE);
        let ratio = point.avar * point.n as f64 / (DEVIATION * DEVIATION);
        assert!((ratio - 1.0).abs() < 4.0 * (2.0 / edf).sqrt(), "n = {}: {ratio}", point.n);
    }
    assert_eq!(cascade.curve(1.0).points().len(), 8);
}
