//! How long to record for bounds of ±20 %, by all samples and by the octaves of a curve: the README's table.

use allan_core::fit::fit;
use allan_core::model::FittedTerm;
use allan_core::{Curve, Model, NoiseTerm};
use noise_analysis::report::assessment::record_length::{REQUIRED_HALF_WIDTH, relative_error};

/// N in °/√s, B in °/s and K in °/s/√s of the published gyro, and its sample period (docs/paper.md).
const COEFFICIENTS: [f64; 3] = [0.0368, 0.0093, 0.0013];
const PERIOD_S: f64 = 1.0 / 204.8;
/// 95 % of a normal distribution lie within so many standard deviations.
const NORMAL_975: f64 = 1.96;

fn truth() -> Model {
    let terms = NoiseTerm::BASELINE.into_iter().zip(COEFFICIENTS);
    Model::new(PERIOD_S, terms.map(|(kind, value)| FittedTerm::exact(kind, value)))
}

/// Half the width of the 95 % bounds over the coefficient, if the curve of `duration_s` is that of the true model: with the overlap of the
/// device and of the analysis.
fn by_octaves(term: usize, duration_s: f64) -> f64 {
    let truth = truth();
    let samples = (duration_s / PERIOD_S) as u64;
    let octaves = (0..24).map(|octave| 1 << octave).take_while(|n| 2 * n <= samples);
    let table: Vec<(u64, f64)> = octaves.map(|n| (n, truth.avar(n))).collect();
    let curve = Curve::<24>::from_points(PERIOD_S, samples, 8, &table).expect("a curve");
    let fitted = fit(&curve, &NoiseTerm::BASELINE);
    let term = fitted.terms()[term];
    (term.high - term.low) / 2.0 / term.value
}

/// The same by the likelihood of all samples.
fn by_samples(term: usize, duration_s: f64) -> f64 {
    NORMAL_975 * relative_error(&truth(), term, duration_s).expect("a density")
}

/// The shortest record whose bounds are within ±20 %, in hours, to 1 %.
fn hours(half_width: impl Fn(f64) -> f64) -> f64 {
    let mut duration_s = 0.6;
    while half_width(duration_s) > REQUIRED_HALF_WIDTH {
        duration_s *= 1.01;
    }
    duration_s / 3600.0
}

#[test]
fn the_lengths_for_both_are_in_the_docs() {
    for (term, name) in ["N", "B", "K"].into_iter().enumerate() {
        let text = |hours: f64| if hours < 0.01 { format!("{:.0} s", 3600.0 * hours) } else { format!("{hours:.1} h") };
        let lengths = [hours(|s| by_samples(term, s)), hours(|s| by_octaves(term, s))].map(text);
        system_tests::generated("README.md", &format!("record-length-{name}"), &lengths.join(" | "));
    }
}

/// `docs/analysis.md` and the device's report say by how much.
#[test]
fn bounds_by_octaves_are_wider_by_2_to_9_percent() {
    let ratio = |term: usize, duration_s: f64| by_octaves(term, duration_s) / by_samples(term, duration_s);
    let of_hours = |hours: f64| [0, 1, 2].map(|term| ratio(term, 3600.0 * hours));
    let ratios: Vec<f64> = [1.0, 4.0, 24.0].into_iter().flat_map(of_hours).collect();
    assert!(ratios.iter().all(|ratio| (1.015..1.095).contains(ratio)), "{ratios:.3?}");
    assert!(ratios.iter().any(|ratio| *ratio < 1.025) && ratios.iter().any(|ratio| *ratio > 1.085), "{ratios:.3?}");
}
