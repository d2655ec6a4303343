//! Curves that are put together for the analysis of whole recordings.

use allan_core::{Cascade, Curve};

/// From eight means on, where the curves of samples and of means have eight differences in an averaging time, the differences are the
/// same ones.
#[test]
fn the_curve_of_means_continues_that_of_the_samples() {
    const MEAN: usize = 4;
    let samples: Vec<i32> = (0..100_000_i32).map(|at| at.wrapping_mul(0x9E37_79B9_u32 as i32) >> 20).collect();
    let (mut whole, mut means) = (Cascade::<14, 8>::new(), Cascade::<14, 8>::new());
    whole.push_slice(&samples);
    samples.chunks_exact(MEAN).for_each(|chunk| means.push(chunk.iter().sum()));
    let whole = whole.curve(0.01);
    let means = means.curve(0.04).scaled(1.0 / MEAN as f64);
    let joined = whole.clone().continued_by_means(&means, MEAN as u64, 8 * MEAN as u64);
    assert_eq!((joined.sample_period(), joined.samples()), (0.01, 100_000));
    assert_eq!(joined.points().len(), whole.points().len());
    for (joined, whole) in joined.points().iter().zip(whole.points()) {
        assert_eq!((joined.n, joined.count, joined.overlap), (whole.n, whole.count, whole.overlap));
        assert!((joined.avar / whole.avar - 1.0).abs() < 1e-12, "{}", whole.n);
    }
    let of_means = Curve::empty().continued_by_means(&means, MEAN as u64, 0);
    assert_eq!(of_means.points()[0].n, 4);
    // Without room, the longest averaging times are left out.
    let full = Curve::<14>::empty().continued_by_means(&means, 1 << 40, 0);
    assert_eq!(full.points().len(), means.points().len().min(14));
}

/// The variance that is taken off for replaced samples is kept beside the variance, and adds up over two times.
#[test]
fn what_is_taken_off_twice_adds_up() {
    let mut curve = Curve::<8>::from_points(0.01, 10_000, 8, &[(1, 4.0), (2, 2.0)]).unwrap();
    for taken in [0.5, 1.0] {
        curve.subtract_interpolation(|n| 0.5 / n as f64);
        for (point, measured) in curve.points().iter().zip([4.0, 2.0]) {
            let expected = taken / point.n as f64;
            assert_eq!((point.interpolation, point.avar), (expected, measured - expected));
        }
    }
}
