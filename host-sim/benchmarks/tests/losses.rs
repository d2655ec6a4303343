//! Lost samples in a few short records.

use crate::tables;
use benchmarks::losses::{LossPattern, LossPlan, TestNoise};

#[test]
fn lost_samples_bias_neither_variance_nor_coefficients_and_keep_the_longest_averaging_time() {
    const RECORDS: u64 = 24;
    let table = LossPlan { records: RECORDS, samples_log2: 17, first_seed: 5_000, jobs: 2 }.run(|_, _| ());
    assert_eq!(table.comparisons.len(), TestNoise::ALL.len() * LossPattern::ALL.len());
    for comparison in &table.comparisons {
        let name = format!("{}, {}", comparison.noise, comparison.loss);
        assert_eq!(comparison.same_longest, RECORDS as usize, "{name}");
        for octave in &comparison.octaves {
            // The limit is 4.5 standard errors, exceeded by 2 of 10,000 octaves, and 0.3 % for the correction at 5 %
            // loss.
            let allowed = 4.5 * octave.standard_error + 0.003;
            assert!(octave.bias.abs() <= allowed, "{name}, n = {}: {:+.4} of {allowed:.4}", octave.n, octave.bias);
        }
        for coefficient in &comparison.coefficients {
            let allowed = 4.5 * coefficient.standard_error + 0.1 * coefficient.scatter;
            assert!(coefficient.shift.abs() <= allowed, "{name}, {}: {:+.5}", coefficient.symbol, coefficient.shift);
            assert!(coefficient.covered + 3 >= coefficient.complete_covered, "{name}, {}", coefficient.symbol);
        }
    }
}

#[test]
fn without_the_correction_the_benchmark_would_see_the_bias() {
    let table = LossPlan { records: 8, samples_log2: 16, first_seed: 9_000, jobs: 2 }.run(|_, _| ());
    let white =
        table.comparisons.iter().find(|comparison| comparison.loss == LossPattern::Random(0.05)).expect("white, 5 %");
    let text = tables::of("losses", &serde_json::to_value(&table).expect("JSON"));
    // Both tables list each noise with each loss, except for coefficients that a noise does not have.
    assert!(text.matches(&white.loss.to_string()).count() >= 2 * TestNoise::ALL.len(), "{text}");
    let octave = white.octaves.iter().find(|octave| octave.n == 64).expect("n = 64");
    // The expected bias is 1.5 · 5 % · (1 − 2/64).
    assert!((octave.uncorrected - 0.0727).abs() < 4.5 * octave.standard_error + 0.003, "{octave:?}");
    assert!(octave.uncorrected > 4.5 * octave.standard_error, "{octave:?}");
}
