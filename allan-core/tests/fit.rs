//! The fit and the slope method on simulated noise with known coefficients.

use allan_core::{Cascade, Curve, CurveView, Model, NoiseTerm, fit::fit, model::Discrepancy, slope_method};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Seconds between samples.
const PERIOD: f64 = 0.01;
/// Counts are a thousandth of the unit, so that rounding adds 10⁻⁶/12 to a white variance of 10⁻² and more.
const LSB: f64 = 1e-3;

/// White noise `n` in unit·√s and a random walk `k` in unit/√s, as counts.
fn record(samples: usize, n: f64, k: f64, seed: u64) -> Cascade<20, 8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut rng) };
    let (mut cascade, mut walk) = (Cascade::new(), 0.0);
    for _ in 0..samples {
        walk += k * PERIOD.sqrt() * normal();
        let value = walk + n / PERIOD.sqrt() * normal();
        cascade.push((value / LSB).round() as i32);
    }
    cascade
}

fn curve(cascade: &Cascade<20, 8>) -> Curve<20> {
    cascade.curve(PERIOD).scaled(LSB)
}

fn value(model: &Model, kind: NoiseTerm) -> allan_core::model::FittedTerm {
    *model.terms().iter().find(|term| term.kind == kind).expect("a fitted term")
}

/// 95 % ± four standard deviations of a binomial proportion of 300 trials: 0.95 ± 4·√(0.95·0.05/300).
const COVERAGE: core::ops::RangeInclusive<f64> = 0.8997..=1.0;
const RECORDS: u64 = 300;

#[test]
fn bounds_of_strong_coefficients_cover_the_truth() {
    let (n, k) = (0.05, 0.02);
    let (mut n_covered, mut k_covered, mut n_ratio) = (0, 0, 0.0);
    for seed in 0..RECORDS {
        let model = fit(&curve(&record(1 << 15, n, k, seed)), &[NoiseTerm::AngleRandomWalk, NoiseTerm::RateRandomWalk]);
        let (fitted_n, fitted_k) =
            (value(&model, NoiseTerm::AngleRandomWalk), value(&model, NoiseTerm::RateRandomWalk));
        n_covered += u64::from((fitted_n.low..=fitted_n.high).contains(&n));
        k_covered += u64::from((fitted_k.low..=fitted_k.high).contains(&k));
        n_ratio += fitted_n.value / n / RECORDS as f64;
    }
    let share = |covered: u64| covered as f64 / RECORDS as f64;
    assert!(COVERAGE.contains(&share(n_covered)), "N covered in {}", share(n_covered));
    assert!(COVERAGE.contains(&share(k_covered)), "K covered in {}", share(k_covered));
    // The best possible standard deviation of N is 1/√(2·2¹⁵); 300 records, four deviations, twice that for K's part.
    assert!((n_ratio - 1.0).abs() < 8.0 / (2.0 * 32_768.0 * RECORDS as f64).sqrt(), "bias of N: {n_ratio}");
}

#[test]
fn an_absent_term_has_a_lower_bound_of_0_and_a_positive_upper_bound() {
    let absent = |seed: u64| {
        let model = fit(&curve(&record(1 << 14, 0.05, 0.0, 1_000 + seed)), &NoiseTerm::BASELINE);
        let (b, k) = (value(&model, NoiseTerm::BiasInstability), value(&model, NoiseTerm::RateRandomWalk));
        assert!(b.high > 0.0 && k.high > 0.0);
        b.low == 0.0 && k.low == 0.0
    };
    let clean = (0..100).filter(|&seed| absent(seed)).count();
    assert!(clean >= 88, "a lower bound above 0 in {} of 100 records", 100 - clean);
}

#[test]
fn a_correct_model_has_a_deviance_per_point_of_about_1() {
    // The deviance of 16 correlated points less two parameters: below 2 with a wide margin on average of 50 records.
    let score = |seed: u64| {
        let curve = curve(&record(1 << 15, 0.05, 0.02, 2_000 + seed));
        let model = fit(&curve, &[NoiseTerm::AngleRandomWalk, NoiseTerm::RateRandomWalk]);
        Discrepancy::between(&model, &curve).expect("octaves to compare").deviance_per_point
    };
    let mean = (0..50).map(score).sum::<f64>() / 50.0;
    assert!((0.4..1.3).contains(&mean), "{mean}");
}

#[test]
fn the_worst_deviation_is_normal_for_a_true_model_and_sees_a_long_octave_that_is_far_off() {
    let worst = |seed: u64| {
        let record = record(1 << 13, 0.05, 0.0, 4_000 + seed);
        let curve = curve(&record);
        let model = fit(&curve, &[NoiseTerm::AngleRandomWalk]);
        let true_one = Discrepancy::between(&model, &curve).expect("octaves to compare").worst_sigma;
        // The last octave, beyond the eighth of the record at which the mean deviance ends, measures 36 times as much.
        let last = *curve.points().last().expect("a point");
        let mut points = curve.points().to_vec();
        points.iter_mut().filter(|point| point.n == last.n).for_each(|point| point.avar *= 36.0);
        let wrong = CurveView::new(curve.sample_period(), curve.samples(), &points);
        let wrong = Discrepancy::between(&model, wrong).expect("octaves to compare").worst_sigma;
        (true_one.abs(), wrong)
    };
    let worst: Vec<(f64, f64)> = (0..200).map(worst).collect();
    // The largest of 13 correlated standard normal values: below 3.5 in 99.4 % even if they were independent.
    let beyond = worst.iter().filter(|(sigma, _)| *sigma > 3.5).count();
    assert!(beyond <= 6, "{beyond} of 200 true models deviate by more than 3.5 standard deviations");
    let median = {
        let mut all: Vec<f64> = worst.iter().map(|(sigma, _)| *sigma).collect();
        all.sort_by(f64::total_cmp);
        all[100]
    };
    assert!((1.0..2.2).contains(&median), "{median}");
    // The last octave has one degree of freedom: its cube root exceeds three deviations where χ² is above 0.29, in 59 %.
    assert!(worst.iter().filter(|(_, sigma)| *sigma > 3.0).count() >= 100);
}

#[test]
fn the_slope_method_finds_the_coefficient_of_a_single_noise() {
    let white = curve(&record(1 << 17, 0.05, 0.0, 7));
    let n = slope_method::angle_random_walk(&white).expect("a −½ slope");
    assert!((n.value / 0.05 - 1.0).abs() < 0.05, "{}", n.value);
    assert_eq!(*n.interval.start(), PERIOD);
    assert_eq!(slope_method::rate_random_walk(&white), None);

    // Points at n = 1 … 4096 of 2¹⁷ samples: the worst, 4096, has 9 % (1σ) by the formula; the mean of the run less.
    let walk = curve(&record(1 << 17, 0.0, 0.5, 8));
    let k = slope_method::rate_random_walk(&walk).expect("a +½ slope");
    assert!((k.value / 0.5 - 1.0).abs() < 0.2, "{}", k.value);
    assert_eq!(slope_method::angle_random_walk(&walk), None);
}

#[test]
fn percentage_accuracy_is_that_of_ieee_952() {
    // 100/√(2(N/n−1)) for an hour at 204.8 SPS: n = 1 and τ = 230 s.
    assert!((slope_method::percentage_accuracy(737_280, 1) - 0.0824).abs() < 5e-5);
    assert!((slope_method::percentage_accuracy(737_280, 47_104) - 18.47).abs() < 5e-3);
}

#[test]
fn coefficients_of_a_constant_channel_are_0() {
    let mut cascade = Cascade::<20, 8>::new();
    cascade.push_slice(&[5; 1_000]);
    let model = fit(&cascade.curve(PERIOD), &NoiseTerm::BASELINE);
    assert!(model.terms().iter().all(|term| term.value == 0.0));
}
