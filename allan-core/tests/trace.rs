//! The trace on simulated noise of known composition: no term is added to complete models, and missing terms are added with
//! the correct name and size.

use crate::simulation::{Noise, curve, impulse_response, telegraph_signal};
use allan_core::fit::fit_shapes;
use allan_core::model::FittedTerm;
use allan_core::term::{Markov, MovingAverageFilter, NoiseTerm, Resonance, Shape, Sinusoid};
use allan_core::trace::{LineCandidates, Trace, trace};
use allan_core::{Model, telegraph};

const SAMPLES: usize = 1 << 17;
/// Starting shapes of a sensor with Bartlett windows of 2 to 64 taps, or with one of 8 taps that is read at a lower rate.
const FILTERS: [MovingAverageFilter; 10] = {
    const fn decimated(decimation: f64) -> MovingAverageFilter {
        MovingAverageFilter { stages: 2, taps: 8, decimation }
    }
    [
        MovingAverageFilter::bartlett(2),
        MovingAverageFilter::bartlett(4),
        MovingAverageFilter::bartlett(8),
        MovingAverageFilter::bartlett(16),
        MovingAverageFilter::bartlett(32),
        MovingAverageFilter::bartlett(64),
        decimated(6.1),
        decimated(8.1),
        decimated(10.1),
        decimated(12.1),
    ]
};
/// White noise of 0.05 unit·√s and a random walk of 0.004 unit/√s, which meet at about 20 s.
const BASELINE: [(NoiseTerm, f64); 2] = [(NoiseTerm::AngleRandomWalk, 0.05), (NoiseTerm::RateRandomWalk, 0.004)];

fn traced(hidden: &[(NoiseTerm, f64)], seed: u64) -> Trace {
    let mut noise = Noise::new(seed);
    let sum = noise.sum(SAMPLES, BASELINE.iter().chain(hidden));
    trace(&curve(&sum), LineCandidates::Curve, &FILTERS)
}

fn added(trace: &Trace) -> Vec<FittedTerm> {
    trace.added.iter().map(|found| trace.after.terms()[found.term]).collect()
}

#[test]
fn no_term_is_added_to_a_complete_model() {
    // A false alarm in 2 % of the records at most: of 60, three or fewer with a probability of 0.97.
    let alarms = (0..60).filter(|&seed| !traced(&[], seed).added.is_empty()).count();
    assert!(alarms <= 3, "{alarms} of 60");
}

#[test]
fn the_p_value_of_a_correct_model_is_uniformly_distributed() {
    const RECORDS: usize = 100;
    let mut p_values: Vec<f64> =
        (0..RECORDS as u64).map(|seed| traced(&[], 1_000 + seed).before_goodness.p_value).collect();
    p_values.sort_by(f64::total_cmp);
    let expected = |rank: usize| (rank as f64 + 0.5) / RECORDS as f64;
    let distance = p_values.iter().enumerate().map(|(rank, p)| (p - expected(rank)).abs()).fold(0.0, f64::max);
    // Kolmogorov and Smirnov: 1.63/√n is exceeded once in a hundred; 0.05 for a χ² in the place of the exact law.
    assert!(distance < 1.63 / (RECORDS as f64).sqrt() + 0.05, "{distance}");
}

/// A term that the baseline lacks, its coefficient, and the tolerances of the coefficient and of the shape parameters as
/// fractions.
fn hidden() -> Vec<(NoiseTerm, f64, f64, f64)> {
    vec![
        (NoiseTerm::Quantization, 1e-3, 0.1, 0.0),
        (NoiseTerm::RateRamp, 2e-3, 0.1, 0.0),
        (NoiseTerm::Markov(Markov { time_constant: 1.3 }), 0.06, 0.1, 0.3),
        (NoiseTerm::Sinusoid(Sinusoid { frequency: 3.1 }), 0.1, 0.1, 0.06),
        (NoiseTerm::Resonance(Resonance { frequency: 7.0, bandwidth: 1.5 }), 0.2, 0.1, 0.5),
    ]
}

#[test]
fn each_missing_term_is_added_with_its_name_and_size() {
    for (kind, value, amount, share) in hidden() {
        let trace = traced(&[(kind, value)], 7);
        let added = added(&trace);
        let [term] = added[..] else { panic!("{kind:?}: {added:?}") };
        assert_eq!(term.kind.name(), kind.name());
        assert!((term.value / value - 1.0).abs() < amount, "{kind:?}: {term:?}");
        for ((name, truth), (_, found)) in kind.shape().named().zip(term.kind.shape().named()) {
            assert!((found / truth - 1.0).abs() < share, "{name} of {kind:?}: {found}");
        }
        assert!(trace.before_goodness.p_value < 1e-3, "{kind:?}: {:?}", trace.before_goodness);
        assert!(trace.after_goodness.p_value > 1e-3, "{kind:?}: {:?}", trace.after_goodness);
        assert!(trace.after_goodness.deviance < trace.before_goodness.deviance);
    }
}

#[test]
fn a_filter_is_found_with_its_number_of_taps() {
    for taps in [2, 4, 16, 64] {
        let mut noise = Noise::new(u64::from(taps));
        let terms =
            [(NoiseTerm::Filtered(MovingAverageFilter::bartlett(taps)), 0.05), (NoiseTerm::RateRandomWalk, 0.004)];
        let trace = trace(&curve(&noise.sum(SAMPLES, &terms)), LineCandidates::Curve, &FILTERS);
        let added = added(&trace);
        let [term] = added[..] else { panic!("{taps}: {added:?}") };
        assert_eq!(term.kind, NoiseTerm::Filtered(MovingAverageFilter::bartlett(taps)));
        assert!((term.value / 0.05 - 1.0).abs() < 0.03, "{term:?}");
    }
}

#[test]
fn the_decimation_of_a_filter_is_estimated() {
    let decimation = 9.0;
    let mut noise = Noise::new(5);
    let terms = [
        (NoiseTerm::Filtered(MovingAverageFilter { stages: 2, taps: 8, decimation }), 0.05),
        (NoiseTerm::RateRandomWalk, 0.004),
    ];
    let trace = trace(&curve(&noise.sum(SAMPLES, &terms)), LineCandidates::Curve, &FILTERS);
    let added = added(&trace);
    let [term] = added[..] else { panic!("{added:?}") };
    let Shape::Filtered { decimation: (low, high), .. } = term.shape else { panic!("{term:?}") };
    assert!(low < decimation && decimation < high && high - low < 1.0, "{term:?}");
}

/// A filter that is read more often than it has values is none of a sensor, and no kept model may have one.
#[test]
fn the_decimation_of_a_filter_is_at_least_one() {
    for seed in 1..=6 {
        let recorded = (NoiseTerm::Filtered(MovingAverageFilter::bartlett(8)), 0.05);
        let curve = curve(&Noise::new(seed).sum(SAMPLES, &[recorded]));
        let start = MovingAverageFilter { decimation: 1.1, ..MovingAverageFilter::bartlett(8) };
        let model = fit_shapes(&curve, &[NoiseTerm::Filtered(start)]);
        let filter = model.filter().expect("the term that was fitted");
        assert!((1.0..1.05).contains(&filter.decimation), "{filter:?}");
    }
}

#[test]
fn two_missing_terms_are_both_added() {
    let pair = [
        (NoiseTerm::Sinusoid(Sinusoid { frequency: 3.1 }), 0.1),
        (NoiseTerm::Markov(Markov { time_constant: 4.0 }), 0.06),
    ];
    let mut names: Vec<&str> = added(&traced(&pair, 3)).iter().map(|term| term.kind.name()).collect();
    names.sort_unstable();
    assert_eq!(names, ["markov", "sinusoid"]);
}

#[test]
fn a_model_with_more_terms_does_not_fit_worse() {
    for seed in 0..5 {
        let mut noise = Noise::new(40 + seed);
        let curve = curve(&noise.sum(1 << 14, &BASELINE));
        let all = [
            NoiseTerm::Quantization,
            NoiseTerm::AngleRandomWalk,
            NoiseTerm::BiasInstability,
            NoiseTerm::RateRandomWalk,
            NoiseTerm::RateRamp,
        ];
        // At the same weights; those of the largest model are given to all.
        let largest = allan_core::fit::fit(&curve, &all);
        let deviance = |kinds: &[NoiseTerm]| {
            let model = allan_core::fit::fit(&curve, kinds);
            let of = |point: &allan_core::AllanPoint| {
                let ratio = point.avar / model.avar(point.n);
                largest.edf(point) * (ratio - 1.0 - ratio.ln())
            };
            curve.points().iter().map(of).sum::<f64>()
        };
        let of: Vec<f64> = (1..=all.len()).map(|terms| deviance(&all[..terms])).collect();
        // The weights of the smaller model are its own, so its fit is a little off the minimum at these.
        assert!(of.windows(2).all(|pair| pair[1] < pair[0] * 1.02 + 0.05), "{of:?}");
    }
}

#[test]
fn a_telegraph_signal_is_distinguished_from_a_gaussian_process() {
    let shape = Markov { time_constant: 1.3 };
    for seed in 0..10 {
        let mut noise = Noise::new(500 + seed);
        let rest = noise.sum(SAMPLES, &BASELINE);
        let gaussian = noise.series(&NoiseTerm::Markov(shape), SAMPLES);
        // Levels 0.4 apart have a standard deviation of 0.2.
        let levels = telegraph_signal(&mut noise, SAMPLES, shape.time_constant, 0.4);
        let ratio = |signal: &dyn Fn(usize) -> f64| {
            let sum: Vec<f64> = rest.iter().enumerate().map(|(k, rest)| rest + signal(k)).collect();
            let curve = curve(&sum);
            let trace = trace(&curve, LineCandidates::Curve, &FILTERS);
            let found = added(&trace).into_iter().find_map(|term| match term.kind {
                NoiseTerm::Markov(markov) => Some(markov),
                _ => None,
            });
            let markov = found.unwrap_or_else(|| panic!("no correlated term in {:?}", trace.added));
            telegraph::kurtosis_ratio(&curve, &trace.after, markov).expect("fourth moments")
        };
        let (smooth, two) = (ratio(&|k| 0.2 * gaussian[k]), ratio(&|k| levels[k]));
        assert!(two.is_telegraph() && !smooth.is_telegraph(), "{two:?}, {smooth:?}");
    }
}

/// A process and two levels with a correlation time of 25 samples, each with white noise behind a filter, which is known, of up to 16 of
/// them.
#[test]
fn a_process_before_a_filter_is_found_with_its_size_its_time_constant_and_its_kurtosis() {
    let (shape, deviation, white) = (Markov { time_constant: 0.25 }, 2.0, 0.05);
    for (seed, (stages, taps)) in (0..).zip([(2, 4), (2, 8), (2, 16)]) {
        let filter = MovingAverageFilter { stages, taps, decimation: 1.0 };
        let response = impulse_response(&filter);
        let mut noise = Noise::new(700 + seed);
        let samples = SAMPLES + response.len();
        let rest = noise.series(&NoiseTerm::AngleRandomWalk, samples);
        let gaussian = noise.series(&NoiseTerm::Markov(shape), samples);
        let levels = telegraph_signal(&mut noise, samples, shape.time_constant, 2.0 * deviation);
        let ratio = |signal: &dyn Fn(usize) -> f64| {
            let sum: Vec<f64> = rest.iter().enumerate().map(|(k, rest)| white * rest + signal(k)).collect();
            let filtered = sum.windows(response.len()).map(|of| of.iter().zip(&response).map(|(a, b)| a * b).sum());
            let curve = curve(&filtered.collect::<Vec<f64>>());
            let trace = trace(&curve, LineCandidates::Curve, &[filter]);
            assert_eq!(trace.after.filter(), Some(filter), "{:?}", trace.after);
            let process = trace.after.terms().iter().find_map(|term| match term.kind {
                NoiseTerm::Markov(markov) => Some((*term, markov)),
                _ => None,
            });
            let (term, markov) = process.unwrap_or_else(|| panic!("no correlated term in {:?}", trace.after));
            // The record has 5,000 correlation times: four deviations of a variance, and of a time constant, are 4·√(2/5,000).
            assert!((term.value / deviation - 1.0).abs() < 0.04, "{filter:?}: {term:?}");
            assert!((markov.time_constant / shape.time_constant - 1.0).abs() < 0.08, "{filter:?}: {term:?}");
            telegraph::kurtosis_ratio(&curve, &trace.after, markov).expect("fourth moments")
        };
        let (smooth, two) = (ratio(&|k| deviation * gaussian[k]), ratio(&|k| levels[k]));
        assert!(!smooth.is_telegraph() && two.is_telegraph(), "{filter:?}: {smooth:?} {two:?}");
        // The table has two digits, and two lengths in one root are good to a sixth in the simulations of filters of these lengths.
        assert!((two.ratio - 1.0).abs() < 0.2 + 3.0 * two.error, "{filter:?}: {two:?}");
    }
}

#[test]
fn a_baseline_has_the_baseline_terms_and_no_others() {
    let mut noise = Noise::new(1);
    let curve = curve(&noise.sum(1 << 14, &[(NoiseTerm::AngleRandomWalk, 0.05), (NoiseTerm::RateRamp, 0.1)]));
    let trace = Trace::baseline(&curve);
    assert!(trace.added.is_empty() && trace.before == trace.after);
    let names = |model: &Model| model.terms().iter().map(|term| term.kind).collect::<Vec<_>>();
    assert_eq!(names(&trace.after), NoiseTerm::BASELINE);
}
