//! The published characterisation repeated with fewer hours: what the two methods err by, and what is claimed of it.

use benchmarks::paper::Experiment;

const SEEDS: u64 = 16;

#[test]
fn the_read_off_errs_by_the_other_terms_and_the_fit_does_not() {
    let outcome = Experiment { seeds: SEEDS, first_seed: 1000 }.run(|_| ());
    let root = (SEEDS as f64).sqrt();
    for term in 0..3 {
        // A mean of 16 within four of its standard deviations, which are themselves good to a fifth. Of N, 0.1 % more: the
        // flicker noise of a few samples, a thousandth of the variance there, is filtered too, which no term knows.
        for (errors, expected) in [
            (&outcome.plain, outcome.inherent[term]),
            (&outcome.overlapped, outcome.inherent[term]),
            (&outcome.fitted, 0.0),
        ] {
            let error = errors[term];
            assert!((error.bias - expected).abs() < 1e-3 + 4.0 * error.scatter / root, "term {term}: {outcome:#?}");
        }
        // Of 16 intervals of 95 %, 11 and fewer hold the truth once in a thousand.
        assert!(outcome.covered[term] * SEEDS as f64 > 11.0, "term {term}: {outcome:#?}");
    }
    // From the truth alone: at 40 s and 80 s, in the paper's flat part, N²/τ, 0.441·B² and K²τ/3 add up to
    // 9.46e-5 and 1.00e-4 (deg/s)², which is 1.60 times 0.664·B; at 160 s to 1.37e-4, 1.23 times K·√(τ/3).
    let [n, b, k] = outcome.inherent;
    assert!((b - 0.60).abs() < 0.01 && (k - 0.23).abs() < 0.01, "{b} {k}");
    // N is 1.6 % high by B and K at 1 s, and low by the filter, which takes 0.7·2L/τ/204.8 of the variance, L = 4.
    assert!((-0.02..0.0).contains(&n), "{n}");

    for octave in outcome.scatter.iter().filter(|octave| octave.tau_s < 400.0) {
        // χ² with 15 degrees of freedom is outside of 2.4 … 44.3 once in five thousand.
        let square = 15.0 * (octave.overlapped / octave.confidence).powi(2);
        assert!((2.4..44.3).contains(&square), "{octave:?}");
        // The formula is one for no overlap and white noise; good enough from 32 samples on.
        let square = 15.0 * (octave.plain / octave.formula).powi(2);
        assert!(octave.tau_s < 0.15 || (2.4..44.3).contains(&square), "{octave:?}");
    }
    let mut text = Vec::new();
    outcome.write(&mut text).expect("a vector can be written");
    let text = String::from_utf8(text).expect("text");
    assert!(text.contains("16 simulated hours") && text.lines().all(|line| line.chars().count() <= 110), "{text}");
}
