//! A slow periodic signal that is no sinusoid, by the sum of its harmonics.
//!
//! Thermostats and pumps have harmonics each too weak for a line; together they stand out (harmonic sum of pulsar
//! searches: J. Taylor and G. Huguenin, Nature 221, 1969). The noise, white, walking and Markov, is fitted between the
//! harmonics.

use super::harmonics::{Harmonics, nearest_multiple};
use super::line_models::{PhaseSums, Sine};
use super::periodogram::Periodogram;
use super::slow_background::SlowBackground;
use crate::bounds::{BoundedEstimate, MeasuredValue};
use crate::distributions::{NORMAL_975, exponential_sum_tail, mean_ratio_tail};
use crate::effects::findings::SIGNIFICANCE;
use crate::samples::uniform_series::UniformSeries;
use std::f64::consts::PI;
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
        let spectrum = Periodogram::padded_by(PADDING, &blocks).filter(|_| most > periods.start)?;
        let highest = 2 * HARMONICS * most;
        let noise = SlowBackground::fit(orders(&spectrum, None, highest))?;
        let sum = |step: usize| {
            let fundamental = step as f64 / STEPS as f64;
            let orders = (1..=HARMONICS).map(|number| number as f64 * fundamental);
            let (sum, largest) = orders
                .map(|order| spectrum.at(order) / noise.density(order))
                .fold((0.0, 0.0_f64), |(sum, largest), ratio| (sum + ratio, largest.max(ratio)));
            (sum - largest, sum, fundamental)
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
        spectrum: &Periodogram,
        (fundamental, highest): (f64, usize),
        trials: f64,
    ) -> Option<Self> {
        let resolution = spectrum.resolution();
        let sine = Sine::fit_near(blocks, fundamental * resolution, resolution / PADDING as f64);
        let without = sine.subtracted_from(blocks).detrended();
        let rest = Periodogram::padded_by(1, &without)?;
        let noise = SlowBackground::fit(orders(&rest, Some(fundamental), highest))?;
        let (between, level) = between(&rest, &noise, fundamental);
        let ordinate = |number: usize, density: f64| Ordinate {
            density,
            noise: level * noise.density(number as f64 * fundamental),
        };
        let higher = |number: usize| {
            let frequency = number as f64 * fundamental * resolution;
            ordinate(number, PhaseSums::new(&without, frequency).fit_at(frequency).density(&without))
        };
        let first = ordinate(1, spectrum.at(fundamental));
        let higher: Vec<Ordinate> = (2..=HARMONICS).map(higher).collect();
        let sum: f64 = higher.iter().map(Ordinate::over_noise).sum();
        let by_chance = |skipped: usize| {
            let of = || higher.iter().skip(skipped).step_by(2);
            exponential_sum_tail(of().count() as f64, of().map(Ordinate::over_noise).sum())
        };
        // The first of them is the second harmonic.
        let has_both = by_chance(0) < EVEN_BY_CHANCE && by_chance(1) < ODD_BY_CHANCE;
        let largest = higher.iter().map(Ordinate::over_noise).fold(0.0, f64::max) / sum;
        let is_no_larger =
            |of: &Ordinate| of.excess() - first.excess() < NORMAL_975 * (first.variance() + of.variance()).sqrt();
        let is_fundamental = first.over_noise() > LEAST_FUNDAMENTAL && higher.iter().all(is_no_larger);
        if !is_fundamental || !has_both || largest > LARGEST_SHARE {
            return None;
        }
        // Exponential sums; those between the harmonics gave the level.
        let (above, below) = (higher.len() as f64, between as f64);
        let by_harmonics = mean_ratio_tail(sum / above, above, below);
        let with_fundamental = mean_ratio_tail((sum + first.over_noise()) / (above + 1.0), above + 1.0, below);
        let is_periodic = HARMONICS as f64 * by_harmonics < HARMONICS_BY_CHANCE;
        let by_chance = if is_periodic { by_harmonics.min(with_fundamental) } else { by_harmonics };
        let percent = 100.0 * (higher.iter().map(Ordinate::excess).sum::<f64>().max(0.0) / first.excess()).sqrt();
        let (amplitude, power) = (sine.amplitude(), first.over_noise() - 1.0);
        let bounds = |value: f64, error: f64| MeasuredValue { value, error }.bounds();
        Some(Self {
            // Cramér-Rao bound of the fundamental alone.
            frequency: bounds(sine.frequency, 1.5f64.sqrt() * resolution / (PI * power.sqrt())),
            // Relative variance 1/(2·power) of an amplitude.
            amplitude: bounds(amplitude, amplitude / (2.0 * power).sqrt()),
            harmonics: higher.iter().map(|of| amplitude * (of.excess().max(0.0) / first.excess()).sqrt()).collect(),
            harmonics_percent: bounds(percent, percent / (2.0 * sum).sqrt()),
            sum,
            p_value: (2.0 * trials * by_chance).min(1.0),
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
        nearest_multiple(frequency, self.frequency.value, f64::INFINITY).1 < within
    }

    /// True if a frequency, Hz, is between half an octave below the fundamental and the highest harmonic.
    pub(crate) fn reaches(&self, frequency: f64) -> bool {
        (std::f64::consts::FRAC_1_SQRT_2..=self.highest() as f64).contains(&(frequency / self.frequency.value))
    }

    pub(crate) fn period_s(&self) -> f64 {
        1.0 / self.frequency.value
    }
}

/// The ordinate of a harmonic, and the noise there.
struct Ordinate {
    density: f64,
    noise: f64,
}

impl Ordinate {
    fn over_noise(&self) -> f64 {
        self.density / self.noise
    }

    fn excess(&self) -> f64 {
        self.density - self.noise
    }

    /// Variance of an ordinate of the power P over noise n: n² + 2nP.
    fn variance(&self) -> f64 {
        self.noise * (self.noise + 2.0 * self.excess().max(0.0))
    }
}

/// Independent ordinates from order 1 to below `highest` that harmonics of `fundamental` do not reach.
fn orders(spectrum: &Periodogram, fundamental: Option<f64>, highest: usize) -> impl Iterator<Item = (usize, f64)> {
    let is_between = move |order: f64| fundamental.is_none_or(|of| (order - (order / of).round() * of).abs() > LOBE);
    let ordinates = spectrum.independent().enumerate().take(highest).skip(1);
    ordinates.filter(move |(order, _)| is_between(*order as f64))
}

/// Number of ordinates between the harmonics of `fundamental`, and their mean over the noise, at least 1.
fn between(spectrum: &Periodogram, noise: &SlowBackground, fundamental: f64) -> (usize, f64) {
    let highest = |harmonics: f64| (harmonics * fundamental).ceil() as usize;
    let near = orders(spectrum, Some(fundamental), highest(HARMONICS as f64 + 0.5));
    let (count, sum) = near
        .fold((0.0, 0.0), |(count, sum), (order, density)| (count + 1.0, sum + density / noise.density(order as f64)));
    (orders(spectrum, Some(fundamental), highest(2.0 * HARMONICS as f64)).count(), (sum / count).max(1.0))
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
        let of_fundamental = NORMAL_975 * (1.5_f64 / 149.0).sqrt() / PI;
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
            let (expected, deviation) = (6.0 / (PI * number), (2.0 / SAMPLES as f64).sqrt());
            assert!((amplitude - expected).abs() < 4.0 * deviation + 0.03 * expected, "{number}: {amplitude}");
        }
        // √(π²/6 − 1) of the fundamental.
        assert!((found.harmonics_percent.value - 80.3).abs() < 2.0, "{}", found.harmonics_percent.value);
        let left = found.subtracted_from(&of);
        let power = left.values().iter().map(|value| value * value).sum::<f64>() / SAMPLES as f64;
        // 128 of 8,192 ordinates of noise ½ are taken; 36/(2π²·128) remains above the 128th.
        assert!((power - 1.0).abs() < 0.06, "{power}");
    }

    /// Ordinates of 500 at 12 and at 18 periods: the sums near 6 periods, which have no fundamental, are above the 218 of the sawtooth.
    #[test]
    fn a_sawtooth_is_found_beside_two_stronger_lines() {
        let lines = |turn: f64| 0.35 * ((TAU * 12.0 * turn).sin() + (TAU * 18.0 * turn).sin());
        for seed in 70..80 {
            let of = series(seed, 0.0, |turn| lines(turn) + ((21.7 * turn).fract() - 0.5));
            let found = PeriodicSignal::find(&of).expect("five times the power between the harmonics");
            assert!((found.frequency.value * 0.1 * SAMPLES as f64 - 21.7).abs() < 0.2, "{seed}: {found:?}");
        }
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
