//! Common-mode drift: a Markov process that several channels share.
//!
//! Differences from the mean lack what is shared; their scaled noise spectrum is that of the mean without the shared
//! process.

use super::markov_spectrum::{MarkovEstimate, MarkovFit, OWN, SHARED, TERMS, most_likely, time_constants};
use super::periodogram::{SineTapered, low_frequency_bands};
use super::smooth_shape::walk_amplitude;
use super::whittle::SpectralBand;
use crate::samples::uniform_series::UniformSeries;
use std::f64::consts::PI;

/// Samples per mean; at [`HIGHEST`] it lowers a density by 2 %.
const BLOCK: usize = 4;
/// Highest frequency over the block rate, and over 1/(length of the impulse response).
const HIGHEST: f64 = 0.08;
const HIGHEST_BY_FILTER: f64 = 0.25;
/// Shortest time constant, in lengths of the impulse response, which correlates neighbours.
const FILTER_LENGTHS: f64 = 4.0;
/// Fewest bands for a fit of four densities and a time constant.
const FEWEST_BANDS: usize = 16;
/// Time constants: the shortest in blocks, the longest as a fraction of the record.
const SHORTEST: f64 = 4.0;
const LONGEST: f64 = 0.5;
/// Most channels of which all sets with all signs are tried: 36.
const MOST_TOGETHER: usize = 4;
/// Ways in which three channels can share a process.
const WAYS_OF_THREE: f64 = 10.0;
/// Stride over the time constants in the test for anything shared.
const COARSE: usize = 3;

/// Fourier transforms of channels, of one length.
pub(crate) struct CrossSpectra {
    /// Block period, s.
    period: f64,
    duration: f64,
    /// Length of the channels' impulse response, s.
    filter_length: f64,
    channels: Vec<SineTapered>,
}

impl CrossSpectra {
    /// `filter_length` of the impulse response in s; `None` without channels, or for different lengths.
    #[must_use]
    pub(crate) fn new(channels: &[UniformSeries], filter_length: f64) -> Option<Self> {
        let first = channels.first()?;
        let transformed: Option<Vec<SineTapered>> =
            channels.iter().map(|channel| SineTapered::new(&channel.detrended().averaged(BLOCK))).collect();
        let channels = transformed?;
        channels.iter().all(|channel| channel.length == channels[0].length).then(|| Self {
            period: BLOCK as f64 * first.sample_period(),
            duration: first.duration(),
            filter_length,
            channels,
        })
    }

    /// The set of channels whose shared process gains most, with the gain less ln of the ways over those of three.
    #[must_use]
    pub(crate) fn most_likely_set(&self) -> Option<(Vec<usize>, f64)> {
        let count = self.channels.len();
        let mut tried = 0;
        let mut gain = |members: Vec<usize>| {
            tried += signs(&members);
            self.likeliest_signs(&members).map(|(gain, _)| (members, gain))
        };
        let mut likeliest =
            |sets: Vec<Vec<usize>>| sets.into_iter().filter_map(&mut gain).max_by(|(_, a), (_, b)| a.total_cmp(b));
        let best = if count <= MOST_TOGETHER {
            let members = |set: usize| (0..count).filter(|member| set >> member & 1 == 1).collect();
            likeliest((1..1usize << count).filter(|set| set.count_ones() > 1).map(members).collect())
        } else {
            let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| vec![a, b]));
            let mut best = likeliest(pairs.collect());
            while let Some((members, gain)) = &best {
                let others = (0..count).filter(|other| !members.contains(other));
                let with = |other: usize| [&members[..], &[other]].concat();
                let larger = likeliest(others.map(with).collect()).filter(|(_, of)| of > gain);
                if larger.is_none() {
                    break;
                }
                best = larger;
            }
            best
        };
        let (mut members, gain) = best?;
        members.sort_unstable();
        Some((members, gain - (tried as f64 / WAYS_OF_THREE).max(1.0).ln()))
    }

    /// Gain of `members` under the likeliest signs, of which the first is positive, with their bands.
    fn likeliest_signs(&self, members: &[usize]) -> Option<(f64, Vec<SpectralBand>)> {
        let of_pair = |(at, &member): (usize, &usize)| {
            let pair = [members[0], member];
            let gain = |negative| self.bands(&pair, negative).map_or(f64::NEG_INFINITY, |bands| self.gain(&bands));
            if gain(2) > gain(0) { 1 << at } else { 0 }
        };
        let signs: Vec<usize> = if members.len() <= MOST_TOGETHER {
            (0..signs(members)).map(|negative| negative << 1).collect()
        } else {
            vec![members.iter().enumerate().skip(1).map(of_pair).sum()]
        };
        let bands = signs.into_iter().filter_map(|negative| self.bands(members, negative));
        bands.map(|bands| (self.gain(&bands), bands)).max_by(|(a, _), (b, _)| a.total_cmp(b))
    }

    /// The likeliest Markov process that `members` share; `None` for too few samples.
    #[must_use]
    pub(crate) fn fit_markov(&self, members: &[usize]) -> Option<MarkovEstimate> {
        let (_, bands) = self.likeliest_signs(members)?;
        let without = self.fit(&bands, self.period, Processes { own: false, shared: false });
        let shared = Processes { own: false, shared: true };
        let fits: Vec<MarkovFit> = self.time_constants().map(|time| self.fit(&bands, time, shared)).collect();
        most_likely(&fits, without.objective)
    }

    /// Bands of the mean, which contains the process, then of the differences; bits of `negative` are negative signs.
    fn bands(&self, members: &[usize], negative: usize) -> Option<Vec<SpectralBand>> {
        let resolution = self.channels[0].resolution();
        let highest = (HIGHEST / self.period).min(HIGHEST_BY_FILTER / self.filter_length);
        let ranges: Vec<_> = low_frequency_bands((highest / resolution) as usize).collect();
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

    fn gain(&self, bands: &[SpectralBand]) -> f64 {
        let least = |shared: bool| {
            let fits = self.time_constants().step_by(COARSE);
            fits.map(|time| self.fit(bands, time, Processes { own: true, shared }).objective)
                .fold(f64::INFINITY, f64::min)
        };
        least(false) - least(true)
    }

    fn time_constants(&self) -> impl Iterator<Item = f64> {
        let shortest = (SHORTEST * self.period).max(FILTER_LENGTHS * self.filter_length);
        time_constants(shortest, LONGEST * self.duration)
    }

    /// Fits N, B, K, shared white noise and processes of time constant `time` to the bands.
    fn fit(&self, bands: &[SpectralBand], time: f64, processes: Processes) -> MarkovFit {
        let basis = |(at, band): (usize, &SpectralBand)| {
            let [white, flicker, walk, process] = shapes(band.frequency, self.period, time);
            let own = if processes.own { process } else { 0.0 };
            let is_of_mean = at < bands.len() / 2;
            let shared = if processes.shared && is_of_mean { process } else { 0.0 };
            // Shared white noise is no drift.
            let shared_white = if is_of_mean { white } else { 0.0 };
            [white, flicker, walk, own, shared, shared_white]
        };
        let bases: Vec<[f64; TERMS]> = bands.iter().enumerate().map(basis).collect();
        MarkovFit::new(bands, &bases, time, if processes.shared { SHARED } else { OWN })
    }
}

/// Number of sign patterns to try; the first member's sign is positive.
fn signs(members: &[usize]) -> usize {
    if members.len() <= MOST_TOGETHER { 1 << members.len().saturating_sub(1) } else { 1 }
}

#[derive(Clone, Copy)]
struct Processes {
    own: bool,
    shared: bool,
}

/// One-sided densities: white noise of 1; 1/f and a sampled walk, 1 at 1 Hz; a Markov process of variance 1.
fn shapes(frequency: f64, period: f64, time: f64) -> [f64; 4] {
    let walk = walk_amplitude(frequency, period);
    let kept = (-period / time).exp();
    let turn = (2.0 * PI * frequency * period).cos();
    let markov = 2.0 * period * (1.0 - kept * kept) / (1.0 - 2.0 * kept * turn + kept * kept);
    [1.0, 1.0 / frequency, walk * walk, markov]
}

#[cfg(test)]
mod tests {
    use super::CrossSpectra;
    use crate::bounds::BoundedEstimate;
    use crate::samples::uniform_series::UniformSeries;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// White noise of deviation 1 at 10 Hz, and a shared process of deviation 0.5.
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
            let transforms = CrossSpectra::new(&[UniformSeries::new(0.1, a), UniformSeries::new(0.1, b)], 0.0).unwrap();
            let shared = transforms.fit_markov(&[0, 1]).unwrap();
            let covers = |of: BoundedEstimate, truth: f64| usize::from((of.low..=of.high).contains(&truth));
            inside += covers(shared.deviation, 0.5) + covers(shared.time_constant, 20.0);
            // 100 correlation times: the deviation is known to 7 %, the time to 15 %.
            assert!((shared.deviation.value / 0.5).ln().abs() < 0.25, "{seed}: {shared:?}");
            assert!((shared.time_constant.value / 20.0).ln().abs() < 0.5, "{seed}: {shared:?}");
        }
        // 95 % of 16; 11 or fewer have a probability of 10⁻⁴.
        assert!(inside >= 12, "{inside}");
    }

    #[test]
    fn many_channels_share_a_process() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let kept = (-0.1f64 / 20.0).exp();
        let (mut process, mut channels) = (0.0, [const { Vec::new() }; 12]);
        for _ in 0..8_000 {
            let mut normal = || random.sample::<f64, _>(StandardNormal);
            process = kept * process + 0.4 * (1.0 - kept * kept).sqrt() * normal();
            for (number, channel) in channels.iter_mut().enumerate() {
                // Every third channel lacks it; the signs of the others alternate.
                let weight = [1.0, -1.0, 0.0][number % 3];
                channel.push(weight * process + normal());
            }
        }
        let spectra = CrossSpectra::new(&channels.map(|values| UniformSeries::new(0.1, values)), 0.0).unwrap();
        let (members, gain) = spectra.most_likely_set().unwrap();
        assert!(members.iter().all(|member| member % 3 < 2) && members.len() >= 6, "{members:?}");
        assert!(gain > 50.0, "{gain}");
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
            CrossSpectra::new(&channels.map(|values| UniformSeries::new(0.1, values)), 0.0).unwrap()
        };
        let (members, gain) = transforms(1, [1.0, -1.0, 1.0]).most_likely_set().unwrap();
        assert!(members == [0, 1, 2] && gain > 20.0, "{members:?} {gain}");
        let (members, gain) = transforms(2, [1.0, 0.0, 1.0]).most_likely_set().unwrap();
        assert!(members == [0, 2] && gain > 15.0, "{members:?} {gain}");
        for seed in 10..20 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut channels = [const { Vec::new() }; 3];
            for _ in 0..8_000 {
                let mut normal = || random.sample::<f64, _>(StandardNormal);
                let shared = normal();
                channels.iter_mut().for_each(|channel| channel.push(shared + normal()));
            }
            let spectra = CrossSpectra::new(&channels.map(|values| UniformSeries::new(0.1, values)), 0.0).unwrap();
            let gain = spectra.most_likely_set().unwrap().1;
            assert!(gain < 11.3, "{seed}: {gain}");
        }
        for (seed, weights) in [(3, [0.0; 3]), (4, [5.0, 0.0, 0.0])] {
            let gain = transforms(seed, weights).most_likely_set().unwrap().1;
            assert!(gain < 5.0, "{seed}: {gain}");
        }
    }

    /// White noise behind two moving averages of 64 samples over 450 s; then with a shared process of 40 s.
    #[test]
    fn a_filter_is_nothing_that_channels_share() {
        const TAPS: usize = 64;
        const PERIOD_S: f64 = 1.0 / 204.8;
        let averaged = |values: Vec<f64>| -> Vec<f64> {
            let mut sum: f64 = values[..TAPS].iter().sum();
            let next = |at: usize| {
                sum += values[at + TAPS] - values[at];
                sum / TAPS as f64
            };
            (0..values.len() - TAPS).map(next).collect()
        };
        let gain = |seed: u64, shared: f64| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let kept = (-PERIOD_S / 40.0).exp();
            let mut state = 0.0;
            let process: Vec<f64> = (0..92_160)
                .map(|_| {
                    state = kept * state + (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
                    shared * state
                })
                .collect();
            let channels = [0.3, 1.0, 1.1].map(|level| {
                let white = process.iter().map(|process| process + level * random.sample::<f64, _>(StandardNormal));
                UniformSeries::new(PERIOD_S, averaged(averaged(white.collect())))
            });
            let length = 2.0 * TAPS as f64 * PERIOD_S;
            CrossSpectra::new(&channels, length).unwrap().most_likely_set().unwrap().1
        };
        for seed in 0..4 {
            let (alone, together) = (gain(seed, 0.0), gain(seed, 0.3));
            assert!(alone < 5.0 && together > 15.0, "{seed}: {alone} {together}");
        }
    }
}
