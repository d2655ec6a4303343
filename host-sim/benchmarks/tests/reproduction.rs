//! Slope method and fit over simulated hours, compared with theory.

use crate::tables;
use benchmarks::reproduction::{Hour, Reproduction, TRUTH};

const SEEDS: u64 = 16;

/// Mean of a figure over the hours, and its standard deviation.
fn moments(hours: &[Hour], of: impl Fn(&Hour) -> f64) -> [f64; 2] {
    let count = hours.len() as f64;
    let mean = hours.iter().map(&of).sum::<f64>() / count;
    let square = hours.iter().map(|hour| (of(hour) - mean).powi(2)).sum::<f64>();
    [mean, (square / (count - 1.0)).sqrt()]
}

#[test]
fn the_slope_method_is_biased_by_the_other_terms_and_the_fit_is_not() {
    let result = Reproduction { seeds: SEEDS, first_seed: 1000 }.run(|_| ());
    let root = (SEEDS as f64).sqrt();
    for (term, truth) in TRUTH.into_iter().enumerate() {
        let by_method = |hour: &Hour| [hour.slopes[0], hour.slopes[1], hour.fitted];
        for (method, expected) in [result.inherent[term], result.inherent[term], 0.0].into_iter().enumerate() {
            let [mean, scatter] = moments(&result.hours, |hour| by_method(hour)[method][term] / truth);
            let bias = mean - 1.0;
            // The tolerance is four deviations, which are known to a fifth, and 0.1 % for flicker noise in the filter.
            assert!((bias - expected).abs() < 1e-3 + 4.0 * scatter / root, "term {term}: {bias} ± {scatter}");
        }
        // 11 or fewer of 16 intervals cover once in 1000 cases.
        assert!(result.hours.iter().filter(|hour| hour.covered[term]).count() > 11, "term {term}");
    }
    // N²/τ, 0.441·B² and K²τ/3 sum to 1.60 times 0.664·B at 40 s and 80 s, and to 1.23 times K·√(τ/3) at 160 s.
    let [n, b, k] = result.inherent;
    assert!((b - 0.60).abs() < 0.01 && (k - 0.23).abs() < 0.01, "{b} {k}");
    // B and K increase the result for N by 1.6 % at 1 s. The filter of L = 4 taps removes 0.7·2L/τ/204.8 of the
    // variance.
    assert!((-0.02..0.0).contains(&n), "{n}");

    for (at, octave) in result.octaves.iter().enumerate().filter(|(_, octave)| octave.tau_s < 400.0) {
        let [plain, overlapped] = [0, 1].map(|method: usize| {
            let [mean, scatter] = moments(&result.hours, |hour| hour.deviations[method][at]);
            scatter / mean
        });
        // χ² with 15 degrees of freedom is outside of 2.4 … 44.3 with a probability of 1/5000.
        let square = 15.0 * (overlapped / octave.confidence).powi(2);
        assert!((2.4..44.3).contains(&square), "{octave:?}");
        // Equation (6) holds without overlap and for white noise, so it is compared from 32 samples on.
        let square = 15.0 * (plain / octave.formula).powi(2);
        assert!(octave.tau_s < 0.15 || (2.4..44.3).contains(&square), "{octave:?}");
    }
    let text = tables::of("paper", &serde_json::to_value(&result).expect("JSON"));
    assert!(
        text.contains("16 simulated hours") && text.contains("Four methods") && text.contains("95 % if true"),
        "{text}"
    );
}
