//! Shot noise: disturbances that begin at once and decay, at random times.
//!
//! Its spectrum is that of a Markov process, so third moments decide: the sum of `z³ − 3z` of the block means behind
//! matched filters (G. Turin, IRE Trans. IT-6, 1960). In Gaussian noise its variance is the sum of 6ρ³ (F. Mehler, J.
//! reine angew. Math. 66, 1866). In processes that are reversible in time the reversed filter has as large a sum.

mod campbell;
mod matched_filter;
mod overlaps;

use crate::bounds::BoundedEstimate;
use crate::distributions::{quantile, upper_tail};
use crate::effects::findings::SIGNIFICANCE;
use crate::samples::uniform_series::UniformSeries;
use campbell::CampbellEstimate;
use matched_filter::WhitenedRecord;
use std::f64::consts::SQRT_2;

/// Fewest blocks of the record.
const BLOCKS: usize = 4096;
/// Number of time constants: 1, 2, 4 … 64 blocks, at most √2 off, where 97 % of the response is left.
const TIMES: u32 = 7;
/// Largest response that counts, in standard deviations, against single large disturbances.
const LARGEST: f64 = 4.0;
/// Largest p-value without the largest disturbance.
const LEFT_BY_CHANCE: f64 = 0.01;
/// Largest p-value of the difference of the two directions, by the variance 1 and by the scatter over stretches.
const DIRECTION_BY_CHANCE: f64 = 0.05;
/// Largest ratio of the reversed filter's sum: strong disturbances change the noise that the filters assume.
const LARGEST_REVERSED: f64 = 0.75;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DecayingDisturbances {
    /// s
    pub time_constant: BoundedEstimate,
    /// In the unit of the series; negative downwards.
    pub size: BoundedEstimate,
    /// 1/s
    pub rate_hz: BoundedEstimate,
    /// Standard deviation of their sum, in the unit of the series.
    pub deviation: BoundedEstimate,
    /// Sum in its standard deviations, positive upwards; and that of the reversed filter.
    pub sum: f64,
    pub reversed: f64,
    /// Probability by chance for any of the filters.
    pub p_value: f64,
}

impl DecayingDisturbances {
    /// `None` if chance, a single disturbance or a reversible process explains them.
    pub(crate) fn find(series: &UniformSeries) -> Option<Self> {
        let sample_period = series.sample_period();
        let series = series.clone().averaged_until_dithered();
        let size = series.values().len() / BLOCKS;
        if size == 0 {
            return None;
        }
        let blocks = series.averaged(size);
        let record = WhitenedRecord::new(blocks.values())?;
        let responses = (0..TIMES).filter_map(|power| Response::new(&record, f64::from(1_u32 << power), false));
        let best = responses.max_by(|a, b| a.sum.abs().total_cmp(&b.sum.abs()))?;
        // Either direction of each filter. Nearly normal: 1 % of simulated records exceed 3.1, against 3.2.
        let p_value = 2.0 * f64::from(TIMES) * upper_tail(best.sum.abs());
        if p_value > SIGNIFICANCE || best.sum_without_largest() < quantile(LEFT_BY_CHANCE) {
            return None;
        }
        let reversed = Response::new(&record, best.time, true)?;
        if !best.exceeds(&reversed) {
            return None;
        }
        let block_s = blocks.sample_period();
        let samples_per_block = (block_s / sample_period).round() as usize;
        let found = CampbellEstimate::new(&record, best.time, best.sum.signum(), samples_per_block)?;
        let BoundedEstimate { value, low, high } = found.size;
        let downwards = || BoundedEstimate::new(-value, -high, -low);
        Some(Self {
            time_constant: found.time_constant.scaled(block_s),
            size: if best.sum > 0.0 { found.size } else { downwards() },
            rate_hz: found.rate.scaled(1.0 / block_s),
            deviation: found.deviation,
            sum: best.sum,
            reversed: reversed.sum,
            p_value,
        })
    }
}

struct Response {
    time: f64,
    /// In its standard deviations in Gaussian noise.
    sum: f64,
    terms: Vec<f64>,
}

impl Response {
    fn new(record: &WhitenedRecord, time: f64, is_reversed: bool) -> Option<Self> {
        let filtered = record.filtered(time, is_reversed)?;
        let variance = filtered.covariance.first()?;
        let cubes: f64 = filtered.covariance.iter().map(|of| (of / variance).powi(3)).sum();
        let inner = record.inner(&filtered.output, time)?;
        let deviation = (inner.iter().map(|z| z * z).sum::<f64>() / inner.len() as f64).sqrt();
        let standard = (6.0 * inner.len() as f64 * cubes).sqrt();
        let hermite = |z: &f64| {
            let z = (z / deviation).clamp(-LARGEST, LARGEST);
            (z.powi(3) - 3.0 * z) / standard
        };
        let terms: Vec<f64> = inner.iter().map(hermite).collect();
        let sum: f64 = terms.iter().sum();
        (deviation > 0.0 && sum.is_finite()).then_some(Self { time, sum, terms })
    }

    /// Absolute sum less the largest part within two time constants of a block.
    fn sum_without_largest(&self) -> f64 {
        let width = (4.0 * self.time) as usize + 1;
        let width = width.min(self.terms.len());
        let mut stretch: f64 = self.terms[..width].iter().sum();
        let mut largest = stretch * self.sum.signum();
        for (next, past) in self.terms[width..].iter().zip(&self.terms) {
            stretch += next - past;
            largest = largest.max(stretch * self.sum.signum());
        }
        self.sum.abs() - largest
    }

    /// True if the absolute sum exceeds the reversed filter's beyond chance.
    fn exceeds(&self, reversed: &Self) -> bool {
        let (own, other) = (self.sum.abs(), reversed.sum.abs());
        let differences = self.terms.iter().zip(&reversed.terms);
        let differences: Vec<f64> =
            differences.map(|(a, b)| a * self.sum.signum() - b * reversed.sum.signum()).collect();
        let stretches = differences.chunks_exact(WhitenedRecord::stretch(self.time)).map(|of| of.iter().sum::<f64>());
        let (sum, squares) = stretches.fold((0.0, 0.0), |(sum, squares), of| (sum + of, squares + of * of));
        let limit = quantile(DIRECTION_BY_CHANCE);
        own - other > SQRT_2 * limit && other < LARGEST_REVERSED * own && sum > limit * f64::sqrt(squares)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    const PERIOD_S: f64 = 0.05;

    fn series(seed: u64, mut next: impl FnMut(&mut ChaCha8Rng, usize) -> f64) -> UniformSeries {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let value = |at| next(&mut random, at) + random.sample::<f64, _>(StandardNormal);
        UniformSeries::new(PERIOD_S, (0..2 * BLOCKS).map(value).collect())
    }

    /// Some 20 disturbances of this height that decay within 3 s.
    fn decays(height: f64) -> impl FnMut(&mut ChaCha8Rng, usize) -> f64 {
        let mut level = 0.0;
        move |random, _| {
            level *= (-PERIOD_S / 3.0).exp();
            if random.random_bool(20.0 / (2 * BLOCKS) as f64) {
                level += height;
            }
            level
        }
    }

    #[test]
    fn disturbances_that_decay_are_found_in_either_direction() {
        for (seed, height) in [(1, 1.0), (2, -1.0), (3, 0.8), (4, -5.0)] {
            // Response to height 1: √(3 s/2/0.05 s) = 5.5 standard deviations.
            let found = DecayingDisturbances::find(&series(seed, decays(height))).expect("twenty clear ones");
            assert_eq!(found.sum > 0.0, height > 0.0, "{found:?}");
            // Sums of neighbouring filters differ little.
            assert!((found.time_constant.value / 3.0).log2().abs() < 2.0, "{found:?}");
        }
    }

    /// `rate` per sample, time constant in samples.
    fn shot_noise(seed: u64, [rate, size, time_constant]: [f64; 3]) -> UniformSeries {
        let (mut level, mut next, kept) = (0.0, 0.0, (-1.0 / time_constant).exp());
        series(seed, move |random, at| {
            level *= kept;
            while next <= at as f64 {
                level += size * (-(at as f64 - next) / time_constant).exp();
                next -= (1.0 - random.random::<f64>()).ln() / rate;
            }
            level
        })
    }

    /// Fewer than 87 of 100 have a probability of 10⁻³ (binomial distribution).
    #[test]
    fn intervals_hold_the_truth() {
        for [count, size, time_constant] in
            [[40.0, 1.0, 40.0], [20.0, -1.0, 100.0], [40.0, 3.0, 30.0], [60.0, 2.0, 12.0]]
        {
            let rate = count / (2 * BLOCKS) as f64;
            let deviation = f64::abs(size) * (0.5 * rate * time_constant).sqrt();
            let truths = [rate, size, time_constant, deviation];
            let mut held = [0; 4];
            let records = (1000_u64..).map(|seed| shot_noise(seed, [rate, size, time_constant]));
            for found in records.filter_map(|series| DecayingDisturbances::find(&series)).take(100) {
                let DecayingDisturbances { rate_hz, size, time_constant, deviation, .. } = found;
                let estimates = [rate_hz.scaled(PERIOD_S), size, time_constant.scaled(1.0 / PERIOD_S), deviation];
                for (held, (estimate, truth)) in held.iter_mut().zip(estimates.iter().zip(truths)) {
                    *held += usize::from((estimate.low..=estimate.high).contains(&truth));
                }
            }
            assert!(held.iter().all(|held| *held >= 87), "{count} {size} {time_constant}: {held:?}");
        }
    }

    #[test]
    fn gaussian_noise_has_none() {
        for seed in 100..250 {
            assert_eq!(DecayingDisturbances::find(&series(seed, |_, _| 0.0)), None, "{seed}");
            let mut walk = 0.0;
            let walking = series(seed, move |random, _| {
                walk += 0.05 * random.sample::<f64, _>(StandardNormal);
                walk
            });
            assert_eq!(DecayingDisturbances::find(&walking), None, "{seed}");
            let (mut state, kept) = (0.0, (-PERIOD_S / 3.0f64).exp());
            let markov = series(seed, move |random, _| {
                state = kept * state + (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
                state
            });
            assert_eq!(DecayingDisturbances::find(&markov), None, "{seed}");
        }
    }

    #[test]
    fn what_is_the_same_both_ways_or_comes_once_is_none() {
        for seed in 10..20 {
            let mut is_up = false;
            let telegraph = move |random: &mut ChaCha8Rng, _| {
                is_up ^= random.random_bool(PERIOD_S / if is_up { 2.0 } else { 10.0 });
                if is_up { 2.0 } else { 0.0 }
            };
            let spikes = |random: &mut ChaCha8Rng, _| if random.random_bool(0.002) { 6.0 } else { 0.0 };
            let once = |_: &mut ChaCha8Rng, at: usize| {
                if at < 3000 { 0.0 } else { 20.0 * (-(at as f64 - 3000.0) / 60.0).exp() }
            };
            let step = |_: &mut ChaCha8Rng, at: usize| if at < 3000 { 0.0 } else { 2.0 };
            let sine = |_: &mut ChaCha8Rng, at: usize| 3.0 * (TAU * 0.3 * PERIOD_S * at as f64).sin();
            let sawtooth = |_: &mut ChaCha8Rng, at: usize| 2.0 * (at as f64 / 600.0).fract();
            assert_eq!(DecayingDisturbances::find(&series(seed, telegraph)), None, "{seed}");
            assert_eq!(DecayingDisturbances::find(&series(seed, spikes)), None, "{seed}");
            assert_eq!(DecayingDisturbances::find(&series(seed, once)), None, "{seed}");
            assert_eq!(DecayingDisturbances::find(&series(seed, step)), None, "{seed}");
            assert_eq!(DecayingDisturbances::find(&series(seed, sine)), None, "{seed}");
            assert_eq!(DecayingDisturbances::find(&series(seed, sawtooth)), None, "{seed}");
        }
        assert_eq!(DecayingDisturbances::find(&UniformSeries::new(1.0, vec![1.0; 2 * BLOCKS])), None);
    }
}
