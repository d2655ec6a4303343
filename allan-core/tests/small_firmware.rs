//! The cheap ways to a model on a small processor against the full ones.

use allan_core::fit::{MAX_POINTS, fit, fit_power_laws};
use allan_core::{AllanPoint, Cascade, Curve, CurveView, FractionalOctaves, NoiseTerm, TableError};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const PERIOD: f64 = 0.01;
const POWER_LAWS: [NoiseTerm; 5] = [
    NoiseTerm::Quantization,
    NoiseTerm::AngleRandomWalk,
    NoiseTerm::BiasInstability,
    NoiseTerm::RateRandomWalk,
    NoiseTerm::RateRamp,
];

/// White noise of 30 counts rms on a random walk of 0.2 counts a sample, with gaps.
fn record(seed: u64, samples: u32) -> (Cascade<20, 8>, FractionalOctaves<20, 8>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let (mut cascade, mut fractional) = (Cascade::new(), FractionalOctaves::new());
    let mut walk = 0.0;
    for k in 0..samples {
        walk += 0.2 * normal();
        if k % 1_000 == 999 {
            cascade.gap(2);
        }
        cascade.push((walk + 30.0 * normal()).round() as i32);
        fractional.observe(&cascade);
    }
    (cascade, fractional)
}

#[test]
fn a_snapshot_has_the_curves_of_the_estimator_at_that_time() {
    let (mut cascade, _) = record(1, 20_000);
    let snapshot = cascade.snapshot();
    let (curve, plain) = (cascade.curve(PERIOD), cascade.curve_without_confidence(PERIOD));
    cascade.push(1_000_000);
    assert_ne!(cascade.curve(PERIOD), curve);
    assert_eq!(snapshot.curve(PERIOD), curve);
    assert_eq!(snapshot.curve_without_confidence(PERIOD), plain);
    assert_eq!((snapshot.len(), snapshot.missing()), (20_000, 40));
    assert!(Cascade::<20, 8>::new().snapshot().is_empty());
}

#[test]
fn the_curve_without_confidence_has_the_same_variances_in_single_precision() {
    let (cascade, _) = record(2, 100_000);
    let (full, plain) = (cascade.curve(PERIOD), cascade.curve_without_confidence(PERIOD));
    assert_eq!(full.points().len(), plain.points().len());
    for (full, plain) in full.points().iter().zip(plain.points()) {
        assert_eq!((full.n, full.tau, full.count, full.overlap), (plain.n, plain.tau, plain.count, plain.overlap));
        // Some ten roundings of 2⁻²⁴.
        for (full, plain) in [(full.avar, plain.avar), (full.replaced, plain.replaced)] {
            assert!((plain - full).abs() <= 1e-6 * full, "{plain} and {full}");
        }
        assert!((plain.interpolation - full.interpolation).abs() <= 1e-6 * full.avar);
        assert!(plain.edf <= full.edf.max(1.0), "n = {}: {} of {}", full.n, plain.edf, full.edf);
        assert_eq!((plain.low, plain.high), (0.0, f64::INFINITY));
    }
}

#[test]
fn a_fit_of_power_laws_has_the_coefficients_and_bounds_of_a_fit() {
    for (seed, kinds) in [(3, &POWER_LAWS[1..4]), (4, &POWER_LAWS), (5, &POWER_LAWS[1..2])] {
        let (cascade, _) = record(seed, 200_000);
        let full = fit(&cascade.curve(PERIOD), kinds);
        for curve in [cascade.curve(PERIOD), cascade.curve_without_confidence(PERIOD)] {
            let power_laws = fit_power_laws(&curve, kinds);
            assert_eq!(power_laws.terms().len(), kinds.len());
            for (full, plain) in full.terms().iter().zip(power_laws.terms()) {
                // The iterations end within a thirtieth of the uncertainty, the quantiles within 0.03 standard deviations of
                // four between the bounds.
                let width = full.high - full.low;
                let name = full.kind.name();
                assert!((plain.value - full.value).abs() <= 0.02 * width, "{name}: {} and {}", plain.value, full.value);
                assert!((plain.low - full.low).abs() <= 0.05 * width, "{name}: low {} and {}", plain.low, full.low);
                assert!(
                    (plain.high - full.high).abs() <= 0.05 * width,
                    "{name}: high {} and {}",
                    plain.high,
                    full.high
                );
            }
        }
    }
}

#[test]
fn a_fit_of_power_laws_leaves_out_other_terms() {
    use allan_core::term::Markov;
    let (cascade, _) = record(6, 20_000);
    let curve = cascade.curve(PERIOD);
    let markov = NoiseTerm::Markov(Markov { time_constant: 1.0 });
    let model = fit_power_laws(&curve, &[markov, NoiseTerm::AngleRandomWalk]);
    assert_eq!(model, fit_power_laws(&curve, &[NoiseTerm::AngleRandomWalk]));
    assert_eq!(model.get(NoiseTerm::AngleRandomWalk), Some(&model.terms()[0]));
    assert_eq!(model.get(markov), None);
}

#[test]
fn a_fit_of_borrowed_points_is_that_of_their_curve_and_of_a_fine_curve_that_of_its_octaves() {
    let (cascade, fractional) = record(7, 50_000);
    let curve = cascade.curve(PERIOD);
    let view = CurveView::new(PERIOD, cascade.len(), curve.points());
    assert_eq!(fit(view, &NoiseTerm::BASELINE), fit(&curve, &NoiseTerm::BASELINE));
    let fine: Curve<80> = fractional.curve(&cascade, PERIOD);
    assert!(fine.points().len() > MAX_POINTS);
    // The octaves have the noise types of their neighbours, from which the first degrees of freedom come.
    let octaves: Vec<AllanPoint> = fine.points().iter().copied().filter(|point| point.n.is_power_of_two()).collect();
    let of_octaves = fit(CurveView::new(PERIOD, cascade.len(), &octaves), &NoiseTerm::BASELINE);
    assert_eq!(fit(&fine, &NoiseTerm::BASELINE), of_octaves);
}

#[test]
fn a_table_from_elsewhere_has_the_confidence_of_the_estimators_curve() {
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let mut cascade = Cascade::<16, 8>::new();
    for _ in 0..100_000 {
        let value: f64 = StandardNormal.sample(&mut random);
        cascade.push((100.0 * value).round() as i32);
    }
    let curve = cascade.curve(PERIOD);
    let table: Vec<(u64, f64)> = curve.points().iter().map(|point| (point.n, point.avar)).collect();
    let rebuilt = Curve::<16>::from_points(PERIOD, 100_000, 8, &table).unwrap();
    for (own, rebuilt) in curve.points().iter().zip(rebuilt.points()) {
        assert_eq!(
            (own.n, own.tau, own.avar, own.power_law),
            (rebuilt.n, rebuilt.tau, rebuilt.avar, rebuilt.power_law)
        );
        // The estimator takes its differences at multiples of their stride from the start: up to one fewer.
        assert!(own.count.abs_diff(rebuilt.count) <= 1, "n = {}: {} and {}", own.n, own.count, rebuilt.count);
        assert!((own.edf / rebuilt.edf - 1.0).abs() <= 1.5 / own.count as f64, "n = {}", own.n);
    }
    let refused = |overlap, table: &[(u64, f64)]| Curve::<3>::from_points(PERIOD, 100, overlap, table).unwrap_err();
    assert_eq!(refused(17, &[]), TableError::Overlap);
    assert_eq!(refused(8, &[(1, 1.0); 4]), TableError::TooManyRows);
    assert_eq!(refused(8, &[(1, 1.0), (1, 1.0)]), TableError::AveragingFactor(1));
    assert_eq!(refused(8, &[(1, 1.0), (51, 1.0)]), TableError::AveragingFactor(1));
    assert_eq!(refused(8, &[(1, f64::NAN)]), TableError::Variance(0));
    assert_eq!(refused(8, &[(1, -1.0)]), TableError::Variance(0));
    assert_eq!(Curve::<3>::from_points(0.0, 100, 8, &[]), Err(TableError::SamplePeriod));
}
