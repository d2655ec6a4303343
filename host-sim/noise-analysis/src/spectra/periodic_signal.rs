//! A slow periodic signal that is no sinusoid, by the sum of its harmonics.
//!
//! Thermostats and pumps have harmonics each too weak for a line; together they stand out (harmonic sum of pulsar
//! searches: J. Taylor and G. Huguenin, Nature 221, 1969). The noise, white, walking and Markov, is fitted between the
//! harmonics.

use super::harmonics::Harmonics;
use super::line_models::{Sine, transform_at};
use super::periodogram::taper;
use super::slow_background::SlowBackground;
use super::whittle::SpectralBand;
use crate::bounds::BoundedEstimate;
use crate::distributions::{NORMAL_975, exponential_sum_tail, mean_ratio_tail};
use crate::effects::findings::SIGNIFICANCE;
use crate::samples::uniform_series::UniformSeries;
use std::ops::Range;

/// Harmonics in the sum, including the fundamental.
const HARMONICS: usize = 8;
/// Fundamentals sought together, periods per record; twice the highest harmonic is half the block rate.
const RANGES: [Range<usize>; 2] = [4..32, 32..256];
/// Ordinates per resolution; the eighth harmonic is at most a quarter of a resolution off.
const PADDING: usize = 16;
/// Steps of the fundamental per resolution.
const STEPS: usize = 16;
/// Distance from a harmonic, resolutions, of an ordinate of noise: the first null of the taper.
const LOBE: f64 = 1.2;
/// Most frequencies examined, by the sum over the noise of all ordinates.
const EXAMINED: usize = 8;
/// Largest p-value of an examined sum, by the noise of all ordinates, the harmonics included.
const PROMISING: f64 = 0.1;
/// White noise, a random walk and ten Markov processes.
const TERMS: usize = 12;
/// Largest p-value of the even harmonics (none in a square wave) and of the odd ones (none at half the frequency).
const EVEN_BY_CHANCE: f64 = 1e-3;
const ODD_BY_CHANCE: f64 = 0.05;
/// Largest p-value of the harmonics of a clear fundamental, which may be a sinusoid.
const HARMONICS_BY_CHANCE: f64 = 1e-3;
/// Largest part of one harmonic in the sum; an unrelated line would be all of it.
const LARGEST_SHARE: f64 = 0.8;
/// Least power of the fundamental over the noise; without it, the frequency may be a fraction of the true one.
const LEAST_FUNDAMENTAL: f64 = 4.0;

#[derive(Debug, Clone)]
pub(crate) struct PeriodicSignal {
    /// Fundamental, Hz.
    pub frequency: BoundedEstimate,
    /// For the fundamental, in the unit of the series.
    pub amplitude: BoundedEstimate,
    /// From the second to the last significant one; 0 below the noise.
    pub harmonics: Vec<f64>,
    /// Their deviation over the fundamental's, %.
    pub harmonics_percent: BoundedEstimate,
    /// Ordinates of the second to the eighth harmonic over the noise.
    pub sum: f64,
    /// Probability of such a sum at any frequency by chance.
    pub p_value: f64,
}

impl PeriodicSignal {
    /// The clearest one; `None` if chance explains it.
    pub(crate) fn find(series: &UniformSeries) -> Option<Self> {
        let series = series.clone().averaged_until_dithered();
        let found = RANGES.iter().filter_map(|range| Self::find_within(range, &series));
        let clearest = found.min_by(|a, b| a.p_value.total_cmp(&b.p_value));
        clearest.filter(|found| found.p_value < SIGNIFICANCE).map(|found| found.with_higher_harmonics(&series))
    }

    fn find_within(periods: &Range<usize>, series: &UniformSeries) -> Option<Self> {
        let size = (series.values().len() / (4 * HARMONICS * periods.end)).max(1);
        let blocks = series.averaged(size).detrended();
        let most = periods.end.min(blocks.values().len() / (4 * HARMONICS));
        let spectrum = PaddedSpectrum::new(&blocks).filter(|_| most > periods.start)?;
        let highest = 2 * HARMONICS * most;
        let noise = spectrum.noise(None, highest)?;
        let sum = |step: usize| {
            let fundamental = step as f64 / STEPS as f64;
            let ratios: Vec<f64> = (1..=HARMONICS).map(|number| spectrum.ratio(&noise, number, fundamental)).collect();
            let sum: f64 = ratios.iter().sum();
            (sum - ratios.iter().copied().fold(0.0, f64::max), sum, fundamental)
        };
        let mut sums: Vec<(f64, f64, f64)> = (STEPS * periods.start..STEPS * most).map(sum).collect();
        sums.sort_by(|a, b| b.0.total_cmp(&a.0));
        // The false alarm is spread evenly over the logarithm of the frequency.
        let log_range = (RANGES[RANGES.len() - 1].end as f64 / RANGES[0].start as f64).ln();
        let examined = sums.iter().take(EXAMINED).filter_map(|&(_, sum, fundamental)| {
            let trials = STEPS as f64 * fundamental * log_range;
            let is_promising = trials * exponential_sum_tail(HARMONICS as f64, sum) < PROMISING;
            is_promising.then(|| Self::examine(&blocks, &spectrum, (fundamental, highest), trials))?
        });
        examined.min_by(|a, b| a.p_value.total_cmp(&b.p_value))
    }

    /// Examines a fundamental, in resolutions, over the noise up to `highest`, on the record without the fundamental.
    fn examine(
        blocks: &UniformSeries,
        spectrum: &PaddedSpectrum,
        (fundamental, highest): (f64, usize),
        trials: f64,
    ) -> Option<Self> {
        let resolution = 1.0 / blocks.duration();
        let sine = Sine::fit_near(blocks, fundamental * resolution, resolution / PADDING as f64);
        let rest = PaddedSpectrum::at_harmonics(&sine.subtracted_from(blocks).detrended(), fundamental)?;
        let noise = rest.noise(Some(fundamental), highest)?;
        let (between, level) = rest.between(&noise, fundamental);
        let noise_at = |number: usize| level * noise.density(number as f64 * fundamental);
        let over_noise =
            |of: &PaddedSpectrum, number: usize| of.density(number as f64 * fundamental) / noise_at(number);
        let ratios: Vec<f64> = (2..=HARMONICS).map(|number| over_noise(&rest, number)).collect();
        let sum: f64 = ratios.iter().sum();
        let by_chance = |first: usize| {
            let (count, sum) =
                ratios.iter().skip(first).step_by(2).fold((0.0, 0.0), |(n, sum), of| (n + 1.0, sum + of));
            exponential_sum_tail(count, sum)
        };
        // The first of them is the second harmonic.
        let has_both = by_chance(0) < EVEN_BY_CHANCE && by_chance(1) < ODD_BY_CHANCE;
        let largest = ratios.iter().copied().fold(0.0, f64::max) / sum;
        let excess = |of: &PaddedSpectrum, number: usize| (over_noise(of, number) - 1.0) * noise_at(number);
        let first = excess(spectrum, 1);
        let powers: Vec<f64> = (2..=HARMONICS).map(|number| excess(&rest, number)).collect();
        // Power P over noise n has the variance n² + 2nP.
        let variance = |power: f64, number: usize| {
            let density = noise_at(number);
            density * (density + 2.0 * power.max(0.0))
        };
        let is_no_larger = |(number, power): (usize, &f64)| {
            *power - first < NORMAL_975 * (variance(first, 1) + variance(*power, number)).sqrt()
        };
        let is_fundamental = first > (LEAST_FUNDAMENTAL - 1.0) * noise_at(1) && (2..).zip(&powers).all(is_no_larger);
        if !is_fundamental || !has_both || largest > LARGEST_SHARE {
            return None;
        }
        // Exponential sums; those between the harmonics gave the level.
        let (above, below) = (ratios.len() as f64, between as f64);
        let by_harmonics = mean_ratio_tail(sum / above, above, below);
        let whole = sum + over_noise(spectrum, 1);
        let with_fundamental = mean_ratio_tail(whole / (above + 1.0), above + 1.0, below);
        let is_periodic = HARMONICS as f64 * by_harmonics < HARMONICS_BY_CHANCE;
        let by_chance = if is_periodic { by_harmonics.min(with_fundamental) } else { by_harmonics };
        let p_value = (2.0 * trials * by_chance).min(1.0);
        let percent = 100.0 * (powers.iter().sum::<f64>().max(0.0) / first).sqrt();
        let relative = NORMAL_975 / (2.0 * sum).sqrt();
        let of_noise = first / noise_at(1);
        // Cramér-Rao bound of the fundamental alone.
        let error = NORMAL_975 * 1.5f64.sqrt() * resolution / (std::f64::consts::PI * of_noise.sqrt());
        let amplitude = sine.amplitude();
        // Relative variance 1/(2·power) of the amplitude.
        let half = NORMAL_975 / (2.0 * of_noise).sqrt();
        Some(Self {
            amplitude: BoundedEstimate::new(amplitude, amplitude * (1.0 - half).max(0.0), amplitude * (1.0 + half)),
            harmonics: powers.iter().map(|power| amplitude * (power.max(0.0) / first).sqrt()).collect(),
            frequency: BoundedEstimate::new(sine.frequency, sine.frequency - error, sine.frequency + error),
            harmonics_percent: BoundedEstimate::new(
                percent,
                percent * (1.0 - relative).max(0.0),
                percent * (1.0 + relative),
            ),
            sum,
            p_value,
        })
    }

    /// Adds significant harmonics above the eighth, and their information on the frequency.
    fn with_higher_harmonics(mut self, series: &UniformSeries) -> Self {
        let found = Harmonics::measure(series, self.frequency.value, HARMONICS);
        self.harmonics.extend(found.amplitudes().skip(HARMONICS));
        let power: f64 = self.harmonics.iter().map(|amplitude| amplitude * amplitude).sum();
        let percent = 100.0 * power.sqrt() / self.amplitude.value;
        self.harmonics_percent = self.harmonics_percent.scaled(percent / self.harmonics_percent.value);
        self.frequency = found.frequency().unwrap_or(self.frequency);
        self
    }

    pub(crate) fn subtracted_from(&self, series: &UniformSeries) -> UniformSeries {
        let spacing = 0.5 / series.duration();
        let without = |rest: UniformSeries, number: usize| {
            Sine::fit_near(&rest, number as f64 * self.frequency.value, spacing).subtracted_from(&rest)
        };
        (1..=self.highest()).fold(series.clone(), without)
    }

    /// Number of the highest significant harmonic.
    fn highest(&self) -> usize {
        self.harmonics.len() + 1
    }

    /// True if a frequency, Hz, is within `within` Hz of a multiple.
    pub(crate) fn has(&self, frequency: f64, within: f64) -> bool {
        let multiple = (frequency / self.frequency.value).round().max(1.0);
        (frequency - multiple * self.frequency.value).abs() < within
    }

    /// True if a frequency, Hz, is between half an octave below the fundamental and the highest harmonic.
    pub(crate) fn reaches(&self, frequency: f64) -> bool {
        (std::f64::consts::FRAC_1_SQRT_2..=self.highest() as f64).contains(&(frequency / self.frequency.value))
    }

    pub(crate) fn period_s(&self) -> f64 {
        1.0 / self.frequency.value
    }
}

/// A periodogram with [`PADDING`] ordinates per resolution, all or only those for one fundamental.
struct PaddedSpectrum {
    /// Ordinates, `spacing` padded ones apart, from 0 on.
    power: Vec<f64>,
    spacing: usize,
    between: Vec<(usize, f64)>,
}

/// Padded ordinate nearest to an order in periods per record.
fn position(order: f64) -> usize {
    (order * PADDING as f64).round() as usize
}

/// Samples under the taper, 0 if missing, and the sum of their squared weights; `None` without any.
fn tapered(blocks: &UniformSeries) -> Option<(Vec<f64>, f64)> {
    let (length, mut squares) = (blocks.values().len(), 0.0);
    let weighted = |(at, value): (usize, &f64)| {
        if !value.is_finite() {
            return 0.0;
        }
        let weight = taper(at, length);
        squares += weight * weight;
        weight * value
    };
    let values = blocks.values().iter().enumerate().map(weighted).collect();
    (squares > 0.0).then_some((values, squares))
}

/// `|Σwye^(−iωt)|²/Σw²` of wy, padded to `length`.
fn power(values: &[f64], length: usize, squares: f64) -> Option<Vec<f64>> {
    let transform = fourier::forward(length);
    let mut input = transform.make_input_vec();
    input.iter_mut().zip(values).for_each(|(slot, value)| *slot = *value);
    let mut output = transform.make_output_vec();
    transform.process(&mut input, &mut output).ok()?;
    Some(output.iter().map(|bin| bin.norm_sqr() / squares).collect())
}

impl PaddedSpectrum {
    fn new(blocks: &UniformSeries) -> Option<Self> {
        let (values, squares) = tapered(blocks)?;
        let power = power(&values, PADDING * values.len(), squares)?;
        Some(Self { power, spacing: 1, between: Vec::new() })
    }

    /// The independent ordinates, and those of a fundamental's harmonics.
    fn at_harmonics(blocks: &UniformSeries, fundamental: f64) -> Option<Self> {
        let (values, squares) = tapered(blocks)?;
        let length = PADDING * values.len();
        let of_harmonic = |number: usize| {
            let at = position(number as f64 * fundamental);
            (at <= length / 2).then(|| (at, transform_at(&values, at as f64 / length as f64).norm_sqr() / squares))
        };
        let between = (1..=HARMONICS).filter_map(of_harmonic).collect();
        Some(Self { power: power(&values, values.len(), squares)?, spacing: PADDING, between })
    }

    fn density(&self, order: f64) -> f64 {
        let at = position(order);
        match self.between.iter().find(|(of, _)| *of == at) {
            Some((_, density)) => *density,
            None => self.power.get(at / self.spacing).copied().unwrap_or(0.0),
        }
    }

    fn ratio(&self, noise: &SlowBackground<TERMS>, number: usize, fundamental: f64) -> f64 {
        let order = number as f64 * fundamental;
        self.density(order) / noise.density(order)
    }

    /// Independent orders below `highest` that harmonics of `fundamental` do not reach.
    fn orders(&self, fundamental: Option<f64>, highest: usize) -> impl Iterator<Item = usize> {
        let last = highest.min((self.power.len() - 1) * self.spacing / PADDING);
        (1..last).filter(move |&order| {
            fundamental.is_none_or(|fundamental| {
                let order = order as f64;
                (order - (order / fundamental).round() * fundamental).abs() > LOBE
            })
        })
    }

    /// The noise by those ordinates, or by all.
    fn noise(&self, fundamental: Option<f64>, highest: usize) -> Option<SlowBackground<TERMS>> {
        let mut bands: Vec<(usize, f64, f64, f64)> = Vec::new();
        for order in self.orders(fundamental, highest) {
            let density = self.density(order as f64);
            match bands.last_mut() {
                Some((first, orders, sum, count)) if order < *first + *first / 8 + 1 => {
                    (*orders, *sum, *count) = (*orders + order as f64, *sum + density, *count + 1.0);
                }
                _ => bands.push((order, order as f64, density, 1.0)),
            }
        }
        let bands: Vec<SpectralBand> = bands
            .into_iter()
            .map(|(_, orders, sum, count)| SpectralBand {
                frequency: orders / count,
                density: sum / count,
                ordinates: count,
            })
            .collect();
        if bands.len() < TERMS { None } else { SlowBackground::fit(&bands) }
    }

    /// Number of ordinates between the harmonics of `fundamental`, and their mean over the noise, at least 1.
    fn between(&self, noise: &SlowBackground<TERMS>, fundamental: f64) -> (usize, f64) {
        let highest = |harmonics: f64| (harmonics * fundamental).ceil() as usize;
        let near = self.orders(Some(fundamental), highest(HARMONICS as f64 + 0.5)).map(|order| order as f64);
        let (count, sum) = near
            .fold((0.0, 0.0), |(count, sum), order| (count + 1.0, sum + self.density(order) / noise.density(order)));
        (self.orders(Some(fundamental), highest(2.0 * HARMONICS as f64)).count(), (sum / count).max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    const SAMPLES: usize = 16 * 1024;

    /// White noise of deviation 1, a walk with steps `step`, and a signal of the phase in turns.
    fn series(seed: u64, step: f64, signal: impl Fn(f64) -> f64) -> UniformSeries {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut walk = 0.0;
        let value = |at: usize| {
            walk += step * random.sample::<f64, _>(StandardNormal);
            walk + random.sample::<f64, _>(StandardNormal) + signal(at as f64 / SAMPLES as f64)
        };
        UniformSeries::new(0.1, (0..SAMPLES).map(value).collect())
    }

    #[test]
    fn the_ordinates_of_one_fundamental_are_those_of_all() {
        let blocks = series(1, 0.01, |turn| (7.3 * turn).fract()).averaged(16);
        let (all, fundamental) = (PaddedSpectrum::new(&blocks).unwrap(), 7.3);
        let few = PaddedSpectrum::at_harmonics(&blocks, fundamental).unwrap();
        let orders = (0..=SAMPLES / 32).map(|order| order as f64);
        let harmonics = (1..=HARMONICS).map(|number| number as f64 * fundamental);
        let largest = all.power.iter().copied().fold(0.0, f64::max);
        for order in orders.chain(harmonics) {
            // Rounding of transforms of a thousand numbers.
            assert!((few.density(order) - all.density(order)).abs() < 1e-12 * largest, "{order}");
        }
        assert!(all.orders(None, 512).eq(few.orders(None, 512)));
    }

    #[test]
    fn a_sawtooth_is_found_among_few_periods() {
        for (seed, periods) in [(1, 5.3), (2, 9.0), (3, 17.7)] {
            // Ordinates 149/k² over the white noise, 79 in the second to the eighth; the walk equals it at 5 periods.
            let found = PeriodicSignal::find(&series(seed, 0.002, |turn| 0.6 * ((periods * turn).fract() - 0.5)))
                .expect("some ten times the noise");
            let duration_s = 0.1 * SAMPLES as f64;
            assert!((found.frequency.value * duration_s - periods).abs() < 0.2, "{periods}: {found:?}");
            assert!(found.has(3.0 * periods / duration_s, 1.0 / duration_s));
        }
    }

    /// Pulses for 8 % of a period: ordinates of 13, 12, 11, 9, 7, 6, 4 and 3 times the noise.
    #[test]
    fn short_pulses_are_found_among_many_periods() {
        for (seed, periods) in [(1, 33.4), (2, 64.2), (3, 121.6), (4, 250.9)] {
            let pulse = |turn: f64| if (periods * turn).fract() < 0.08 { -0.35 } else { 0.0 };
            let found = PeriodicSignal::find(&series(seed, 0.002, pulse)).expect("65 times the noise");
            let duration_s = 0.1 * SAMPLES as f64;
            assert!((found.frequency.value * duration_s - periods).abs() < 0.2, "{periods}: {found:?}");
        }
    }

    /// Nine of ten intervals hold: 31 of 40 but for one in 100 cases.
    #[test]
    fn all_harmonics_tell_the_frequency() {
        let of_fundamental = NORMAL_975 * (1.5_f64 / 149.0).sqrt() / std::f64::consts::PI;
        let (mut within, mut half) = (0, 0.0);
        for seed in 100..140 {
            let periods = 8.0 + 0.37 * (seed - 100) as f64;
            let found = PeriodicSignal::find(&series(seed, 0.0, |turn| 0.6 * ((periods * turn).fract() - 0.5)));
            let BoundedEstimate { value, low, high } = found.expect("some ten times the noise").frequency;
            let duration_s = 0.1 * SAMPLES as f64;
            within += usize::from((low..=high).contains(&(periods / duration_s)));
            half += (high - value) * duration_s / 40.0;
        }
        assert!(half < 0.6 * of_fundamental, "{half}");
        assert!(within >= 31, "{within}");
    }

    /// A sawtooth of 6: ordinates of 14,900/k², 1.6 on the mean from the 65th to the 128th.
    #[test]
    fn harmonics_above_the_eighth_are_the_signal_too() {
        let of = series(1, 0.0, |turn| 6.0 * ((7.3 * turn).fract() - 0.5));
        let found = PeriodicSignal::find(&of).expect("a thousand times the noise");
        assert!(found.harmonics.len() >= 127, "{}", found.harmonics.len());
        for (number, amplitude) in (2..=64).map(f64::from).zip(&found.harmonics) {
            // Deviation √(2/n) of an amplitude; means of blocks keep 0.97.
            let (expected, deviation) = (6.0 / (std::f64::consts::PI * number), (2.0 / SAMPLES as f64).sqrt());
            assert!((amplitude - expected).abs() < 4.0 * deviation + 0.03 * expected, "{number}: {amplitude}");
        }
        // √(π²/6 − 1) of the fundamental.
        assert!((found.harmonics_percent.value - 80.3).abs() < 2.0, "{}", found.harmonics_percent.value);
        let left = found.subtracted_from(&of);
        let power = left.values().iter().map(|value| value * value).sum::<f64>() / SAMPLES as f64;
        // 128 of 8,192 ordinates of noise ½ are taken; 36/(2π²·128) remains above the 128th.
        assert!((power - 1.0).abs() < 0.06, "{power}");
    }

    #[test]
    fn a_weak_sawtooth_is_found_by_its_fundamental_too() {
        let found = (50..70).filter_map(|seed| {
            let periods = 5.0 + 0.7 * (seed - 50) as f64;
            PeriodicSignal::find(&series(seed, 0.0, |turn| 0.3 * ((periods * turn).fract() - 0.5)))
        });
        let found: Vec<PeriodicSignal> = found.collect();
        // Ordinates of 37/k²: the harmonics have 20 together, and less than half of the records have even and odd ones.
        let by_harmonics = found.iter().filter(|found| found.sum > 31.0).count();
        assert!(found.len() >= 5 && by_harmonics + 3 <= found.len(), "{} {by_harmonics}", found.len());
    }

    /// Two averages over 1.6 s leave a fortieth of the density at 0.5 Hz and none at 0.6 Hz.
    #[test]
    fn noise_behind_a_filter_is_none() {
        for seed in 0..30 {
            let kept = f64::exp(-0.1 / 0.8);
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut process = 0.0;
            let value = |_| {
                process = kept * process + 0.7 * (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
                process + 0.4 * random.sample::<f64, _>(StandardNormal)
            };
            let input: Vec<f64> = (0..SAMPLES + 30).map(value).collect();
            let averaged =
                |of: &[f64]| -> Vec<f64> { of.windows(16).map(|of| of.iter().sum::<f64>() / 16.0).collect() };
            let found = PeriodicSignal::find(&UniformSeries::new(0.1, averaged(&averaged(&input))));
            assert!(found.is_none(), "{seed}: {found:?}");
        }
    }

    #[test]
    fn sinusoids_square_waves_and_noise_are_none() {
        let square = |turn: f64| 0.2 * (TAU * 7.3 * turn).sin().signum();
        let sinusoid = |turn: f64| (TAU * 6.4 * turn).sin();
        let two = |turn: f64| 0.3 * (TAU * 9.4 * turn).sin() + 0.3 * (TAU * 28.2 * turn).sin();
        let found = |seed: u64| {
            let of =
                |step: f64, signal: &dyn Fn(f64) -> f64| PeriodicSignal::find(&series(seed, step, signal)).is_some();
            [
                of(0.01, &square),
                of(0.01, &sinusoid),
                of(0.0, &two),
                of(0.01, &|_| 0.0),
                of(0.0, &|_| 0.0),
                of(0.1, &|_| 0.0),
            ]
        };
        for seed in 10..40 {
            assert_eq!(found(seed), [false; 6], "{seed}");
        }
    }
}
