//! Against noise that is known: coverage of the intervals, degrees of freedom of every overlap, noise types.

mod noise;
mod study;

use allan_core::Noise;
use study::{FLICKER, MIXTURE, OCTAVES, OVERLAPS, RECORDS, Study, WALK, WHITE};

fn assert_coverage(study: &Study) {
    let judged: Vec<usize> = (0..OCTAVES).filter(|&octave| study.dof[octave] >= 3.0).collect();
    assert!(judged.len() >= 10, "all but the last octave, at least");
    for octave in judged {
        let share = |covered: u32| f64::from(covered) / RECORDS as f64;
        let (known, identified) = (share(study.covered[octave]), share(study.covered_as_identified[octave]));
        println!("n = 2^{octave}: edf {:.1}, coverage {known}, {identified}", study.dof[octave]);
        assert!((0.94..=0.96).contains(&known), "n = 2^{octave}, edf {}: {known}", study.dof[octave]);
        // The curve has to guess the noise from the very same record.
        assert!(identified >= 0.93, "n = 2^{octave}, edf {}: {identified}", study.dof[octave]);
    }
}

#[test]
fn intervals_cover_white_noise() {
    assert_coverage(&WHITE);
}

#[test]
fn intervals_cover_flicker_noise() {
    assert_coverage(&FLICKER);
}

#[test]
fn intervals_cover_a_random_walk() {
    assert_coverage(&WALK);
}

#[test]
fn intervals_cover_a_mixture() {
    assert_coverage(&MIXTURE);
}

#[test]
fn a_pure_noise_is_named() {
    for (study, noise) in [(&*WHITE, Noise::White), (&*FLICKER, Noise::Flicker), (&*WALK, Noise::RandomWalk)] {
        for (octave, named) in study.named.iter().enumerate() {
            let right = f64::from(named[noise as usize]) / RECORDS as f64;
            println!("n = 2^{octave}: {noise:?} in {right}");
            assert!(right >= 0.95, "n = 2^{octave}: {noise:?} in {right}");
        }
    }
}

/// What partial overlap costs, as degrees of freedom over those of full overlap; for 2¹⁷ samples and `n` = 2¹⁰ to 2¹⁴,
/// which is the same as 2¹² samples and `n` = 2⁵ to 2⁹. Computed independently from Greenhall's sums.
fn assert_loss(study: &Study, table: &[[f64; OVERLAPS]; 5]) {
    for (octave, row) in (5..).zip(table) {
        let found = study.equivalent_dof(octave);
        for (overlap, ratio) in row.iter().enumerate() {
            let (found, expected) = (found[overlap] / found[OVERLAPS - 1], ratio / row[OVERLAPS - 1]);
            // Three standard deviations of 4,000 runs, by their bootstrap: 0.02 for P = 1 and 2, 0.01 beyond.
            let tolerance = if overlap < 2 { 0.06 } else { 0.03 };
            assert!((found - expected).abs() < tolerance, "n = 2^{octave}, P = {}: {found}, {expected}", 1 << overlap);
        }
    }
}

#[test]
fn degrees_of_freedom_that_partial_overlap_costs() {
    assert_loss(
        &WHITE,
        &[
            [0.447, 0.764, 0.929, 0.982, 0.996],
            [0.450, 0.767, 0.931, 0.983, 0.996],
            [0.457, 0.773, 0.934, 0.985, 0.997],
            [0.470, 0.784, 0.942, 0.989, 0.999],
            [0.499, 0.810, 0.959, 0.998, 1.004],
        ],
    );
    assert_loss(
        &FLICKER,
        &[
            [0.758, 0.974, 0.999, 1.001, 1.000],
            [0.762, 0.978, 1.001, 1.002, 1.001],
            [0.771, 0.985, 1.004, 1.004, 1.002],
            [0.790, 1.000, 1.013, 1.008, 1.004],
            [0.832, 1.035, 1.032, 1.018, 1.009],
        ],
    );
    assert_loss(
        &WALK,
        &[
            [0.965, 1.002, 1.002, 1.001, 1.000],
            [0.971, 1.006, 1.004, 1.002, 1.001],
            [0.983, 1.014, 1.008, 1.004, 1.002],
            [1.010, 1.030, 1.017, 1.008, 1.004],
            [1.072, 1.069, 1.037, 1.019, 1.010],
        ],
    );
}
