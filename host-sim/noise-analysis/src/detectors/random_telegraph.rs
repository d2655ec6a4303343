//! Random telegraph noise: jumps to and fro between two levels at random times.
//!
//! The likelihood of a hidden Markov chain of two states is compared with that of a Gaussian process of the same
//! spectrum, on means of equal parts.

use super::telegraph_models::{TwoStateChain, gauss_markov_log_likelihood, white_log_likelihood};
use crate::bounds::BoundedEstimate;
use crate::distributions::{NORMAL_975, quantile};
use crate::effects::findings::{REFUTED, TOLD_APART};
use crate::effects::{Spikes, TelegraphEvidence, TelegraphNoise};
use crate::robust::deviation_from_zero;
use crate::samples::uniform_series::UniformSeries;

/// Numbers of parts: few for long correlation times, many for short ones.
const PARTS: [usize; 3] = [256, 1024, 4096];
/// Most useful parts per correlation time, if the Allan curve shows one.
const RESOLVED: f64 = 20.0;
/// Least gain of the two levels in ln likelihood; probability below e⁻¹² without them.
const LEAST_GAIN: f64 = 12.0;
/// Most parts in which two levels are compared with a Gaussian process: 3,000 correlation times.
const COMPARED_PARTS: usize = 1 << 16;
/// Length of a part in responses of the filter: the means of neighbouring parts of white noise behind two equal averages then correlate by
/// 0.02, which either process imitates.
const FILTER_LENGTHS: f64 = 4.0;
/// Fewest jumps; one or two are steps of the bias.
const FEWEST_JUMPS: f64 = 6.0;
const LEAST_TIME: f64 = 4.0;
const LEAST_OCCUPANCY: f64 = 0.05;
/// Largest variance around the levels, in white variances; a clipped sinusoid has ten times as much.
const WHITE_FACTOR: f64 = 1.5;
const SLOW_FRACTION: f64 = 0.01;
/// Parts of a time constant per change: a decay loses a fifth.
const PER_CHANGE: f64 = 4.0;

/// Looks for telegraph noise in a channel with the given unit. `correlation_times` are those that its Allan curve has shown, in s.
pub(crate) fn find(series: &UniformSeries, unit: &'static str, correlation_times: &[f64]) -> Option<TelegraphNoise> {
    let samples = series.values().len();
    let known = correlation_times.iter().map(|time| ((time / RESOLVED / series.sample_period()) as usize).max(1));
    let coarse = PARTS.iter().map(|parts| samples / parts).filter(|&size| size > 0);
    let mut sizes: Vec<usize> = coarse.chain(known).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let mut found = None;
    for size in sizes.into_iter().rev() {
        let parts = PartMeans::new(series, size);
        let Some((chain, gain)) = fit(&parts) else { continue };
        if !stays_at_levels(&chain, &parts) {
            return None;
        }
        let part_s = size as f64 * series.sample_period();
        let resolved = chain.correlation_time() > RESOLVED;
        found = Some(telegraph_noise(&chain, gain, part_s, unit));
        if resolved {
            break;
        }
    }
    found
}

/// The law of a process whose covariance is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Law {
    Gaussian,
    TwoLevels {
        jumps: f64,
        /// In ln likelihood over a Gaussian process.
        gain: f64,
        /// Distance of the levels in standard deviations of the process: 2 if they are equally frequent.
        distance: f64,
    },
}

impl Law {
    /// The law of a process with about this standard deviation and this correlation time, in s. Its white noise is behind a filter whose response
    /// lasts `filter_s` seconds, or behind none. A Gaussian process has to be [`TOLD_APART`] times as likely. Two levels need [`LEAST_GAIN`], as
    /// they do if they are sought: outliers are nearer to levels than to a Gaussian process.
    pub(crate) fn of_process(
        series: &UniformSeries,
        deviation: f64,
        time_constant: f64,
        filter_s: f64,
    ) -> Option<Self> {
        let part_s = (time_constant / RESOLVED).max(FILTER_LENGTHS * filter_s);
        let size = ((part_s / series.sample_period()) as usize).max(1);
        let mut parts = PartMeans::new(series, size);
        parts.means.truncate(COMPARED_PARTS);
        let steps = time_constant / (size as f64 * series.sample_period());
        let chain = TwoStateChain::fit_near(&parts.means, deviation, steps)?;
        let gain = chain.log_likelihood - gauss_markov_log_likelihood(&parts.means);
        if -gain > TOLD_APART.ln() {
            return Some(Self::Gaussian);
        }
        let are_levels = gain > LEAST_GAIN && is_two_levels(&chain) && stays_at_levels(&chain, &parts);
        let distance = chain.occupancy().iter().product::<f64>().sqrt().recip();
        are_levels.then_some(Self::TwoLevels { jumps: chain.jumps, gain, distance })
    }
}

/// True if a series changes upwards as it changes downwards, as random telegraph noise and every Gaussian process do, over a
/// quarter of `time_constant` s. Disturbances that begin at once and decay do not.
///
/// In a process that is the same when time runs backwards the changes are symmetrical, so that the sum of their cubes over the root of the
/// sum of their sixth powers is about a standard normal number; neighbouring changes have correlations below 0, which lower it.
pub(crate) fn is_reversible(series: &UniformSeries, time_constant: f64) -> bool {
    let size = ((time_constant / PER_CHANGE / series.sample_period()) as usize).max(1);
    let means = PartMeans::new(series, size).means;
    let changes = means.windows(2).map(|pair| pair[1] - pair[0]).filter(|change| change.is_finite());
    let (cubes, sixths) = changes.fold((0.0_f64, 0.0_f64), |(cubes, sixths), change| {
        let cube = change.powi(3);
        (cubes + cube, sixths + cube * cube)
    });
    sixths <= 0.0 || cubes.abs() < quantile(0.5 * REFUTED) * sixths.sqrt()
}

/// True if visits to a level of `telegraph` noise that last no longer than a sample are as frequent and as large as `spikes`. With
/// the rates `a` and `b` of the jumps up and down there are `ab` times a sample period of them a second, at most a quarter of that
/// over the square of the time constant `1/(a + b)`.
pub(crate) fn explains_spikes(telegraph: &TelegraphNoise, spikes: &Spikes, sample_period: f64) -> bool {
    let visits_per_hour =
        3600.0 * sample_period / (4.0 * telegraph.time_constant_s.low * telegraph.time_constant_s.low);
    spikes.rate_per_hour.low <= visits_per_hour && spikes.size.low <= telegraph.amplitude.high
}

/// Means of equal parts less the record's mean; `NaN` if at least half of the samples are missing.
struct PartMeans {
    means: Vec<f64>,
    white: f64,
}

impl PartMeans {
    fn new(series: &UniformSeries, size: usize) -> Self {
        let level = series.mean();
        let mean = |values: &[f64]| {
            let (sum, count) = values
                .iter()
                .filter(|value| value.is_finite())
                .fold((0.0, 0_usize), |(sum, count), value| (sum + value - level, count + 1));
            if 2 * count > values.len() { sum / count as f64 } else { f64::NAN }
        };
        let means: Vec<f64> = series.values().chunks_exact(size).map(mean).collect();
        // Differences within a part or of neighbouring parts, few of which contain a jump.
        let differences: Vec<f64> = if size > 1 {
            let halves = series.values().chunks_exact(size).map(|part| part.split_at(size / 2));
            halves.map(|(a, b)| 0.5 * (mean(a) - mean(b))).collect()
        } else {
            means.windows(2).map(|pair| (pair[1] - pair[0]) / 2f64.sqrt()).collect()
        };
        Self { means, white: robust_variance(differences) }
    }
}

/// Variance of normal numbers with the median magnitude of `values`.
fn robust_variance(values: Vec<f64>) -> f64 {
    deviation_from_zero(values.into_iter().filter(|value| value.is_finite())).powi(2)
}

/// The chain and its gain in ln likelihood over any Gaussian process; `None` if a limit is not met.
fn fit(parts: &PartMeans) -> Option<(TwoStateChain, f64)> {
    let chain = TwoStateChain::fit(&parts.means, white_log_likelihood(&parts.means) + LEAST_GAIN)?;
    let around = robust_variance(chain.residuals(&parts.means));
    if !is_two_levels(&chain) || chain.correlation_time() <= LEAST_TIME || around > largest_variance(&chain, parts) {
        return None;
    }
    let gain = chain.log_likelihood - gauss_markov_log_likelihood(&parts.means);
    (gain > LEAST_GAIN).then_some((chain.with_errors(&parts.means), gain))
}

/// Whether both levels of a chain are visited, and often.
fn is_two_levels(chain: &TwoStateChain) -> bool {
    chain.jumps >= FEWEST_JUMPS && chain.occupancy().iter().all(|&occupancy| occupancy >= LEAST_OCCUPANCY)
}

fn largest_variance(chain: &TwoStateChain, parts: &PartMeans) -> f64 {
    WHITE_FACTOR * parts.white + SLOW_FRACTION * chain.distance().powi(2)
}

/// True if the means stay constant between jumps, unlike those of decaying disturbances.
fn stays_at_levels(chain: &TwoStateChain, parts: &PartMeans) -> bool {
    let variance = largest_variance(chain, parts);
    let is_up: Vec<bool> = parts.means.iter().map(|mean| chain.is_upper(*mean)).collect();
    let (mut sums, mut first) = ([(0.0, 0.0); 2], 0);
    for visit in is_up.chunk_by(|a, b| a == b) {
        let inner = parts.means.get(first + 1..first + visit.len() - 1).unwrap_or_default();
        first += visit.len();
        let half = inner.len() / 2;
        if half == 0 || inner.iter().any(|mean| !mean.is_finite()) {
            continue;
        }
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
        let fall = mean(&inner[..half]) - mean(&inner[inner.len() - half..]);
        let weight = half as f64 / (2.0 * variance);
        let (sum, information) = &mut sums[usize::from(visit[0])];
        (*sum, *information) = (*sum + weight * fall, *information + weight);
    }
    sums.iter().all(|(sum, information)| sum.abs() <= quantile(0.25 * REFUTED) * information.sqrt())
}

fn telegraph_noise(chain: &TwoStateChain, gain: f64, part_s: f64, unit: &'static str) -> TelegraphNoise {
    let bounded = |value: f64, error: f64| {
        let factor = (NORMAL_975 * error).exp();
        BoundedEstimate::new(value, value / factor, value * factor)
    };
    let steps = chain.correlation_time();
    // One part in 2·steps contains a jump and is off its level by a quarter of the distance.
    let blurred = 0.25 / steps;
    let distance = chain.distance() / (1.0 - blurred);
    TelegraphNoise {
        time_constant_s: bounded(part_s * steps, chain.time_error),
        amplitude: bounded(distance, chain.distance_error.hypot(0.5 * blurred)).in_unit(unit),
        evidence: TelegraphEvidence::Levels { jumps: chain.jumps, gain },
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    const SAMPLES: usize = 40_000;
    pub(crate) const PERIOD_S: f64 = 0.01;

    pub(crate) fn series(seed: u64, mut next: impl FnMut(&mut ChaCha8Rng, usize) -> f64) -> UniformSeries {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let value = |at| next(&mut random, at) + random.sample::<f64, _>(StandardNormal);
        UniformSeries::new(PERIOD_S, (0..SAMPLES).map(value).collect())
    }

    fn markov(deviation: f64, time_s: f64) -> impl FnMut(&mut ChaCha8Rng, usize) -> f64 {
        let kept = (-PERIOD_S / time_s).exp();
        let mut state = 0.0;
        move |random, _| {
            state = kept * state + deviation * (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
            state
        }
    }

    pub(crate) fn telegraph(amplitude: f64, time_s: f64) -> impl FnMut(&mut ChaCha8Rng, usize) -> f64 {
        let mut up = false;
        move |random, _| {
            up ^= random.random_bool(0.5 * PERIOD_S / time_s);
            if up { amplitude } else { 0.0 }
        }
    }

    #[test]
    fn visits_of_a_sample_are_no_spikes() {
        let estimate = |value: f64| BoundedEstimate::new(value, 0.9 * value, 1.1 * value);
        let telegraph = TelegraphNoise {
            time_constant_s: estimate(0.1),
            amplitude: estimate(5.0).in_unit("deg/s"),
            evidence: TelegraphEvidence::Levels { jumps: 100.0, gain: 20.0 },
        };
        let mut up = false;
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let levels: Vec<bool> = (0..SAMPLES)
            .map(|_| {
                up ^= random.random_bool(5.0 * PERIOD_S);
                up
            })
            .collect();
        let visits = levels.windows(3).filter(|of| of[0] == of[2] && of[0] != of[1]).count();
        assert!((70..130).contains(&visits), "{visits}"); // three standard deviations of 100
        let hours = SAMPLES as f64 * PERIOD_S / 3600.0;
        let spikes = |count: f64, size: f64| Spikes {
            rate_per_hour: estimate(count / hours),
            size: estimate(size).in_unit("deg/s"),
            count: count as usize,
            threshold_sigmas: 5.0,
            largest_sigmas: 6.0,
        };
        assert!(explains_spikes(&telegraph, &spikes(visits as f64, 5.0), PERIOD_S));
        assert!(!explains_spikes(&telegraph, &spikes(2.0 * visits as f64, 5.0), PERIOD_S));
        assert!(!explains_spikes(&telegraph, &spikes(visits as f64, 8.0), PERIOD_S));
    }

    #[test]
    fn measures_distance_and_correlation_time_of_two_levels() {
        let (mut covered, mut all) = (0, 0);
        for (seed, (amplitude, time_s)) in [(1.0, 4.0), (0.7, 8.0), (50.0, 5.0), (1.5, 1.0)].into_iter().enumerate() {
            let mut series = series(seed as u64, telegraph(amplitude, time_s));
            if seed == 1 {
                let values = series.values().iter().enumerate();
                let gap = |(at, value): (usize, &f64)| if (5_000..9_000).contains(&at) { f64::NAN } else { *value };
                series = UniformSeries::new(PERIOD_S, values.map(gap).collect());
            }
            let finding = find(&series, "g", &[]).unwrap_or_else(|| panic!("{amplitude} {time_s}"));
            for (of, truth) in [(finding.amplitude.estimate(), amplitude), (finding.time_constant_s, time_s)] {
                assert!((of.value / truth).ln().abs() < 0.5, "{truth}: {of:?}");
                covered += usize::from((of.low..=of.high).contains(&truth));
                all += 1;
            }
        }
        // 95 % of the intervals hold the truth: two misses of eight have a probability of one in twenty.
        assert!(covered >= all - 2, "{covered} of {all}");
    }

    #[test]
    fn finds_short_correlation_times_that_the_curve_shows() {
        let series = series(20, telegraph(3.0, 0.1));
        let finding = find(&series, "g", &[0.1]).unwrap();
        assert!((finding.time_constant_s.value / 0.1 - 1.0).abs() < 0.2, "{finding:?}");
    }

    #[test]
    fn a_step_a_sinusoid_and_gaussian_processes_are_no_telegraph_noise() {
        let step = series(30, |_, at| if at < 15_000 { 0.0 } else { 1.0 });
        let wave = series(31, |_, at| (TAU * at as f64 * PERIOD_S / 20.0).sin());
        let mut level = 0.0;
        let walk = series(32, move |random, _| {
            level += 0.02 * random.sample::<f64, _>(StandardNormal);
            level
        });
        let markov = series(33, markov(1.0, 4.0));
        // Disturbances of size 4, 25 s apart on average, that decay within 8 s.
        let mut height = 0.0;
        let decays = series(35, move |random, _| {
            height *= (-PERIOD_S / 8.0).exp();
            if random.random_bool(PERIOD_S / 25.0) {
                height += 4.0;
            }
            height
        });
        for series in [step, wave, walk, markov, decays, series(34, |_, _| 0.0)] {
            assert_eq!(find(&series, "g", &[1.0, 4.0]), None);
        }
        assert_eq!(find(&UniformSeries::new(PERIOD_S, vec![1.0; 10]), "g", &[]), None);
        assert_eq!(find(&UniformSeries::new(PERIOD_S, vec![1.0; 10_000]), "g", &[]), None);
    }

    fn law(series: &UniformSeries, deviation: f64, time: f64, filter_s: f64) -> Option<&'static str> {
        Some(match Law::of_process(series, deviation, time, filter_s)? {
            Law::Gaussian => "Gaussian",
            Law::TwoLevels { .. } => "levels",
        })
    }

    /// Over 400 to 4,000 correlation times the kurtosis is known to 0.2 at best.
    #[test]
    fn two_levels_are_told_from_a_gaussian_process_of_the_same_spectrum() {
        for time in [0.1, 0.3, 1.0] {
            for seed in 0..5 {
                assert_eq!(law(&series(seed, markov(0.4, time)), 0.4, time, 0.0), Some("Gaussian"), "{time} {seed}");
                let levels = Law::of_process(&series(seed, telegraph(0.8, time)), 0.4, time, 0.0);
                let Some(Law::TwoLevels { distance, .. }) = levels else { panic!("{time} {seed}: {levels:?}") };
                assert!((distance / 2.0 - 1.0).abs() < 0.1, "{time} {seed}: {distance}");
            }
        }
    }

    /// White noise of deviation 1 behind two averages over four samples, and a process that the filter passes, over 400 time constants or more.
    /// One of 19 is mistaken at most: of 60, more than 10 have a probability of one in 2,000.
    #[test]
    fn two_levels_are_told_from_a_gaussian_process_behind_a_filter() {
        let averaged = |of: &[f64]| -> Vec<f64> { of.windows(4).map(|of| of.iter().sum::<f64>() / 4.0).collect() };
        let filtered = |series: UniformSeries| UniformSeries::new(PERIOD_S, averaged(&averaged(series.values())));
        let mut counts = [[0; 2]; 2];
        for time in [0.3, 0.6, 1.0] {
            for seed in 100..120 {
                let all = [series(seed, markov(0.4, time)), series(seed, telegraph(0.8, time))];
                for (counts, series) in counts.iter_mut().zip(all) {
                    let law = law(&filtered(series), 0.4, time, 0.08);
                    counts[0] += usize::from(law == Some("Gaussian"));
                    counts[1] += usize::from(law == Some("levels"));
                }
            }
        }
        let [[right, wrong], [mistaken, told]] = counts;
        assert!(right >= 50 && wrong <= 10 && mistaken <= 10 && told >= 50, "{counts:?} of 60");
    }
}
