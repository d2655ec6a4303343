//! Lost samples in a few short records.

use crate::tables;
use benchmarks::losses::{EstimatedCoefficient, EstimatedRecord, LossPattern, LossPlan, TestNoise};

/// Mean, and standard deviation.
fn moments(values: &[f64]) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    [mean, (square / (count - 1.0)).sqrt()]
}

/// Mean of the values and of their differences from others, with the standard error of that.
struct Change {
    mean: f64,
    change: f64,
    standard_error: f64,
}

fn change(complete: &[f64], lossy: &[f64]) -> Change {
    let [change, deviation] = moments(&lossy.iter().zip(complete).map(|(lossy, of)| lossy - of).collect::<Vec<f64>>());
    Change { mean: moments(complete)[0], change, standard_error: deviation / (complete.len() as f64).sqrt() }
}

#[test]
fn lost_samples_bias_neither_variance_nor_coefficients_and_keep_the_longest_averaging_time() {
    const RECORDS: u64 = 24;
    let table = LossPlan { records: RECORDS, samples_log2: 17, first_seed: 5_000, jobs: 2 }.run(|_, _| ());
    assert_eq!(table.noises.len(), TestNoise::all().len());
    for noise in &table.noises {
        assert_eq!((noise.complete.len(), noise.lossy.len()), (RECORDS as usize, LossPattern::ALL.len()));
        let complete = &noise.complete;
        for (loss, lossy) in &noise.lossy {
            let name = format!("{}, {loss}", noise.noise);
            for (record, of) in lossy.iter().zip(complete) {
                assert_eq!(record.octaves.len(), of.octaves.len(), "{name}");
            }
            for (at, octave) in complete[0].octaves.iter().enumerate() {
                let variances =
                    |of: &[EstimatedRecord]| -> Vec<f64> { of.iter().map(|of| of.octaves[at].avar).collect() };
                let Change { mean, change, standard_error } = change(&variances(complete), &variances(lossy));
                // The limit is 4.5 standard errors, exceeded by 2 of 10,000 octaves, and 0.3 % for the correction at
                // 5 % loss.
                let allowed = 4.5 * standard_error + 0.003 * mean;
                assert!(change.abs() <= allowed, "{name}, n = {}: {change:+.4e} of {allowed:.4e}", octave.n);
            }
            for (at, coefficient) in complete[0].coefficients.iter().enumerate() {
                let values =
                    |of: &[EstimatedRecord]| -> Vec<f64> { of.iter().map(|of| of.coefficients[at].value).collect() };
                let Change { change, standard_error, .. } = change(&values(complete), &values(lossy));
                let allowed = 4.5 * standard_error + 0.1 * moments(&values(complete))[1];
                assert!(change.abs() <= allowed, "{name}, {}: {change:+.5}", coefficient.symbol);
                let holds = |of: &EstimatedCoefficient| (of.low..=of.high).contains(&1.0);
                let covered = |of: &[EstimatedRecord]| of.iter().filter(|of| holds(&of.coefficients[at])).count();
                assert!(covered(lossy) + 3 >= covered(complete), "{name}, {}", coefficient.symbol);
            }
        }
    }
}

#[test]
fn without_the_correction_the_benchmark_would_see_the_bias() {
    let table = LossPlan { records: 8, samples_log2: 16, first_seed: 9_000, jobs: 2 }.run(|_, _| ());
    let white = &table.noises[0];
    let (loss, lossy) = &white.lossy[3];
    assert_eq!(*loss, LossPattern::Random(0.05).to_string());
    let text = tables::of("losses", &serde_json::to_value(&table).expect("JSON"));
    // Both tables list each noise with each loss, except for coefficients that a noise does not have.
    assert!(text.matches(loss.as_str()).count() >= 2 * TestNoise::all().len(), "{text}");
    let variances = |of: &[EstimatedRecord], added: f64| -> Vec<f64> {
        of.iter().map(|of| &of.octaves[6]).map(|of| of.avar + added * of.interpolation).collect()
    };
    assert_eq!(lossy[0].octaves[6].n, 64);
    let Change { mean, change, standard_error } = change(&variances(&white.complete, 0.0), &variances(lossy, 1.0));
    // The expected bias is 1.5 · 5 % · (1 − 2/64).
    assert!((change / mean - 0.0727).abs() < 4.5 * standard_error / mean + 0.003, "{}", change / mean);
    assert!(change > 4.5 * standard_error, "{change} ± {standard_error}");
}
