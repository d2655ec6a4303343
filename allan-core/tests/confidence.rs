//! Degrees of freedom against the exact table for 2¹⁷ rate samples (Greenhall sums, computed independently).

use allan_core::VarianceFractions;
use allan_core::confidence::edf;

const SAMPLES: u64 = 1 << 17;

fn at(n: u64, overlap: u64, shares: VarianceFractions) -> f64 {
    edf(n, (SAMPLES - 2 * n) * overlap / n + 1, overlap as u32, shares)
}

/// `log2 n`, the edf of the fully overlapping estimator, and the ratio to it at overlaps of 1, 2, 4, 8 and 16.
type Row = (u32, f64, [f64; 5]);

fn assert_table(shares: VarianceFractions, table: &[Row], tolerance: f64) {
    for &(log2_n, full, ratios) in table {
        for (overlap, ratio) in [1, 2, 4, 8, 16].into_iter().zip(ratios) {
            let edf = at(1 << log2_n, overlap, shares);
            // The table has three decimals of the ratio and two of the full edf.
            let rounding = 0.0006 * full + 0.006 * ratio;
            assert!(
                (edf - ratio * full).abs() < rounding + tolerance * edf,
                "n = 2^{log2_n}, P = {overlap}: {edf} instead of {}",
                ratio * full
            );
        }
    }
}

#[test]
fn edf_of_white_noise_is_that_of_the_exact_table() {
    let table: [Row; 6] = [
        (10, 189.75, [0.447, 0.764, 0.929, 0.982, 0.996]),
        (11, 93.76, [0.450, 0.767, 0.931, 0.983, 0.996]),
        (12, 45.76, [0.457, 0.773, 0.934, 0.985, 0.997]),
        (13, 21.78, [0.470, 0.784, 0.942, 0.989, 0.999]),
        (14, 9.82, [0.499, 0.810, 0.959, 0.998, 1.004]),
        (15, 4.00, [0.562, 0.862, 0.994, 1.018, 1.015]),
    ];
    assert_table(VarianceFractions::WHITE, &table, 0.0);
}

#[test]
fn edf_of_flicker_noise_is_that_of_the_exact_table() {
    let table: [Row; 3] = [
        (10, 147.75, [0.758, 0.974, 0.999, 1.001, 1.000]),
        (12, 35.59, [0.771, 0.985, 1.004, 1.004, 1.002]),
        (14, 7.59, [0.832, 1.035, 1.032, 1.018, 1.009]),
    ];
    // The tolerance allows for correlations beyond four averaging times, which are left out.
    assert_table(VarianceFractions::FLICKER, &table, 0.004);
}

#[test]
fn edf_of_random_walk_noise_is_that_of_the_exact_table() {
    let table: [Row; 6] = [
        (10, 117.14, [0.965, 1.002, 1.002, 1.001, 1.000]),
        (11, 57.80, [0.971, 1.006, 1.004, 1.002, 1.001]),
        (12, 28.13, [0.983, 1.014, 1.008, 1.004, 1.002]),
        (13, 13.30, [1.010, 1.030, 1.017, 1.008, 1.004]),
        (14, 5.90, [1.072, 1.069, 1.037, 1.019, 1.010]),
        (15, 2.24, [1.238, 1.175, 1.094, 1.048, 1.024]),
    ];
    assert_table(VarianceFractions::RANDOM_WALK, &table, 0.0);
}

#[test]
fn edf_is_exact_at_short_averaging_times() {
    // edf·n/N of an infinite record, exact for sampled noise, full overlap at n = 1, 2, 4, 8.
    let many = 1 << 40;
    let per_sample = |n, shares| edf(n, many, n as u32, shares) * n as f64 / many as f64;
    assert!((per_sample(1, VarianceFractions::WHITE) - 2.0 / 3.0).abs() < 1e-6);
    assert!((per_sample(2, VarianceFractions::WHITE) - 8.0 / 7.0).abs() < 1e-6);
    assert!((per_sample(8, VarianceFractions::WHITE) - 1.4713).abs() < 5e-5);
    assert!((per_sample(1, VarianceFractions::QUANTIZATION) - 18.0 / 35.0).abs() < 1e-6);
    for (n, kappa) in [(1, 1.0), (2, 1.0286), (4, 0.957), (8, 0.9348)] {
        let found = per_sample(n, VarianceFractions::RANDOM_WALK);
        assert!((found - kappa).abs() < 6e-4, "n = {n}: {found}");
    }
}
