//! A Markov process that two channels share, from the spectra of their half sum and their half difference.
//!
//! The difference has nothing of what both share alike, and as much of their own noise as the sum: it tells what the sum
//! would be without the process.

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
/// Highest frequency, as part of the sample rate.
const HIGHEST: f64 = 0.02;
/// Information below which nothing is known of the variance.
const LEAST_INFORMATION: f64 = 1e-2;
/// Fewest bands that tell four densities and a time.
const FEWEST_BANDS: usize = 16;

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
    fn of(value: f64, (mean, deviation): (f64, f64)) -> Self {
        let half = NORMAL_975 * deviation;
        Self { value, low: (mean - half).exp().min(value), high: (mean + half).exp().max(value) }
    }
}

/// The Markov process that makes the spectra of `a` and `b` likeliest; `None` if their samples differ, or are too few.
#[must_use]
pub fn markov(a: &Grid, b: &Grid) -> Option<Shared> {
    let [first, second] = [a, b].map(|grid| Tapered::of(&grid.detrended()));
    let (first, second) = (first?, second?);
    if first.length != second.length {
        return None;
    }
    let ranges: Vec<_> = ranges((HIGHEST / a.sample_period() / first.resolution()) as usize).collect();
    let together: f64 = ranges.iter().cloned().flatten().map(|at| first.common(&second, at)).sum();
    // One may rise as the other falls.
    let sign = together.signum();
    let halved = |sign: f64| -> Vec<Band> {
        let density = |at: usize| {
            let both = first.common(&first, at) + second.common(&second, at);
            0.25 * (both + 2.0 * sign * first.common(&second, at))
        };
        let band = |range: &std::ops::Range<usize>| Band {
            frequency: first.resolution() * (range.start + range.end - 1) as f64 / 2.0,
            density: range.clone().map(density).sum::<f64>() / range.len() as f64,
            ordinates: range.len() as f64,
        };
        ranges.iter().map(band).collect()
    };
    let (sum, difference) = (halved(sign), halved(-sign));
    let bands = [sum, difference].concat();
    if ranges.len() < FEWEST_BANDS || bands.iter().any(|band| band.density <= 0.0) {
        return None;
    }
    let fits: Vec<Fit> = time_constants(a).map(|time| Fit::of(&bands, a.sample_period(), time)).collect();
    let likeliest = fits.iter().min_by(|a, b| a.objective.total_cmp(&b.objective))?;
    // Every time constant as likely as the data make it: a record of few of them leaves time and variance in doubt
    // together.
    let weighted = |value: &dyn Fn(&Fit) -> f64| {
        let mean = |of: &dyn Fn(f64) -> f64| {
            let (sum, total) = fits.iter().fold((0.0, 0.0), |(sum, total), fit| {
                let weight = (likeliest.objective - fit.objective).exp();
                (sum + weight * of(value(fit)), total + weight)
            });
            sum / total
        };
        let middle = mean(&|value| value);
        (middle, mean(&|value| (value - middle).powi(2)).sqrt())
    };
    let (time, of_time) = weighted(&|fit| fit.time.ln());
    let (deviation, of_deviation) = weighted(&|fit| 0.5 * fit.variance.max(f64::MIN_POSITIVE).ln());
    let (alone, _) = weighted(&|fit| 0.5 * fit.error);
    Some(Shared {
        deviation: Bounded::of(likeliest.variance.sqrt(), (deviation, of_deviation.hypot(alone))),
        // Within a step of the grid any is as likely.
        time_constant: Bounded::of(likeliest.time, (time, of_time.hypot(FACTOR.ln() / 12f64.sqrt()))),
    })
}

/// The likeliest noise and process of a time constant.
struct Fit {
    time: f64,
    variance: f64,
    /// Relative standard deviation of the variance, the rest being known.
    error: f64,
    objective: f64,
}

impl Fit {
    /// To the bands of the half sum, which has the process, and then of the half difference.
    fn of(bands: &[Band], sample_period: f64, time: f64) -> Self {
        let basis = |(at, band): (usize, &Band)| {
            let [white, flicker, walk, process] = basis(band.frequency, sample_period, time);
            [white, flicker, walk, if at < bands.len() / 2 { process } else { 0.0 }]
        };
        let bases: Vec<[f64; TERMS]> = bands.iter().enumerate().map(basis).collect();
        let mut densities = [0.0; TERMS];
        mixture::fit(bands, &bases, &mut densities);
        let totals: Vec<f64> = bases.iter().map(|basis| mixture::total(basis, &densities)).collect();
        let variance = densities[TERMS - 1];
        let share = |(basis, total): (&[f64; TERMS], &f64)| basis[TERMS - 1] * variance / total;
        let shares = bases.iter().zip(&totals).map(share);
        let information: f64 = shares.zip(bands).map(|(share, band)| band.ordinates * share * share).sum();
        Self {
            time,
            variance,
            error: information.max(LEAST_INFORMATION).sqrt().recip(),
            objective: mixture::objective(bands, &totals),
        }
    }
}

/// Time constants to be tried on a record, s.
fn time_constants(grid: &Grid) -> impl Iterator<Item = f64> {
    let longest = LONGEST * grid.duration();
    std::iter::successors(Some(SHORTEST * grid.sample_period()), |time| Some(time * FACTOR))
        .take_while(move |&time| time < longest)
}

/// One-sided densities: of white noise and 1/f at 1, of a walk, and of a process of variance 1 with this time constant.
fn basis(frequency: f64, sample_period: f64, time: f64) -> [f64; TERMS] {
    let walk = PI * sample_period / (PI * frequency * sample_period).sin();
    let kept = (-sample_period / time).exp();
    let turn = (2.0 * PI * frequency * sample_period).cos();
    let markov = 2.0 * sample_period * (1.0 - kept * kept) / (1.0 - 2.0 * kept * turn + kept * kept);
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
