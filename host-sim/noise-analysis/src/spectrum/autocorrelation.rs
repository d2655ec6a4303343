//! The correlation time of a Markov process by the autocorrelation, beside the Allan variance and independent of it.

use crate::grid::Grid;
use allan_core::{Kind, Model};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Averages to a correlation time, and how many of them the correlation is followed for: three correlation times.
const PER_TIME: f64 = 3.0;
const LAGS: usize = 9;
/// Stretches whose estimates tell the error, and their shortest length in correlation times.
const STRETCHES: usize = 16;
const SHORTEST: f64 = 10.0;
/// The time is sought for within this factor of the one that is expected.
const REACH: f64 = 4.0;

/// A correlation time in s with 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrelationTime {
    /// Estimate.
    pub value: f64,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
}

/// That of the Markov process of `model`, from samples on a grid.
///
/// Averages over a third of the expected time correlate as `A·exp(−k·w/T)` at a distance of `k ≥ 1` of them, exactly; white
/// noise has no part in that, what the other terms of the model have is taken off, and what the mean takes away is a
/// constant. `A`, the constant and `T` are fitted by least squares; the bounds are those of the jackknife over stretches
/// of the record (R. Miller, "The jackknife – a review", Biometrika 61, 1974). `None` without a Markov process in the
/// model, or in a record of fewer than 160 correlation times.
#[must_use]
pub fn correlation_time(grid: &Grid, model: &Model) -> Option<CorrelationTime> {
    let expected = model.terms().iter().find_map(|term| match term.kind {
        Kind::Markov(markov) if term.value > 0.0 => Some(markov.time_constant),
        _ => None,
    })?;
    let width = (expected / PER_TIME / grid.sample_period()).round().max(1.0) as usize;
    let spacing = width as f64 * grid.sample_period();
    if grid.duration() < STRETCHES as f64 * SHORTEST * expected {
        return None;
    }
    let averages = averages(grid.values(), width);
    let others = others(model, width);
    let stretches: Vec<[Products; LAGS]> = averages.chunks_exact(averages.len() / STRETCHES).map(products).collect();
    let without = |left_out: Option<usize>| {
        let kept = || stretches.iter().enumerate().filter(|(at, _)| Some(*at) != left_out).map(|(_, sums)| sums);
        let correlation = std::array::from_fn(|lag| {
            let (sum, count) = kept().fold((0.0, 0.0), |(sum, count), of| (sum + of[lag].sum, count + of[lag].count));
            sum / count - others[lag]
        });
        fitted(&correlation, spacing, expected)
    };
    let all = without(None)?.ln();
    let count = stretches.len() as f64;
    let partial: Vec<f64> = (0..stretches.len()).map(|at| without(Some(at)).map(f64::ln)).collect::<Option<_>>()?;
    let mean = partial.iter().sum::<f64>() / count;
    let variance = (count - 1.0) / count * partial.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    let half_width = StudentsT::new(0.0, 1.0, count - 1.0).ok()?.inverse_cdf(0.975) * variance.sqrt();
    Some(CorrelationTime { value: all.exp(), low: (all - half_width).exp(), high: (all + half_width).exp() })
}

/// Averages over `width` values each; `NaN` where half of them and more are missing.
fn averages(values: &[f64], width: usize) -> Vec<f64> {
    let average = |chunk: &[f64]| {
        let (sum, count) = present(chunk).fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
        if 2 * count > width { sum / f64::from(count as u32) } else { f64::NAN }
    };
    values.chunks_exact(width).map(average).collect()
}

/// Sum of products at one distance.
#[derive(Debug, Clone, Copy, Default)]
struct Products {
    sum: f64,
    count: f64,
}

/// Of the deviations from the mean of a stretch.
fn products(stretch: &[f64]) -> [Products; LAGS] {
    let mean = present(stretch).sum::<f64>() / present(stretch).count() as f64;
    std::array::from_fn(|lag| {
        let pairs = stretch.iter().zip(stretch.iter().skip(lag + 1)).map(|(a, b)| (a - mean) * (b - mean));
        let add = |of: Products, product| Products { sum: of.sum + product, count: of.count + 1.0 };
        pairs.filter(|product| product.is_finite()).fold(Products::default(), add)
    })
}

fn present(values: &[f64]) -> impl Iterator<Item = f64> + '_ {
    values.iter().copied().filter(|value| value.is_finite())
}

/// Covariance of averages that all terms but the Markov process make, up to a constant.
fn others(model: &Model, width: usize) -> [f64; LAGS] {
    let width = width as f64;
    std::array::from_fn(|lag| {
        let distance = (lag + 1) as f64;
        let of = |term: &allan_core::model::Term| {
            let v = |m: f64| term.kind.process().structure(m * width, model.sample_period());
            let second = v(distance + 1.0) - 2.0 * v(distance) + v(distance - 1.0);
            term.value * term.value * second / (2.0 * width * width)
        };
        let present = model.terms().iter().filter(|term| term.value > 0.0 && !matches!(term.kind, Kind::Markov(_)));
        present.map(of).sum()
    })
}

/// The time at which `A·exp(−k·spacing/T) + C` with `A > 0` is closest to the correlation; `None` at an end of the search.
fn fitted(correlation: &[f64; LAGS], spacing: f64, expected: f64) -> Option<f64> {
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
    use allan_core::model::Term;
    use allan_core::term::Markov;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const PERIOD: f64 = 0.05;
    const TIME: f64 = 2.0;
    const SAMPLES: usize = 1 << 16;
    const RECORDS: u64 = 100;

    fn model(walk: f64) -> Model {
        let markov = Kind::Markov(Markov { time_constant: 1.3 * TIME });
        let terms = [(Kind::AngleRandomWalk, 0.3), (markov, 1.0), (Kind::RateRandomWalk, walk)];
        Model::new(PERIOD, terms.map(|(kind, value)| Term::exact(kind, value)))
    }

    /// A Markov process of deviation 1 in white noise and a random walk; the expected time is 30 % off.
    fn times(walk: f64) -> Vec<CorrelationTime> {
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
            correlation_time(&Grid::new(PERIOD, values), &model(walk)).expect("1,638 correlation times")
        };
        (0..RECORDS).map(record).collect()
    }

    fn assert_times(times: &[CorrelationTime]) {
        let errors: Vec<f64> = times.iter().map(|time| (time.value / TIME).ln()).collect();
        let mean = errors.iter().sum::<f64>() / RECORDS as f64;
        let scatter = (errors.iter().map(|error| (error - mean).powi(2)).sum::<f64>() / RECORDS as f64).sqrt();
        let covered = times.iter().filter(|time| (time.low..=time.high).contains(&TIME)).count();
        println!("mean {mean}, scatter {scatter}, covered {covered}");
        // The logarithm of an estimate is low by half its variance or so: as much, and four standard errors.
        assert!(mean.abs() < scatter * scatter + 4.0 * scatter / (RECORDS as f64).sqrt(), "{mean} ± {scatter}");
        // 95 % ± four standard deviations of a binomial share.
        assert!(covered as f64 >= RECORDS as f64 * 0.95 - 4.0 * (RECORDS as f64 * 0.95 * 0.05).sqrt(), "{covered}");
        assert!(scatter < 0.2, "{scatter}");
    }

    #[test]
    fn the_time_of_a_simulated_process_is_found() {
        assert_times(&times(0.0));
    }

    #[test]
    fn a_random_walk_beside_it_does_no_harm() {
        assert_times(&times(0.05));
    }

    #[test]
    fn nothing_is_said_without_a_process_or_in_a_short_record() {
        let grid = |samples| Grid::new(PERIOD, vec![0.0; samples]);
        assert_eq!(correlation_time(&grid(1_000), &model(0.0)), None);
        let white = Model::new(PERIOD, [Term::exact(Kind::AngleRandomWalk, 1.0)]);
        assert_eq!(correlation_time(&grid(SAMPLES), &white), None);
        // A channel that never changes has no correlation to follow.
        assert_eq!(correlation_time(&grid(SAMPLES), &model(0.0)), None);
    }
}
