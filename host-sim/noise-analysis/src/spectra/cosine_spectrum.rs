//! The slowest noise of a record, by the discrete cosine transform of means over 256 equal blocks.
//!
//! The even continuation of a record has no jump at its ends, so that little of a random walk leaks from one coefficient to
//! another, and the transform needs no taper: it shows what a record does over its own length. A Fourier transform under a taper,
//! or the longest octave of the Allan variance, does not, and that is where a Markov process, which comes back, differs from a
//! random walk, which does not. The expected square of each coefficient follows from the covariance of the block means
//! (N. Ahmed, T. Natarajan and K. Rao, "Discrete cosine transform", IEEE Trans. Computers C-23, 1974).

use super::markov_spectrum::{MarkovEstimate, MarkovFit, OWN, TERMS, most_likely, time_constants};
use super::transforms::cosine_transform;
use super::whittle::SpectralBand;
use crate::detectors::block_cosines::{flicker_squares, markov_squares, walk_squares};
use crate::samples::uniform_series::UniformSeries;
use allan_core::NoiseTerm;
use std::ops::Range;
use std::sync::LazyLock;

/// Blocks of a record.
const BLOCKS: usize = 256;
/// Least samples of a block: the covariances are those of continuous means.
const LEAST_SAMPLES: usize = 8;
/// Most blocks without samples.
const MOST_EMPTY: usize = BLOCKS / 32;
/// Time constants that are tried: the shortest and the longest, in blocks.
const SHORTEST: f64 = 1.0;
const LONGEST: f64 = BLOCKS as f64 / 6.0;
/// Coefficients of a line that are left out on either side of it.
const LINE_COEFFICIENTS: f64 = 8.0;
/// Fewest bands, of 58, for a fit of four densities and a time constant.
const FEWEST_BANDS: usize = 20;
/// Least gain in ln likelihood by a Markov process. Of 60,000 simulated records of white noise and a random walk with steps of its size, in
/// which chance gains most, 136 gained more than 4.5, 23 more than 6, and 2 more than 8; where the steps have any size from a thousandth of
/// it on, 28, 3 and none: chance gives the name in one of 3,000 records of six channels, and in one of 400 at most.
const LEAST_GAIN: f64 = 6.0;

/// The slowest noise of one channel.
#[derive(Debug, Clone)]
pub(crate) struct CosineSpectrum {
    /// Duration of a block, s.
    block_s: f64,
    /// Mean square of the coefficients of each band.
    squares: Vec<f64>,
}

/// The orders of the coefficients in each band: a band is 1/12 of its order wide.
fn bands() -> impl Iterator<Item = Range<usize>> {
    let next = |from: usize| (from < BLOCKS).then(|| from..(from + (from / 12).max(1)).min(BLOCKS));
    std::iter::successors(next(1), move |band| next(band.end))
}

impl CosineSpectrum {
    /// The spectrum of `series`; `None` if it is too short, or if too many blocks have no samples.
    pub(crate) fn new(series: &UniformSeries) -> Option<Self> {
        let size = series.values().len() / BLOCKS;
        if size < LEAST_SAMPLES {
            return None;
        }
        let blocks = series.averaged(size);
        let mean = blocks.mean();
        let missing = blocks.values()[..BLOCKS].iter().filter(|value| !value.is_finite()).count();
        if missing > MOST_EMPTY {
            return None;
        }
        let mut latest = mean;
        let filled = blocks.values()[..BLOCKS].iter().map(|value| {
            latest = if value.is_finite() { *value } else { latest };
            latest - mean
        });
        let squares = cosine_transform(filled).into_iter().skip(1).map(|of| 2.0 / BLOCKS as f64 * of * of);
        let squares = in_bands(&squares.collect::<Vec<f64>>());
        squares.iter().all(|square| *square > 0.0).then(|| Self { block_s: blocks.sample_period(), squares })
    }

    /// The Markov process beside white, flicker and random-walk noise; `None` if the record is as likely without one. `lines` are
    /// the frequencies of lines, Hz, and `filter_s` the length of the sensor's filter, below which nothing is tried.
    pub(crate) fn find_markov(&self, lines: &[f64], filter_s: f64) -> Option<MarkovEstimate> {
        let is_line = |order: usize| {
            // A faster line is folded down by the means over blocks.
            let of_line = |frequency: f64| {
                let folded = (2.0 * BLOCKS as f64 * self.block_s * frequency).rem_euclid(2.0 * BLOCKS as f64);
                folded.min(2.0 * BLOCKS as f64 - folded)
            };
            lines.iter().any(|&frequency| (order as f64 - of_line(frequency)).abs() < LINE_COEFFICIENTS)
        };
        let (places, shown): (Vec<usize>, Vec<SpectralBand>) = bands()
            .zip(&self.squares)
            .enumerate()
            .filter(|(_, (band, _))| !band.clone().any(is_line))
            // One real number has half the degrees of freedom of an ordinate of a Fourier transform.
            .map(|(place, (band, &density))| {
                (place, SpectralBand { frequency: 0.0, density, ordinates: 0.5 * band.len() as f64 })
            })
            .unzip();
        if shown.len() < FEWEST_BANDS {
            return None;
        }
        let noise = noise_shapes();
        let fit = |process: Option<&MarkovShape>| {
            let basis = |&place: &usize| {
                let [white, flicker, walk] = noise[place];
                [white, flicker, walk, process.map_or(0.0, |process| process.expected[place]), 0.0, 0.0]
            };
            let bases: Vec<[f64; TERMS]> = places.iter().map(basis).collect();
            MarkovFit::new(&shown, &bases, process.map_or(0.0, |process| process.time * self.block_s), OWN)
        };
        let without = fit(None).objective;
        let slow = markov_shapes().iter().filter(|shape| shape.time * self.block_s > filter_s);
        let fits: Vec<MarkovFit> = slow.map(|shape| fit(Some(shape))).collect();
        // A process that is likeliest with the shortest time constant is shorter still, or noise that differs from white at the
        // frequencies of the blocks.
        let shortest = fits.first()?.time;
        most_likely(&fits, without).filter(|found| found.gain > LEAST_GAIN && found.time_constant.value > shortest)
    }
}

/// Means over each band of a value per order from 1 on.
fn in_bands(by_order: &[f64]) -> Vec<f64> {
    bands().map(|band| by_order[band.start - 1..band.end - 1].iter().sum::<f64>() / band.len() as f64).collect()
}

/// Expected mean squares in each band of white, flicker and random-walk noise of density, B and steps per block of 1.
fn noise_shapes() -> &'static [[f64; 3]] {
    static SHAPES: LazyLock<Vec<[f64; 3]>> = LazyLock::new(|| {
        let [flicker, walk] = [flicker_squares(BLOCKS), walk_squares(BLOCKS)].map(|squares| in_bands(&squares));
        flicker.into_iter().zip(walk).map(|(flicker, walk)| [1.0, flicker, walk]).collect()
    });
    &SHAPES
}

/// Expected square of the cosine coefficient of flicker noise of this order over its density at the frequency of the cosine: little of
/// the lower frequencies leaks into the lowest coefficients, and nothing to speak of into others.
pub(super) fn flicker_leakage(order: f64) -> f64 {
    static RATIOS: LazyLock<Vec<f64>> = LazyLock::new(|| {
        let single = bands().zip(noise_shapes()).take_while(|(band, _)| band.len() == 1);
        let ratio = |(band, [_, flicker, _]): (Range<usize>, &[f64; 3])| {
            let frequency = band.start as f64 / (2 * BLOCKS) as f64;
            flicker / NoiseTerm::BiasInstability.process().density(frequency, 1.0)
        };
        single.map(ratio).collect()
    });
    RATIOS.get((order.round() as usize).saturating_sub(1)).copied().unwrap_or(1.0)
}

/// A Markov process of variance 1.
struct MarkovShape {
    /// Time constant, blocks.
    time: f64,
    /// Expected mean square in each band.
    expected: Vec<f64>,
}

fn markov_shapes() -> &'static [MarkovShape] {
    static SHAPES: LazyLock<Vec<MarkovShape>> = LazyLock::new(|| {
        let of_time = |time: f64| MarkovShape { time, expected: in_bands(&markov_squares(BLOCKS, time)) };
        time_constants(SHORTEST, LONGEST).map(of_time).collect()
    });
    &SHAPES
}

#[cfg(test)]
mod tests {
    use super::{BLOCKS, CosineSpectrum, bands, noise_shapes};
    use crate::samples::uniform_series::UniformSeries;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// White noise of deviation 1 at 10 Hz over 4,000 s, with a sum of steps of deviation `step`, a process of this deviation with a
    /// time constant of 40 s, and a sine of amplitude 1 at 0.05 Hz.
    fn series(seed: u64, step: f64, deviation: f64) -> UniformSeries {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let kept = (-0.1f64 / 40.0).exp();
        let (mut walk, mut process) = (0.0, 0.0);
        let value = |at: usize| {
            let mut normal = || random.sample::<f64, _>(StandardNormal);
            walk += step * normal();
            process = kept * process + deviation * (1.0 - kept * kept).sqrt() * normal();
            walk + process + normal() + (0.05 * std::f64::consts::TAU * at as f64 / 10.0).sin()
        };
        UniformSeries::new(0.1, (0..40_000).map(value).collect())
    }

    #[test]
    fn tells_a_markov_process_from_a_random_walk() {
        let find = |series: &UniformSeries| CosineSpectrum::new(series)?.find_markov(&[0.05], 0.0);
        let (mut inside, runs) = (0, 8);
        for seed in 0..runs {
            let found = find(&series(seed, 0.0, 0.5)).expect("100 time constants");
            // 100 time constants: the deviation is known to some 7 %, the time to some 15 %.
            assert!((found.deviation.value / 0.5).ln().abs() < 0.4, "{seed}: {found:?}");
            assert!((found.time_constant.value / 40.0).ln().abs() < 0.7, "{seed}: {found:?}");
            inside += usize::from((found.time_constant.low..=found.time_constant.high).contains(&40.0));
            inside += usize::from((found.deviation.low..=found.deviation.high).contains(&0.5));
            assert_eq!(find(&series(seed, 0.01, 0.0)), None, "{seed}");
            assert_eq!(find(&series(seed, 0.0, 0.0)), None, "{seed}");
        }
        // 95 % of 16 are expected; 11 or fewer have a probability of one in ten thousand.
        assert!(inside >= 12, "{inside}");
    }

    #[test]
    fn random_walks_are_no_markov_processes() {
        let of_seed = |seed: u64| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut walk = 0.0;
            let values = (0..8 * BLOCKS).map(|_| {
                walk += random.sample::<f64, _>(StandardNormal);
                walk + random.sample::<f64, _>(StandardNormal)
            });
            CosineSpectrum::new(&UniformSeries::new(1.0, values.collect()))
        };
        let found = (0..400).filter(|&seed| of_seed(seed).expect("complete").find_markov(&[], 0.0).is_some()).count();
        // 0.04 % of 400 are expected; more than 2 have a probability of one in a thousand.
        assert!(found <= 2, "{found}");
    }

    #[test]
    fn finds_most_processes_of_sixty_time_constants() {
        let found = |time_constants: f64| {
            // 8 samples a block.
            let kept = (-time_constants / (8.0 * BLOCKS as f64)).exp();
            let of_seed = |seed: u64| {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                let mut process: f64 = random.sample(StandardNormal);
                let values = (0..8 * BLOCKS).map(|_| {
                    process = kept * process + (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
                    process + 0.03 * random.sample::<f64, _>(StandardNormal)
                });
                CosineSpectrum::new(&UniformSeries::new(1.0, values.collect()))
            };
            (0..100).filter(|&seed| of_seed(seed).expect("complete").find_markov(&[], 0.0).is_some()).count()
        };
        // docs/derivations.md tells of 37 and 99 of 100; as few have a probability of one in a thousand.
        let (thirty, sixty) = (found(30.0), found(60.0));
        assert!(thirty >= 22 && sixty >= 94, "{thirty} {sixty}");
    }

    /// The mean square of the coefficients of 400 simulated random walks.
    #[test]
    fn coefficients_of_a_random_walk_have_the_expected_squares() {
        let mut sums = vec![0.0; noise_shapes().len()];
        let runs = 400;
        for seed in 0..runs {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut walk = 0.0;
            let values = (0..16 * BLOCKS).map(|_| {
                walk += random.sample::<f64, _>(StandardNormal) / 4.0;
                walk
            });
            let spectrum = CosineSpectrum::new(&UniformSeries::new(1.0, values.collect())).expect("complete");
            sums.iter_mut().zip(&spectrum.squares).for_each(|(sum, square)| *sum += square / runs as f64);
        }
        // Steps of variance 1/16 at each of 16 samples: 1 per block. A square has twice the variance of its mean's square.
        for (place, (band, sum)) in bands().zip(&sums).enumerate() {
            let ratio = sum / noise_shapes()[place][2];
            assert!(
                (ratio - 1.0).abs() < 4.5 * (2.0 / (runs as usize * band.len()) as f64).sqrt(),
                "{band:?}: {ratio}"
            );
        }
    }
}
