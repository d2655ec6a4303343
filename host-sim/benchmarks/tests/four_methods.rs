//! The four methods on one record.

use benchmarks::reproduction::{FourMethods, RATE_HZ, SpectrumOctave, TRUTH, allan_weight};
use std::f64::consts::{LN_2, PI};

/// Upper limit of the variance below 2.5/T, which the spectrum lacks: sin⁴(πfτ)/(πfτ)² < (πfτ)², for N, B and K.
fn low_frequencies(octave: &SpectrumOctave, segment_s: f64) -> f64 {
    let [n, b, k] = TRUTH;
    let (tau, f) = (octave.tau_s, 2.5 / segment_s);
    let white = 4.0 * n * n * PI * PI * tau * tau * f.powi(3) / 3.0;
    let flicker = PI * b * b * tau * tau * f * f;
    let walk = k * k * tau * tau * f;
    (white + flicker + walk) / (n * n / tau + 2.0 * LN_2 / PI * b * b + k * k * tau / 3.0)
}

/// The sum is exact, since the integrand is a trigonometric polynomial.
#[test]
fn equation_5_of_a_white_density_is_n_squared_over_tau() {
    let (square, spacing) = (0.25, RATE_HZ / 4096.0);
    for n in [1, 2, 8, 64] {
        // The integral ends at the last centre of a bin.
        let sum: f64 = (1..2048).map(|at| allan_weight(f64::from(at) * spacing, n)).sum();
        let avar = 2.0 * square * spacing * (sum + 0.5 * allan_weight(0.5 * RATE_HZ, n));
        assert!((avar * n as f64 / RATE_HZ / square - 1.0).abs() < 1e-9, "{n}: {avar}");
    }
}

#[test]
fn equation_5_of_the_measured_spectrum_is_the_measured_allan_deviation() {
    let record = FourMethods::analyze(1);
    let resolved: Vec<_> = record.spectrum.iter().filter(|octave| octave.resolved).collect();
    assert_eq!(resolved.len(), 14, "1 sample to 40 s");
    for octave in resolved {
        // The tolerance is four deviations of the difference of independent data; a root has half of the square's
        // relative error.
        let scatter = octave.measured_error.hypot(octave.by_spectrum_error);
        // The limit is for noise before the filter, so it is used beyond 16 samples.
        let low = if octave.tau_s * RATE_HZ > 16.0 { 0.5 * low_frequencies(octave, record.segment_s) } else { 0.0 };
        let ratio = octave.by_spectrum / octave.measured;
        assert!((ratio - 1.0).abs() < 4.0 * scatter + low, "4·{scatter} + {low}: {octave:?}");
    }
}

#[test]
fn each_method_gives_n_and_only_the_full_model_has_white_innovations() {
    let record = FourMethods::analyze(1);
    for row in &record.coefficients[1..] {
        let (value, (low, high)) = (row.values[0].expect("N"), row.bounds[0].expect("bounds of N"));
        // The tolerance is twice the bounds, and 0.2 % for flicker noise in the filter.
        assert!((value - TRUTH[0]).abs() < (high - low) + 2e-3 * TRUTH[0], "{row:?}");
    }
    let [full, only_n] = &record.innovations[..] else { panic!("{record:?}") };
    let (full, only_n) = (&full.innovations, &only_n.innovations);
    // p < 0.001 occurs once in a thousand cases. Innovations are larger without B and K.
    assert!(full.whiteness_p > 1e-3 && only_n.whiteness_p < 1e-6, "{full:?} {only_n:?}");
    assert!(only_n.normalised > only_n.high && only_n.normalised > full.normalised, "{full:?} {only_n:?}");
}
