//! A Markov process that several channels share, from the spectra of their mean and of what they are beside it.
//!
//! The latter has nothing of what all share alike, and as much of their own noise as the mean: it tells what the mean would
//! be without the process, whatever their own noise is.

use super::mixture;
use super::shape::Band;
use super::tapered::{Tapered, ranges};
use crate::grid::Grid;
use crate::trace::normal::NORMAL_975;
use std::f64::consts::PI;

/// White, flicker and random-walk noise, a process of each channel's own, and the one that is shared.
const TERMS: usize = 5;
/// Time constants that are tried: the shortest in samples, the longest as part of the record, the factor between.
const SHORTEST: f64 = 16.0;
const LONGEST: f64 = 0.5;
const FACTOR: f64 = 1.25;
/// Of these, every so many are enough to tell whether anything is shared.
const COARSE: usize = 3;
/// Highest frequency, as part of the sample rate.
const HIGHEST: f64 = 0.02;
/// Information below which nothing is known of the variance.
const LEAST_INFORMATION: f64 = 1e-2;
/// Fewest bands that tell four densities and a time.
const FEWEST_BANDS: usize = 16;

/// What channels share: likeliest values with 95 % bounds.
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

/// Transforms of the channels that may share something.
pub struct Transforms {
    sample_period: f64,
    duration: f64,
    channels: Vec<Tapered>,
}

impl Transforms {
    /// `None` of nothing, or if the samples differ.
    #[must_use]
    pub fn of(channels: &[Grid]) -> Option<Self> {
        let first = channels.first()?;
        let transformed: Option<Vec<Tapered>> =
            channels.iter().map(|channel| Tapered::of(&channel.detrended())).collect();
        let channels = transformed?;
        channels.iter().all(|channel| channel.length == channels[0].length).then(|| Self {
            sample_period: first.sample_period(),
            duration: first.duration(),
            channels,
        })
    }

    /// Of the sets of two and more channels the one that most clearly shares something: its members, and by how much the
    /// spectra are likelier if they do, in ln likelihood.
    #[must_use]
    pub fn clearest(&self) -> Option<(Vec<usize>, f64)> {
        let sets = (1..1usize << self.channels.len()).filter(|set| set.count_ones() > 1);
        let of = |set: usize| {
            let members: Vec<usize> = (0..self.channels.len()).filter(|member| set >> member & 1 == 1).collect();
            self.likeliest(&members).map(|(gain, _)| (members, gain))
        };
        sets.filter_map(of).max_by(|(_, a), (_, b)| a.total_cmp(b))
    }

    /// The gain of `members` under the likeliest signs, and their bands: the first rises, each of the others may fall.
    fn likeliest(&self, members: &[usize]) -> Option<(f64, Vec<Band>)> {
        let signs = (0..1usize << members.len().saturating_sub(1)).map(|falls| falls << 1);
        let bands = signs.filter_map(|falls| self.bands(members, falls));
        bands.map(|bands| (self.gain(&bands), bands)).max_by(|(a, _), (b, _)| a.total_cmp(b))
    }

    /// The Markov process that makes the spectra of `members` likeliest; `None` if the samples are too few.
    #[must_use]
    pub fn markov(&self, members: &[usize]) -> Option<Shared> {
        let (_, bands) = self.likeliest(members)?;
        let fits: Vec<Fit> =
            self.time_constants().map(|time| Fit::of(&bands, self.sample_period, time, &[SHARED])).collect();
        Shared::of(&fits)
    }

    /// Bands of the mean, which has the process, and then of the rest. Those `members` fall that have their bit in `falls`.
    fn bands(&self, members: &[usize], falls: usize) -> Option<Vec<Band>> {
        let resolution = self.channels[0].resolution();
        let ranges: Vec<_> = ranges((HIGHEST / self.sample_period / resolution) as usize).collect();
        let signed: Vec<(&Tapered, f64)> = members
            .iter()
            .enumerate()
            .map(|(at, &member)| (&self.channels[member], if falls >> at & 1 == 1 { -1.0 } else { 1.0 }))
            .collect();
        let count = members.len() as f64;
        let (mut of_mean, mut of_rest) = (Vec::new(), Vec::new());
        for range in &ranges {
            let sum = |of: &dyn Fn(usize) -> f64| range.clone().map(of).sum::<f64>() / range.len() as f64;
            let each = sum(&|at| signed.iter().map(|(channel, _)| channel.common(channel, at)).sum());
            let mean = sum(&|at| {
                let with = |(a, sign): &(&Tapered, f64)| -> f64 {
                    signed.iter().map(|(b, other)| sign * other * a.common(b, at)).sum()
                };
                signed.iter().map(with).sum::<f64>() / (count * count)
            });
            let frequency = resolution * (range.start + range.end - 1) as f64 / 2.0;
            let ordinates = range.len() as f64;
            of_mean.push(Band { frequency, density: mean, ordinates });
            let density = (each - count * mean) / (count * (count - 1.0));
            of_rest.push(Band { frequency, density, ordinates: ordinates * (count - 1.0) });
        }
        let bands = [of_mean, of_rest].concat();
        (ranges.len() >= FEWEST_BANDS && bands.iter().all(|band| band.density > 0.0)).then_some(bands)
    }

    /// By how much the bands are likelier with a process that is shared than without.
    fn gain(&self, bands: &[Band]) -> f64 {
        let least = |terms: &[usize]| {
            let fits = self.time_constants().step_by(COARSE);
            fits.map(|time| Fit::of(bands, self.sample_period, time, terms).objective).fold(f64::INFINITY, f64::min)
        };
        least(&[OWN]) - least(&[OWN, SHARED])
    }

    /// Time constants to be tried, s.
    fn time_constants(&self) -> impl Iterator<Item = f64> {
        let longest = LONGEST * self.duration;
        std::iter::successors(Some(SHORTEST * self.sample_period), |time| Some(time * FACTOR))
            .take_while(move |&time| time < longest)
    }
}

impl Shared {
    fn of(fits: &[Fit]) -> Option<Self> {
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
}

/// The likeliest noise and process of a time constant.
struct Fit {
    time: f64,
    variance: f64,
    /// Relative standard deviation of the variance, the rest being known.
    error: f64,
    objective: f64,
}

/// Terms that a fit may have or not.
const OWN: usize = 3;
const SHARED: usize = 4;

impl Fit {
    /// To the bands of the mean and then of the rest, with N, B, K and `terms`.
    fn of(bands: &[Band], sample_period: f64, time: f64, terms: &[usize]) -> Self {
        let basis = |(at, band): (usize, &Band)| {
            let [white, flicker, walk, process] = basis(band.frequency, sample_period, time);
            let own = if terms.contains(&OWN) { process } else { 0.0 };
            let shared = if terms.contains(&SHARED) && at < bands.len() / 2 { process } else { 0.0 };
            [white, flicker, walk, own, shared]
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

/// One-sided densities: of white noise and 1/f at 1, of a walk, and of a process of variance 1 with this time constant.
fn basis(frequency: f64, sample_period: f64, time: f64) -> [f64; 4] {
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
            let transforms = Transforms::of(&[Grid::new(0.1, a), Grid::new(0.1, b)]).unwrap();
            let shared = transforms.markov(&[0, 1]).unwrap();
            let covers = |of: Bounded, truth: f64| usize::from((of.low..=of.high).contains(&truth));
            inside += covers(shared.deviation, 0.5) + covers(shared.time_constant, 20.0);
            // 4,000 s are 100 correlation times: the deviation is known to some 7 %, the time to some 15 %.
            assert!((shared.deviation.value / 0.5).ln().abs() < 0.25, "{seed}: {shared:?}");
            assert!((shared.time_constant.value / 20.0).ln().abs() < 0.5, "{seed}: {shared:?}");
        }
        // 95 % of 16: 11 or fewer would be a chance of one in ten thousand.
        assert!(inside >= 12, "{inside}");
    }

    #[test]
    fn what_is_shared_is_found_among_those_that_share_it() {
        let transforms = |seed: u64, weights: [f64; 3]| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let kept = (-0.1f64 / 20.0).exp();
            let (mut process, mut channels) = (0.0, [const { Vec::new() }; 3]);
            for _ in 0..8_000 {
                let mut normal = || random.sample::<f64, _>(StandardNormal);
                process = kept * process + 0.4 * (1.0 - kept * kept).sqrt() * normal();
                for (channel, weight) in channels.iter_mut().zip(weights) {
                    channel.push(weight * process + normal());
                }
            }
            Transforms::of(&channels.map(|values| Grid::new(0.1, values))).unwrap()
        };
        let (members, gain) = transforms(1, [1.0, -1.0, 1.0]).clearest().unwrap();
        assert!(members == [0, 1, 2] && gain > 20.0, "{members:?} {gain}");
        let (members, gain) = transforms(2, [1.0, 0.0, 1.0]).clearest().unwrap();
        assert!(members == [0, 2] && gain > 15.0, "{members:?} {gain}");
        // One that has it alone shares nothing.
        for (seed, weights) in [(3, [0.0; 3]), (4, [5.0, 0.0, 0.0])] {
            let gain = transforms(seed, weights).clearest().unwrap().1;
            assert!(gain < 5.0, "{seed}: {gain}");
        }
    }
}
