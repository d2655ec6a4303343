//! Disturbances that begin at once and decay, at any times (shot noise).
//!
//! Their spectrum is that of a Markov process, so that no second moment tells the two apart. The block means of a record are passed
//! through the matched filter for an exponential decay in noise of the record's own spectrum (G. Turin, "An introduction to matched
//! filters", IRE Trans. IT-6, 1960), for several time constants, and the third Hermite polynomials `z³ − 3z` of the output are summed. For
//! standard normal numbers with the correlation ρ the mean product of two is 6ρ³ (F. Mehler, J. reine angew. Math. 66, 1866), so that the
//! variance of the sum in any Gaussian noise follows from the autocorrelation of the filtered noise alone.
//!
//! The same sum for a decay in reversed time is as large, up to its sign, where the process is the same both ways, as random telegraph
//! noise and single samples are, and for a sawtooth.

use super::periodogram::{smooth_length, taper};
use super::slow_background::SlowBackground;
use super::transforms;
use super::whittle::SpectralBand;
use crate::bounds::BoundedEstimate;
use crate::distributions::{quantile, upper_tail};
use crate::effects::findings::SIGNIFICANCE;
use crate::samples::uniform_series::UniformSeries;
use realfft::num_complex::Complex;
use std::f64::consts::{SQRT_2, TAU};

/// Blocks of the record, at least.
const BLOCKS: usize = 4096;
/// Largest part of the blocks that may have no samples.
const MOST_EMPTY: f64 = 1.0 / 32.0;
/// Time constants of the filters: 1, 2, 4 … 64 blocks. At a factor of √2 from the true one a filter has 97 % of its response.
const TIMES: u32 = 7;
/// Lowest order, in periods per record, that the filters pass: below, the density is known to the scatter of a few ordinates.
const LOWEST: usize = 6;
/// White noise, a random walk and ten Markov processes.
const TERMS: usize = 12;
/// An ordinate over the noise that is a line, which chance exceeds at one of 10⁶, and ordinates on either side that its taper reaches.
const LINE: f64 = 14.0;
const LINE_REACH: usize = 2;
/// Ordinates on either side whose mean is a band of its own above this multiple of the noise, by chance with 10⁻⁴.
const BAND_REACH: usize = 8;
const BAND: f64 = 2.0;
/// Time constants, and blocks beyond them, at either end of the record in which the filters respond to the ends.
const END_TIMES: usize = 4;
const END_BLOCKS: usize = 16;
/// Largest response that is counted, in standard deviations: a single large disturbance is no process.
const LARGEST: f64 = 4.0;
/// Probability by chance of what is left of the sum without the largest disturbance, at most.
const LEFT_BY_CHANCE: f64 = 0.01;
/// Probability by which the sums of the two directions differ by chance as much, at most, where the process is the same both ways: of
/// sums of variance 1, and by the scatter of the differences over stretches of four time constants, each by itself. A process whose third
/// moment is not 0 is rare enough for this.
const DIRECTION_BY_CHANCE: f64 = 0.05;
/// Largest part that the sum of the reversed filter has of the other: strong disturbances change the noise that the filters are made for.
const LARGEST_REVERSED: f64 = 0.75;

/// Disturbances of one direction that decay.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DecayingDisturbances {
    /// By the filter that responds most, to the next ones on either side, s.
    pub time_constant: BoundedEstimate,
    /// Sum over the responses in its standard deviations, above 0 where the disturbances go upwards; that of the reversed filter.
    pub sum: f64,
    pub reversed: f64,
    /// Probability of such a sum for any of the filters by chance.
    pub p_value: f64,
}

impl DecayingDisturbances {
    /// Those of a record; `None` if chance, a single disturbance or a process that is the same both ways explains them.
    pub(crate) fn find(series: &UniformSeries) -> Option<Self> {
        // Of a channel that never changes nothing is left.
        let series = series.clone().averaged_until_dithered();
        let size = series.values().len() / BLOCKS;
        if size == 0 {
            return None;
        }
        let blocks = series.averaged(size);
        let record = WhitenedRecord::new(filled(blocks.values())?)?;
        let responses = (0..TIMES).filter_map(|power| record.response(1 << power, false));
        let best = responses.max_by(|a, b| a.sum.abs().total_cmp(&b.sum.abs()))?;
        // Either direction of each filter. The sum of many terms is nearly normal: of 1,500 simulated records of white and flicker noise
        // 1 % have a largest one above 3.1 and 0.1 % above 3.8, against 3.2 and 3.8 of normal ones.
        let p_value = 2.0 * f64::from(TIMES) * upper_tail(best.sum.abs());
        if p_value > SIGNIFICANCE || best.sum_without_largest() < quantile(LEFT_BY_CHANCE) {
            return None;
        }
        let reversed = record.response(best.time, true)?;
        let time_s = best.time as f64 * blocks.sample_period();
        best.exceeds(&reversed).then(|| Self {
            time_constant: BoundedEstimate::new(time_s, 0.5 * time_s, 2.0 * time_s),
            sum: best.sum,
            reversed: reversed.sum,
            p_value,
        })
    }
}

/// The means without their gaps, each of which continues the one before; `None` if too many are missing.
fn filled(means: &[f64]) -> Option<Vec<f64>> {
    let present = means.iter().filter(|mean| mean.is_finite()).count();
    if ((means.len() - present) as f64) > MOST_EMPTY * means.len() as f64 {
        return None;
    }
    let mut latest = means.iter().copied().find(|mean| mean.is_finite())?;
    let fill = |mean: &f64| {
        latest = if mean.is_finite() { *mean } else { latest };
        latest
    };
    Some(means.iter().take(smooth_length(means.len())).map(fill).collect())
}

/// The Fourier transform of a record and the density of its noise.
struct WhitenedRecord {
    length: usize,
    transform: Vec<Complex<f64>>,
    /// One over the density, 0 at lines.
    weights: Vec<f64>,
    /// What a delay of a block turns each order by.
    turns: Vec<Complex<f64>>,
}

impl WhitenedRecord {
    fn new(values: Vec<f64>) -> Option<Self> {
        let length = values.len();
        let forward = transforms::forward(length);
        // A periodic continuation without a jump.
        let end = length / 256;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let (first, last) = (mean(values.get(..end)?), mean(values.get(length - end..)?));
        let slope = (last - first) / (length - end) as f64;
        let mut values: Vec<f64> =
            values.iter().enumerate().map(|(at, value)| value - first - slope * at as f64).collect();
        let level = mean(&values);
        values.iter_mut().for_each(|value| *value -= level);
        let mut tapered: Vec<f64> = values.iter().enumerate().map(|(at, value)| taper(at, length) * value).collect();
        let squares: f64 = (0..length).map(|at| taper(at, length).powi(2)).sum();
        let mut transform = forward.make_output_vec();
        // An error means buffers of the wrong length; these are the plan's own.
        forward.process(&mut tapered, &mut transform).ok()?;
        let ordinates: Vec<f64> = transform.iter().map(|bin| bin.norm_sqr() / squares).collect();
        forward.process(&mut values, &mut transform).ok()?;
        let turns = (0..transform.len()).map(|order| Complex::cis(-TAU * order as f64 / length as f64)).collect();
        Some(Self { length, transform, weights: weights(&ordinates)?, turns })
    }

    /// The response of the filter for a decay of `time` blocks, or for one in reversed time.
    fn response(&self, time: usize, is_reversed: bool) -> Option<Response> {
        let inverse = transforms::inverse(self.length);
        let kept = (-1.0 / time as f64).exp();
        let decays: Vec<Complex<f64>> = self.turns.iter().map(|turn| 1.0 / (1.0 - kept * turn)).collect();
        let last = self.transform.len() - 1;
        let real_end = |order: usize, bin: Complex<f64>| if order == last { bin.re.into() } else { bin };
        let filter = |(order, (bin, weight)): (usize, (&Complex<f64>, &f64))| {
            let decay = if is_reversed { decays[order] } else { decays[order].conj() };
            real_end(order, *weight * bin * decay)
        };
        let spectrum = self.weights.iter().zip(&decays).map(|(weight, decay)| (weight * decay.norm_sqr()).into());
        let (mut filtered, mut spectrum): (Vec<Complex<f64>>, Vec<Complex<f64>>) =
            (self.transform.iter().zip(&self.weights).enumerate().map(filter).collect(), spectrum.collect());
        let (mut output, mut correlation) = (inverse.make_output_vec(), inverse.make_output_vec());
        inverse.process(&mut filtered, &mut output).ok()?;
        inverse.process(&mut spectrum, &mut correlation).ok()?;
        let variance = correlation[0];
        let cubes: f64 = correlation.iter().map(|of| (of / variance).powi(3)).sum();
        let ends = END_TIMES * time + END_BLOCKS;
        let inner = output.get(ends..self.length - ends)?;
        let deviation = (inner.iter().map(|z| z * z).sum::<f64>() / inner.len() as f64).sqrt();
        let standard = (6.0 * inner.len() as f64 * cubes).sqrt();
        let hermite = |z: &f64| {
            let z = (z / deviation).clamp(-LARGEST, LARGEST);
            (z.powi(3) - 3.0 * z) / standard
        };
        let terms: Vec<f64> = inner.iter().map(hermite).collect();
        let sum: f64 = terms.iter().sum();
        (deviation > 0.0 && sum.is_finite()).then_some(Response { time, sum, terms })
    }
}

/// One over the density of the noise at each order, up to a factor; 0 at lines and where the density is not known.
fn weights(ordinates: &[f64]) -> Option<Vec<f64>> {
    let mut bands: Vec<SpectralBand> = Vec::new();
    let mut first = 1;
    while first + 1 < ordinates.len() {
        // A band is an eighth of its frequency wide.
        let next = (first + first / 8 + 1).min(ordinates.len() - 1);
        let count = (next - first) as f64;
        let density = ordinates[first..next].iter().sum::<f64>() / count;
        bands.push(SpectralBand { frequency: 0.5 * (first + next - 1) as f64, density, ordinates: count });
        first = next;
    }
    let background = SlowBackground::<TERMS>::fit(&bands)?;
    let noise: Vec<f64> = (0..ordinates.len()).map(|order| background.density(order as f64)).collect();
    let ratios: Vec<f64> = ordinates.iter().zip(&noise).map(|(ordinate, noise)| ordinate / noise).collect();
    let around = |at: usize, reach: usize| &ratios[at.saturating_sub(reach)..(at + reach + 1).min(ratios.len())];
    let weight = |(order, noise): (usize, &f64)| {
        if order < LOWEST || around(order, LINE_REACH).iter().any(|ratio| *ratio > LINE) {
            return 0.0;
        }
        let near = around(order, BAND_REACH);
        let level = near.iter().sum::<f64>() / near.len() as f64;
        1.0 / (noise * if level > BAND { level } else { 1.0 })
    };
    Some(noise.iter().enumerate().map(weight).collect())
}

/// What one filter responds.
struct Response {
    /// Time constant, blocks.
    time: usize,
    /// In standard deviations of it in Gaussian noise.
    sum: f64,
    /// The sum's, of each block.
    terms: Vec<f64>,
}

impl Response {
    /// The absolute value of the sum less the largest part that a stretch of two time constants on either side of a block has.
    fn sum_without_largest(&self) -> f64 {
        let width = (4 * self.time + 1).min(self.terms.len());
        let mut stretch: f64 = self.terms[..width].iter().sum();
        let mut largest = stretch * self.sum.signum();
        for (next, past) in self.terms[width..].iter().zip(&self.terms) {
            stretch += next - past;
            largest = largest.max(stretch * self.sum.signum());
        }
        self.sum.abs() - largest
    }

    /// Whether the absolute sum is larger than that of the filter in reversed time, beyond what chance does.
    fn exceeds(&self, reversed: &Self) -> bool {
        let (own, other) = (self.sum.abs(), reversed.sum.abs());
        let differences = self.terms.iter().zip(&reversed.terms);
        let differences: Vec<f64> =
            differences.map(|(a, b)| a * self.sum.signum() - b * reversed.sum.signum()).collect();
        let stretches = differences.chunks_exact((4 * self.time).max(END_BLOCKS)).map(|of| of.iter().sum::<f64>());
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

    const PERIOD_S: f64 = 0.05;

    /// White noise of deviation 1 at 20 Hz over 410 s, with the values of `next`.
    fn series(seed: u64, mut next: impl FnMut(&mut ChaCha8Rng, usize) -> f64) -> UniformSeries {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let value = |at| next(&mut random, at) + random.sample::<f64, _>(StandardNormal);
        UniformSeries::new(PERIOD_S, (0..2 * BLOCKS).map(value).collect())
    }

    /// Some 20 disturbances of this height, each of which decays within 3 s.
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
            // The response to one of height 1 is √(3 s/2/0.05 s), 5.5 standard deviations.
            let found = DecayingDisturbances::find(&series(seed, decays(height))).expect("twenty clear ones");
            assert_eq!(found.sum > 0.0, height > 0.0, "{found:?}");
            // To the next filter but one: their sums differ little.
            assert!((found.time_constant.value / 3.0).log2().abs() < 2.0, "{found:?}");
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
