//! The four methods of the paper on one simulated record: equation (5) on the measured spectrum, N by each method, and the
//! innovations of the fitted model.

use benchmarks::reproduction::{FourMethods, RATE_HZ, SpectrumOctave, TRUTH, allan_weight};
use std::f64::consts::{LN_2, PI};

/// Upper limit of the part of the Allan variance that the spectrum does not show. The removed mean and the
/// window change the points at 0, 1 and 2 cycles per segment of length T, so f is below 2.5/T. There sin⁴(πfτ)/(πfτ)² is
/// below (πfτ)², and the integrals of 2·S(f)·(πfτ)² with S = 2N², B²/(πf) and K²/(2π²f²) are the three terms.
fn low_frequencies(octave: &SpectrumOctave, segment_s: f64) -> f64 {
    let [n, b, k] = TRUTH;
    let (tau, f) = (octave.tau_s, 2.5 / segment_s);
    let white = 4.0 * n * n * PI * PI * tau * tau * f.powi(3) / 3.0;
    let flicker = PI * b * b * tau * tau * f * f;
    let walk = k * k * tau * tau * f;
    (white + flicker + walk) / (n * n / tau + 2.0 * LN_2 / PI * b * b + k * k * tau / 3.0)
}

/// The sum is exact: the weight is a trigonometric polynomial with fewer harmonics than points.
#[test]
fn equation_5_of_a_white_density_is_n_squared_over_tau() {
    let (square, spacing) = (0.25, RATE_HZ / 4096.0);
    for n in [1, 2, 8, 64] {
        // The last of 2048 intervals is centred at half the sample rate, where the integral ends.
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
        // Both are estimates from the same data, so their difference scatters less than that of independent ones: four of
        // its standard deviations. A deviation errs by half of what its square does.
        let scatter = octave.measured_error.hypot(octave.by_spectrum_error);
        // The variance in `low_frequencies` is that before the filter, which is the variance behind it beyond 16 samples; for
        // fewer samples the low frequencies are negligible.
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
        // Twice the 95 % bounds, and 0.2 % for the flicker noise within the length of the filter, which no method models.
        assert!((value - TRUTH[0]).abs() < (high - low) + 2e-3 * TRUTH[0], "{row:?}");
    }
    let [full, only_n] = &record.innovations[..] else { panic!("{record:?}") };
    // A true model has p < 0.001 in one of a thousand records. Without B and K the innovations are larger than expected.
    assert!(full.whiteness_p > 1e-3 && only_n.whiteness_p < 1e-6, "{full:?} {only_n:?}");
    assert!(only_n.normalised > only_n.consistent.1 && only_n.normalised > full.normalised, "{full:?} {only_n:?}");
    let mut text = Vec::new();
    record.write(&mut text).expect("a vector can be written");
    let text = String::from_utf8(text).expect("UTF-8");
    assert!(text.lines().all(|line| line.chars().count() <= 110), "{text}");
}
