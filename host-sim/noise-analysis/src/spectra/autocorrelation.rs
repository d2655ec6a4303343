//! The correlation time of a Markov process by the autocorrelation, independent of the Allan variance.

use crate::bounds::BoundedEstimate;
use crate::samples::uniform_series::UniformSeries;
use allan_core::{Model, NoiseTerm};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Averages per correlation time.
const PER_TIME: f64 = 3.0;
/// Largest distance, averages: three correlation times.
const LAGS: usize = 9;
/// Segments of the jackknife, and their least length in correlation times.
const SEGMENTS: usize = 16;
const SHORTEST: f64 = 10.0;
/// Factor on the expected time within which it is sought.
const REACH: f64 = 4.0;

/// The correlation time of the Markov process of `model` in s, with 95 % bounds.
///
/// `A·exp(−k·w/T)` and a constant are fitted to the covariances of averages over w = T/3, without that of the other
/// terms. The bounds are by a jackknife over segments (R. Miller, Biometrika 61, 1974). `None` without a Markov process
/// in the model, or for a record of fewer than 160 correlation times.
#[must_use]
pub fn correlation_time(series: &UniformSeries, model: &Model) -> Option<BoundedEstimate> {
    let expected = model.terms().iter().find_map(|term| match term.kind {
        NoiseTerm::Markov(markov) if term.value > 0.0 => Some(markov.time_constant),
        _ => None,
    })?;
    let width = (expected / PER_TIME / series.sample_period()).round().max(1.0) as usize;
    let spacing = width as f64 * series.sample_period();
    if series.duration() < SEGMENTS as f64 * SHORTEST * expected {
        return None;
    }
    let averages = averages(series.values(), width);
    let others = covariance_of_others(model, width);
    let segments: Vec<[Products; LAGS]> = averages.chunks_exact(averages.len() / SEGMENTS).map(products).collect();
    let without = |left_out: Option<usize>| {
        let kept = || segments.iter().enumerate().filter(|(at, _)| Some(*at) != left_out).map(|(_, sums)| sums);
        let correlation = std::array::from_fn(|lag| {
            let (sum, count) =
                kept().fold((0.0, 0.0), |(sum, count), sums| (sum + sums[lag].sum, count + sums[lag].count));
            sum / count - others[lag]
        });
        fit_exponential(&correlation, spacing, expected)
    };
    let all = without(None)?.ln();
    let count = segments.len() as f64;
    let partial: Vec<f64> = (0..segments.len()).map(|at| without(Some(at)).map(f64::ln)).collect::<Option<_>>()?;
    let mean = partial.iter().sum::<f64>() / count;
    let variance = (count - 1.0) / count * partial.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    let half_width = StudentsT::new(0.0, 1.0, count - 1.0).ok()?.inverse_cdf(0.975) * variance.sqrt();
    Some(BoundedEstimate { value: all.exp(), low: (all - half_width).exp(), high: (all + half_width).exp() })
}

/// Averages over `width` values; `NaN` if at least half are missing.
fn averages(values: &[f64], width: usize) -> Vec<f64> {
    let average = |chunk: &[f64]| {
        let (sum, count) = present(chunk).fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
        if 2 * count > width { sum / f64::from(count as u32) } else { f64::NAN }
    };
    values.chunks_exact(width).map(average).collect()
}

#[derive(Debug, Clone, Copy, Default)]
struct Products {
    sum: f64,
    count: f64,
}

/// Products at the distances 1 to [`LAGS`], without the segment's mean.
fn products(segment: &[f64]) -> [Products; LAGS] {
    let mean = present(segment).sum::<f64>() / present(segment).count() as f64;
    std::array::from_fn(|lag| {
        let pairs = segment.iter().zip(segment.iter().skip(lag + 1)).map(|(a, b)| (a - mean) * (b - mean));
        let add = |sums: Products, product| Products { sum: sums.sum + product, count: sums.count + 1.0 };
        pairs.filter(|product| product.is_finite()).fold(Products::default(), add)
    })
}

fn present(values: &[f64]) -> impl Iterator<Item = f64> + '_ {
    values.iter().copied().filter(|value| value.is_finite())
}

/// Covariance of averages by all terms but the Markov process, up to a constant.
fn covariance_of_others(model: &Model, width: usize) -> [f64; LAGS] {
    let width = width as f64;
    std::array::from_fn(|lag| {
        let distance = (lag + 1) as f64;
        let covariance = |term: &allan_core::model::FittedTerm| {
            let v = |m: f64| term.kind.process().sum_variance(m * width, model.sample_period());
            let second = v(distance + 1.0) - 2.0 * v(distance) + v(distance - 1.0);
            term.value * term.value * second / (2.0 * width * width)
        };
        let present =
            model.terms().iter().filter(|term| term.value > 0.0 && !matches!(term.kind, NoiseTerm::Markov(_)));
        present.map(covariance).sum()
    })
}

/// `T` of the best fit of `A·exp(−k·spacing/T) + C`, `A > 0`; `None` at an end of the search.
fn fit_exponential(correlation: &[f64; LAGS], spacing: f64, expected: f64) -> Option<f64> {
    const STEPS: i32 = 400;
    let mean = correlation.iter().sum::<f64>() / LAGS as f64;
    let explained = |step: i32| {
        let time = expected * REACH.powf(f64::from(step) / f64::from(STEPS));
        let shape: [f64; LAGS] = std::array::from_fn(|lag| (-(lag as f64 + 1.0) * spacing / time).exp());
        let middle = shape.iter().sum::<f64>() / LAGS as f64;
        let products = shape.iter().zip(correlation).map(|(s, c)| (s - middle) * (c - mean)).sum::<f64>();
        let squares = shape.iter().map(|s| (s - middle).powi(2)).sum::<f64>();
        (time, products.max(0.0).powi(2) / squares)
    };
    let best = (-STEPS..=STEPS).max_by(|&a, &b| explained(a).1.total_cmp(&explained(b).1))?;
    (best.abs() < STEPS).then(|| explained(best).0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use allan_core::model::FittedTerm;
    use allan_core::term::Markov;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const PERIOD: f64 = 0.05;
    const TIME: f64 = 2.0;
    const SAMPLES: usize = 1 << 16;
    const RECORDS: u64 = 100;

    fn model(walk: f64) -> Model {
        let markov = NoiseTerm::Markov(Markov { time_constant: 1.3 * TIME });
        let terms = [(NoiseTerm::AngleRandomWalk, 0.3), (markov, 1.0), (NoiseTerm::RateRandomWalk, walk)];
        Model::new(PERIOD, terms.map(|(kind, value)| FittedTerm::exact(kind, value)))
    }

    /// The expected time is 30 % off.
    fn times(walk: f64) -> Vec<BoundedEstimate> {
        let record = |seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let kept = (-PERIOD / TIME).exp();
            let (mut state, mut level) = (normal(), 0.0);
            let mut sample = || {
                state = kept * state + (1.0 - kept * kept).sqrt() * normal();
                level += walk * PERIOD.sqrt() * normal();
                state + level + 0.3 / PERIOD.sqrt() * normal()
            };
            let values = (0..SAMPLES).map(|_| sample()).collect();
            correlation_time(&UniformSeries::new(PERIOD, values), &model(walk)).expect("1,638 correlation times")
        };
        (0..RECORDS).map(record).collect()
    }

    fn assert_times(times: &[BoundedEstimate]) {
        let errors: Vec<f64> = times.iter().map(|time| (time.value / TIME).ln()).collect();
        let mean = errors.iter().sum::<f64>() / RECORDS as f64;
        let scatter = (errors.iter().map(|error| (error - mean).powi(2)).sum::<f64>() / RECORDS as f64).sqrt();
        let covered = times.iter().filter(|time| (time.low..=time.high).contains(&TIME)).count();
        println!("mean {mean}, scatter {scatter}, covered {covered}");
        // A logarithm is biased by half its variance: twice that, and four standard errors.
        assert!(mean.abs() < scatter * scatter + 4.0 * scatter / (RECORDS as f64).sqrt(), "{mean} ± {scatter}");
        // 95 % ± four standard deviations of a binomial share.
        assert!(covered as f64 >= RECORDS as f64 * 0.95 - 4.0 * (RECORDS as f64 * 0.95 * 0.05).sqrt(), "{covered}");
        assert!(scatter < 0.2, "{scatter}");
    }

    #[test]
    fn measures_the_time_of_a_simulated_process() {
        assert_times(&times(0.0));
    }

    #[test]
    fn a_random_walk_beside_it_does_not_bias_the_time() {
        assert_times(&times(0.05));
    }

    #[test]
    fn has_no_estimate_without_a_process_or_for_a_short_record() {
        let series = |samples| UniformSeries::new(PERIOD, vec![0.0; samples]);
        assert_eq!(correlation_time(&series(1_000), &model(0.0)), None);
        let white = Model::new(PERIOD, [FittedTerm::exact(NoiseTerm::AngleRandomWalk, 1.0)]);
        assert_eq!(correlation_time(&series(SAMPLES), &white), None);
        assert_eq!(correlation_time(&series(SAMPLES), &model(0.0)), None);
    }
}
