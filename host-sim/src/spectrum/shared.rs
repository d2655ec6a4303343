//! A Markov process that two channels share, from their spectra and what these have in common.
//!
//! The cross-spectrum of two channels is that of the shared process alone, whatever noise each has of its own. The
//! likelihood is Wishart's for the two-by-two spectral matrix, band by band.

use super::mixture;
use super::shape::Band;
use super::tapered::{Tapered, ranges};
use crate::grid::Grid;
use crate::trace::normal::NORMAL_975;
use std::f64::consts::PI;

/// White, flicker and random-walk noise, and the process.
const TERMS: usize = 4;
/// Time constants that are tried: the shortest in samples, the longest as part of the record, the factor between.
const SHORTEST: f64 = 16.0;
const LONGEST: f64 = 0.5;
const FACTOR: f64 = 1.25;
/// Rounds of golden sections for the variance.
const ROUNDS: usize = 40;
/// Highest frequency, as part of the sample rate.
const HIGHEST: f64 = 0.02;

/// What two channels share: likeliest values with 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shared {
    /// Standard deviation, the geometric mean of the two channels' units.
    pub deviation: Bounded,
    /// s.
    pub time_constant: Bounded,
}

/// A positive value with its 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounded {
    /// Likeliest.
    pub value: f64,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
}

impl Bounded {
    /// By mean and standard deviation of the logarithm.
    fn of((mean, deviation): (f64, f64)) -> Self {
        let half = NORMAL_975 * deviation;
        Self { value: mean.exp(), low: (mean - half).exp(), high: (mean + half).exp() }
    }
}

/// One band of both channels.
struct Pair {
    frequency: f64,
    densities: [f64; 2],
    common: f64,
    ordinates: f64,
}

/// The Markov process that makes what `a` and `b` have in common likeliest; `None` if their samples differ, or if none does.
#[must_use]
pub fn markov(a: &Grid, b: &Grid) -> Option<Shared> {
    let [first, second] = [a, b].map(|grid| Tapered::of(&grid.detrended()));
    let (first, second) = (first?, second?);
    let pairs = pairs(&first, &second)?;
    let times: Vec<f64> = time_constants(a).collect();
    let judged: Vec<(f64, f64)> = times.iter().map(|&time| best_variance(&pairs, a.sample_period(), time)).collect();
    let least = judged.iter().map(|(_, objective)| *objective).fold(f64::INFINITY, f64::min);
    // Every time constant as likely as the data make it: a record of few of them leaves time and variance in doubt
    // together.
    let weights: Vec<f64> = judged.iter().map(|(_, objective)| (least - objective).exp()).collect();
    let weighted = |values: &[f64]| {
        let total: f64 = weights.iter().sum();
        let mean = |of: &dyn Fn(f64) -> f64| {
            weights.iter().zip(values).map(|(weight, value)| weight * of(*value)).sum::<f64>() / total
        };
        let middle = mean(&|value| value);
        (middle, mean(&|value| (value - middle).powi(2)).sqrt())
    };
    let logarithms: Vec<f64> = times.iter().map(|time| time.ln()).collect();
    let (time, of_time) = weighted(&logarithms);
    let deviations: Vec<f64> =
        judged.iter().map(|(variance, _)| 0.5 * variance.abs().max(f64::MIN_POSITIVE).ln()).collect();
    let (deviation, of_deviation) = weighted(&deviations);
    let alone = 0.5 * error_at(&pairs, a.sample_period(), time.exp(), (2.0 * deviation).exp());
    Some(Shared {
        deviation: Bounded::of((deviation, of_deviation.hypot(alone))),
        // Within a step of the grid any is as likely.
        time_constant: Bounded::of((time, of_time.hypot(FACTOR.ln() / 12f64.sqrt()))),
    })
}

fn pairs(a: &Tapered, b: &Tapered) -> Option<Vec<Pair>> {
    if a.length != b.length {
        return None;
    }
    let highest = HIGHEST / a.sample_period;
    let mean = |range: &std::ops::Range<usize>, of: &dyn Fn(usize) -> f64| {
        range.clone().map(of).sum::<f64>() / range.len() as f64
    };
    let pair = |range: std::ops::Range<usize>| Pair {
        frequency: a.resolution() * (range.start + range.end - 1) as f64 / 2.0,
        densities: [mean(&range, &|at| a.common(a, at)), mean(&range, &|at| b.common(b, at))],
        common: mean(&range, &|at| a.common(b, at)),
        ordinates: range.len() as f64,
    };
    let pairs: Vec<Pair> = ranges((highest / a.resolution()) as usize).map(pair).collect();
    let told = |pair: &Pair| pair.densities.iter().all(|density| *density > 0.0);
    (pairs.len() > 8 && pairs.iter().all(told)).then_some(pairs)
}

/// The likeliest shared variance for a time constant, and the objective there.
fn best_variance(pairs: &[Pair], sample_period: f64, time: f64) -> (f64, f64) {
    let own = [0, 1].map(|channel| {
        let bands: Vec<Band> = pairs
            .iter()
            .map(|pair| Band { frequency: pair.frequency, density: pair.densities[channel], ordinates: pair.ordinates })
            .collect();
        let bases: Vec<_> = bands.iter().map(|band| basis(band.frequency, sample_period, Some(time))).collect();
        let mut densities = [0.0; TERMS];
        mixture::fit(&bands, &bases, &mut densities);
        bases.iter().map(|basis| mixture::total(basis, &densities)).collect::<Vec<f64>>()
    });
    let process: Vec<f64> =
        pairs.iter().map(|pair| basis(pair.frequency, sample_period, Some(time))[TERMS - 1]).collect();
    let bands = || pairs.iter().zip(&process).zip(own[0].iter().zip(&own[1]));
    // The two channels' coherence is at most 1.
    let most = bands().map(|((_, process), (a, b))| (a * b).sqrt() / process).fold(f64::INFINITY, f64::min);
    let objective = |variance: f64| -> f64 {
        bands()
            .map(|((pair, process), (a, b))| {
                let common = variance * process;
                let determinant = a * b - common * common;
                let trace = b * pair.densities[0] + a * pair.densities[1] - 2.0 * common * pair.common;
                pair.ordinates * (determinant.max(1e-9 * a * b).ln() + trace / determinant.max(1e-9 * a * b))
            })
            .sum()
    };
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let (mut low, mut high) = (-0.999 * most, 0.999 * most);
    for _ in 0..ROUNDS {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if objective(a) < objective(b) { high = b } else { low = a }
    }
    let variance = (low + high) / 2.0;
    (variance, objective(variance))
}

/// Relative standard deviation of the variance when the time constant is known, by the ordinates that show the process.
fn error_at(pairs: &[Pair], sample_period: f64, time: f64, variance: f64) -> f64 {
    let information: f64 = pairs
        .iter()
        .map(|pair| {
            let common = variance * basis(pair.frequency, sample_period, Some(time))[TERMS - 1];
            let product = pair.densities[0] * pair.densities[1];
            2.0 * pair.ordinates * common * common / (product + common * common)
        })
        .sum();
    1.0 / information.max(1.0).sqrt()
}

/// Time constants to be tried on a record, s.
fn time_constants(grid: &Grid) -> impl Iterator<Item = f64> {
    let longest = LONGEST * grid.duration();
    std::iter::successors(Some(SHORTEST * grid.sample_period()), |time| Some(time * FACTOR))
        .take_while(move |&time| time < longest)
}

/// One-sided densities: of white noise and 1/f at 1, of a walk, and of a process of variance 1 with this time constant.
fn basis(frequency: f64, sample_period: f64, time: Option<f64>) -> [f64; TERMS] {
    let walk = PI * sample_period / (PI * frequency * sample_period).sin();
    let markov = time.map_or(0.0, |time| {
        let kept = (-sample_period / time).exp();
        let turn = (2.0 * PI * frequency * sample_period).cos();
        2.0 * sample_period * (1.0 - kept * kept) / (1.0 - 2.0 * kept * turn + kept * kept)
    });
    [1.0, 1.0 / frequency, walk * walk, markov]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Two channels of white noise of deviation 1 at 10 Hz, and a process of deviation 0.5 that both have.
    #[test]
    fn the_process_that_two_channels_share_is_measured() {
        let (mut inside, runs) = (0, 8);
        for seed in 0..runs {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let kept = (-0.1f64 / 20.0).exp();
            let mut process = 0.0;
            let (mut a, mut b) = (Vec::new(), Vec::new());
            for _ in 0..40_000 {
                let mut normal = || random.sample::<f64, _>(StandardNormal);
                process = kept * process + 0.5 * (1.0 - kept * kept).sqrt() * normal();
                a.push(process + normal());
                b.push(process + normal());
            }
            let shared = markov(&Grid::new(0.1, a), &Grid::new(0.1, b)).unwrap();
            let covers = |of: Bounded, truth: f64| usize::from((of.low..=of.high).contains(&truth));
            inside += covers(shared.deviation, 0.5) + covers(shared.time_constant, 20.0);
            // 4,000 s are 100 correlation times: the deviation is known to some 7 %, the time to some 15 %.
            assert!((shared.deviation.value / 0.5).ln().abs() < 0.25, "{seed}: {shared:?}");
            assert!((shared.time_constant.value / 20.0).ln().abs() < 0.5, "{seed}: {shared:?}");
        }
        // 95 % of 16: 11 or fewer would be a chance of one in ten thousand.
        assert!(inside >= 12, "{inside}");
    }
}
