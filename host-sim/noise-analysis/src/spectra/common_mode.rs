//! Common-mode drift: a Markov process that several channels share, by the spectra of their mean and of their differences.
//!
//! The differences from the mean do not contain what all channels share alike, and their noise, scaled, has the same
//! spectrum as the noise of the mean. So they give the spectrum that the mean would have without the shared process,
//! whatever the noise of the channels is.

use super::periodogram::{SineTapered, low_frequency_bands};
use super::smooth_shape::{SpectralBand, fit_mixture, mixture_density, walk_amplitude, whittle_objective};
use crate::distributions::NORMAL_975;
use crate::findings::BoundedEstimate;
use crate::uniform_series::UniformSeries;
use std::f64::consts::PI;

/// White, flicker and random-walk noise, a Markov process of each channel's own, and the shared one.
const TERMS: usize = 5;
/// Time constants that are tried: the shortest in samples, the longest as a fraction of the record, and the factor from one
/// to the next.
const SHORTEST: f64 = 16.0;
const LONGEST: f64 = 0.5;
const FACTOR: f64 = 1.25;
/// The test whether anything is shared tries only every third time constant.
const COARSE: usize = 3;
/// Highest frequency, as a fraction of the sample rate.
const HIGHEST: f64 = 0.02;
/// Least Fisher information on the logarithm of the variance; keeps its standard deviation at 10 or below.
const LEAST_INFORMATION: f64 = 1e-2;
/// Fewest bands for a fit of four densities and a time constant.
const FEWEST_BANDS: usize = 16;

/// A Markov process that channels share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CommonModeDrift {
    /// Standard deviation, in the unit of the channels.
    pub deviation: BoundedEstimate,
    /// Correlation time, s.
    pub time_constant: BoundedEstimate,
}

/// Fourier transforms of channels that may share a process, all of one length.
pub(crate) struct CrossSpectra {
    sample_period: f64,
    duration: f64,
    channels: Vec<SineTapered>,
}

impl CrossSpectra {
    /// Transforms the channels; `None` if there are none, or if their lengths differ.
    #[must_use]
    pub(crate) fn new(channels: &[UniformSeries]) -> Option<Self> {
        let first = channels.first()?;
        let transformed: Option<Vec<SineTapered>> =
            channels.iter().map(|channel| SineTapered::new(&channel.detrended())).collect();
        let channels = transformed?;
        channels.iter().all(|channel| channel.length == channels[0].length).then(|| Self {
            sample_period: first.sample_period(),
            duration: first.duration(),
            channels,
        })
    }

    /// The set of two or more channels for which a shared process gains most ln likelihood: its members, and the gain.
    #[must_use]
    pub(crate) fn most_likely_set(&self) -> Option<(Vec<usize>, f64)> {
        let sets = (1..1usize << self.channels.len()).filter(|set| set.count_ones() > 1);
        let gain = |set: usize| {
            let members: Vec<usize> = (0..self.channels.len()).filter(|member| set >> member & 1 == 1).collect();
            self.likeliest_signs(&members).map(|(gain, _)| (members, gain))
        };
        sets.filter_map(gain).max_by(|(_, a), (_, b)| a.total_cmp(b))
    }

    /// The gain of `members` under the likeliest signs of the shared process, and their bands. The sign of the first member
    /// is positive.
    fn likeliest_signs(&self, members: &[usize]) -> Option<(f64, Vec<SpectralBand>)> {
        let signs = (0..1usize << members.len().saturating_sub(1)).map(|negative| negative << 1);
        let bands = signs.filter_map(|negative| self.bands(members, negative));
        bands.map(|bands| (self.gain(&bands), bands)).max_by(|(a, _), (b, _)| a.total_cmp(b))
    }

    /// The shared Markov process that makes the spectra of `members` likeliest; `None` if the samples are too few.
    #[must_use]
    pub(crate) fn fit_markov(&self, members: &[usize]) -> Option<CommonModeDrift> {
        let (_, bands) = self.likeliest_signs(members)?;
        let fits: Vec<ProcessFit> =
            self.time_constants().map(|time| ProcessFit::new(&bands, self.sample_period, time, &[SHARED])).collect();
        CommonModeDrift::from_fits(&fits)
    }

    /// Bands of the mean, which contains the process, followed by those of the differences. The sign of a member is negative
    /// where its bit in `negative` is set.
    fn bands(&self, members: &[usize], negative: usize) -> Option<Vec<SpectralBand>> {
        let resolution = self.channels[0].resolution();
        let ranges: Vec<_> = low_frequency_bands((HIGHEST / self.sample_period / resolution) as usize).collect();
        let signed: Vec<(&SineTapered, f64)> = members
            .iter()
            .enumerate()
            .map(|(at, &member)| (&self.channels[member], if negative >> at & 1 == 1 { -1.0 } else { 1.0 }))
            .collect();
        let count = members.len() as f64;
        let (mut of_mean, mut of_differences) = (Vec::new(), Vec::new());
        for range in &ranges {
            let average = |of: &dyn Fn(usize) -> f64| range.clone().map(of).sum::<f64>() / range.len() as f64;
            let each = average(&|at| signed.iter().map(|(channel, _)| channel.cross_density(channel, at)).sum());
            let mean = average(&|at| {
                let with = |(a, sign): &(&SineTapered, f64)| -> f64 {
                    signed.iter().map(|(b, other)| sign * other * a.cross_density(b, at)).sum()
                };
                signed.iter().map(with).sum::<f64>() / (count * count)
            });
            let frequency = resolution * (range.start + range.end - 1) as f64 / 2.0;
            let ordinates = range.len() as f64;
            of_mean.push(SpectralBand { frequency, density: mean, ordinates });
            let density = (each - count * mean) / (count * (count - 1.0));
            of_differences.push(SpectralBand { frequency, density, ordinates: ordinates * (count - 1.0) });
        }
        let bands = [of_mean, of_differences].concat();
        (ranges.len() >= FEWEST_BANDS && bands.iter().all(|band| band.density > 0.0)).then_some(bands)
    }

    /// Gain in ln likelihood of the bands by a shared process.
    fn gain(&self, bands: &[SpectralBand]) -> f64 {
        let least = |terms: &[usize]| {
            let fits = self.time_constants().step_by(COARSE);
            fits.map(|time| ProcessFit::new(bands, self.sample_period, time, terms).objective)
                .fold(f64::INFINITY, f64::min)
        };
        least(&[OWN]) - least(&[OWN, SHARED])
    }

    /// Time constants that are tried, s.
    fn time_constants(&self) -> impl Iterator<Item = f64> {
        let longest = LONGEST * self.duration;
        std::iter::successors(Some(SHORTEST * self.sample_period), |time| Some(time * FACTOR))
            .take_while(move |&time| time < longest)
    }
}

impl CommonModeDrift {
    fn from_fits(fits: &[ProcessFit]) -> Option<Self> {
        let likeliest = fits.iter().min_by(|a, b| a.objective.total_cmp(&b.objective))?;
        // Mean and standard deviation over all time constants, weighted by their likelihood: in a record of few correlation
        // times, time constant and variance are uncertain together.
        let weighted = |value: &dyn Fn(&ProcessFit) -> f64| {
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
        Some(Self {
            deviation: bounded(likeliest.variance.sqrt(), (deviation, of_deviation.hypot(alone))),
            // Between two of the time constants that were tried all are equally likely: factor/√12.
            time_constant: bounded(likeliest.time, (time, of_time.hypot(FACTOR.ln() / 12f64.sqrt()))),
        })
    }
}

/// `value` with bounds by mean and standard deviation of its logarithm.
fn bounded(value: f64, (mean, deviation): (f64, f64)) -> BoundedEstimate {
    let half = NORMAL_975 * deviation;
    BoundedEstimate { value, low: (mean - half).exp().min(value), high: (mean + half).exp().max(value) }
}

/// The likeliest noise and processes for one time constant.
struct ProcessFit {
    time: f64,
    variance: f64,
    /// Relative standard deviation of the variance, all else being known.
    error: f64,
    objective: f64,
}

/// Indices of the terms that a fit includes or not.
const OWN: usize = 3;
const SHARED: usize = 4;

impl ProcessFit {
    /// Fits N, B, K and `terms` to the bands of the mean followed by those of the differences.
    fn new(bands: &[SpectralBand], sample_period: f64, time: f64, terms: &[usize]) -> Self {
        let basis = |(at, band): (usize, &SpectralBand)| {
            let [white, flicker, walk, process] = process_basis(band.frequency, sample_period, time);
            let own = if terms.contains(&OWN) { process } else { 0.0 };
            let shared = if terms.contains(&SHARED) && at < bands.len() / 2 { process } else { 0.0 };
            [white, flicker, walk, own, shared]
        };
        let bases: Vec<[f64; TERMS]> = bands.iter().enumerate().map(basis).collect();
        let mut densities = [0.0; TERMS];
        fit_mixture(bands, &bases, &mut densities);
        let totals: Vec<f64> = bases.iter().map(|basis| mixture_density(basis, &densities)).collect();
        let variance = densities[TERMS - 1];
        let fraction = |(basis, total): (&[f64; TERMS], &f64)| basis[TERMS - 1] * variance / total;
        let fractions = bases.iter().zip(&totals).map(fraction);
        let information: f64 = fractions.zip(bands).map(|(fraction, band)| band.ordinates * fraction * fraction).sum();
        Self {
            time,
            variance,
            error: information.max(LEAST_INFORMATION).sqrt().recip(),
            objective: whittle_objective(bands, &totals),
        }
    }
}

/// One-sided densities: 1 of white noise, 1/f and a sampled random walk, which are 1 at 1 Hz, and of a Markov process of
/// variance 1 with this time constant.
fn process_basis(frequency: f64, sample_period: f64, time: f64) -> [f64; 4] {
    let walk = walk_amplitude(frequency, sample_period);
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
    fn measures_the_process_that_two_channels_share() {
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
            let transforms = CrossSpectra::new(&[UniformSeries::new(0.1, a), UniformSeries::new(0.1, b)]).unwrap();
            let shared = transforms.fit_markov(&[0, 1]).unwrap();
            let covers = |of: BoundedEstimate, truth: f64| usize::from((of.low..=of.high).contains(&truth));
            inside += covers(shared.deviation, 0.5) + covers(shared.time_constant, 20.0);
            // 4,000 s are 100 correlation times: the deviation is known to some 7 %, the time to some 15 %.
            assert!((shared.deviation.value / 0.5).ln().abs() < 0.25, "{seed}: {shared:?}");
            assert!((shared.time_constant.value / 20.0).ln().abs() < 0.5, "{seed}: {shared:?}");
        }
        // 95 % of 16 are expected; 11 or fewer have a probability of one in ten thousand.
        assert!(inside >= 12, "{inside}");
    }

    #[test]
    fn finds_the_channels_that_share_a_process() {
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
            CrossSpectra::new(&channels.map(|values| UniformSeries::new(0.1, values))).unwrap()
        };
        let (members, gain) = transforms(1, [1.0, -1.0, 1.0]).most_likely_set().unwrap();
        assert!(members == [0, 1, 2] && gain > 20.0, "{members:?} {gain}");
        let (members, gain) = transforms(2, [1.0, 0.0, 1.0]).most_likely_set().unwrap();
        assert!(members == [0, 2] && gain > 15.0, "{members:?} {gain}");
        // Without a process, and with one in a single channel.
        for (seed, weights) in [(3, [0.0; 3]), (4, [5.0, 0.0, 0.0])] {
            let gain = transforms(seed, weights).most_likely_set().unwrap().1;
            assert!(gain < 5.0, "{seed}: {gain}");
        }
    }
}
