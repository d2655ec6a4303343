//! Lines in the mean spectrum of stretches of a record whose samples are not kept.
//!
//! Its ordinates are gamma variables of shape `K`. A sinusoid has to be 1.3 (16 stretches) to 1.9 (150) times as large
//! as for all of the record; a resonance no larger.

use super::alternation::Alternation;
use super::lines::MOST;
use super::spectral_line::{Resonance, SpectralLine};
use super::whitened_spectrum::{NARROWEST, Spectrum, WhitenedSpectrum, refit};
use crate::robust::median;
use crate::samples::rounding::Rounding;
use crate::samples::uniform_series::UniformSeries;

#[derive(Clone)]
pub(crate) struct StackedSpectrum {
    sample_period: f64,
    /// Smallest distance of two values, in the channel's unit.
    resolution: f64,
    read_every: u32,
    /// Samples of the current stretch, `NaN` if missing.
    stretch: Vec<f64>,
    number: u64,
    /// Over means in which rounding acts as noise, by the first stretch.
    mean: Option<Spectrum>,
    /// Over all samples: the mean of spectra has no phases.
    alternation: Alternation,
    periods: u64,
    /// Sum of the stretches' levels, and of their squares.
    levels: [f64; 2],
}

impl StackedSpectrum {
    /// For stretches of `length` samples, `sample_period` in s; values differ by `resolution`.
    pub(crate) fn new(sample_period: f64, length: usize, resolution: f64, read_every: u32) -> Self {
        Self {
            sample_period,
            resolution,
            read_every,
            stretch: vec![f64::NAN; length],
            number: 0,
            mean: None,
            alternation: Alternation::default(),
            periods: 0,
            levels: [0.0; 2],
        }
    }

    /// Takes the next sample; the remainder at the end is in no stretch.
    pub(crate) fn push(&mut self, slot: u64, value: f64) {
        self.alternation.push(slot, value);
        self.periods = slot + 1;
        let length = self.stretch.len() as u64;
        if slot / length != self.number {
            self.end_stretch();
            self.number = slot / length;
        }
        self.stretch[(slot % length) as usize] = value;
        if slot % length == length - 1 {
            self.end_stretch();
            self.number += 1;
        }
    }

    fn end_stretch(&mut self) {
        let missing = vec![f64::NAN; self.stretch.len()];
        let values = std::mem::replace(&mut self.stretch, missing);
        let rounding = Rounding::white(self.resolution, self.sample_period);
        let stretch =
            UniformSeries::new(self.sample_period, values).with_rounding(rounding).with_one_of(self.read_every);
        if 2 * stretch.present() <= stretch.values().len() {
            return;
        }
        let averaged = match &self.mean {
            None => stretch.averaged_until_dithered(),
            Some(mean) => stretch.averaged((mean.sample_period / self.sample_period).round() as usize),
        };
        let Some(spectrum) = Spectrum::new(&averaged.detrended()) else { return };
        let level = median(&mut spectrum.periodogram.independent().collect::<Vec<f64>>());
        self.levels = [self.levels[0] + level, self.levels[1] + level * level];
        match &mut self.mean {
            None => self.mean = Some(spectrum),
            Some(mean) => mean.average_with(&spectrum),
        }
    }

    /// P-value below 2·10⁻⁵, the strongest first; at most 6 and one at half the sample rate.
    pub(crate) fn lines(self) -> Vec<SpectralLine> {
        let Some(mut spectrum) = self.mean else { return Vec::new() };
        // Loud stretches have most of the weight.
        let [sum, squares] = self.levels;
        spectrum.independent *= sum * sum / squares / spectrum.periodogram.looks();
        let known = |_: f64| 1.0;
        let (mut sinusoids, mut resonances): (Vec<SpectralLine>, Vec<Resonance>) = (Vec::new(), Vec::new());
        while sinusoids.len() + resonances.len() < MOST
            && let Some(whitened) = WhitenedSpectrum::new(&spectrum, &known, &resonances, None)
            && let Some((bin, width, p_value)) = whitened.broad_peak(0)
        {
            let widths = [width / 2.0, width, 2.0 * width];
            match whitened.likeliest_lorentz(bin, widths).filter(|lorentz| lorentz.width > NARROWEST) {
                Some(lorentz) => {
                    resonances.push(Resonance { line: whitened.resonance_line(&lorentz, p_value), lorentz });
                    refit(&spectrum, &known, &mut resonances);
                }
                None => {
                    let (line, without) = whitened.sinusoid_near(bin, width, p_value);
                    sinusoids.push(line);
                    for (at, density) in without {
                        spectrum.periodogram.replace(at, density);
                    }
                }
            }
        }
        let (duration, rounding) =
            (self.periods as f64 * self.sample_period, Rounding::white(self.resolution, self.sample_period));
        let at_half_the_rate = self.alternation.line(duration, self.sample_period, &rounding);
        let others = resonances.iter().map(|resonance| resonance.line).chain(at_half_the_rate);
        let mut lines: Vec<SpectralLine> = sinusoids.into_iter().chain(others).collect();
        lines.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
        with_modulations(lines, spectrum.periodogram.resolution())
    }
}

/// The lines, of which the strongest are first, without the sidebands of others.
fn with_modulations(mut rest: Vec<SpectralLine>, resolution: f64) -> Vec<SpectralLine> {
    let mut lines = Vec::new();
    while !rest.is_empty() {
        let mut line = rest.remove(0);
        let mut sides =
            rest.iter().enumerate().flat_map(|(at, one)| rest[at + 1..].iter().map(move |other| [one, other]));
        line.modulation = sides.find_map(|sides| line.modulation_by_sidebands(sides, resolution));
        rest.retain(|other| !line.has_sideband(other, 1.0 / resolution));
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::StackedSpectrum;
    use crate::spectra::SpectralLine;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    const STRETCH: usize = 4096;

    /// Lines in 64 stretches of white noise of deviation 1 at 100 Hz and `signal`.
    fn lines(seed: u64, mut signal: impl FnMut(f64) -> f64) -> Vec<SpectralLine> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut stacked = StackedSpectrum::new(0.01, STRETCH, 0.0, 1);
        for slot in 0..64 * STRETCH as u64 {
            // One sample in a hundred is missing, and half of the second last stretch.
            let is_missing = slot % 100 == 7 || slot * 2 / STRETCH as u64 == 124;
            let value = random.sample::<f64, _>(StandardNormal) + signal(0.01 * slot as f64);
            if !is_missing {
                stacked.push(slot, value);
            }
        }
        stacked.lines()
    }

    #[test]
    fn noise_has_no_lines() {
        // Each has one with a probability of 2·10⁻⁵.
        for seed in 0..20 {
            assert_eq!(lines(seed, |_| 0.0), []);
        }
    }

    /// Its peak is 2.3 times the noise of a stretch.
    #[test]
    fn a_sinusoid_that_no_stretch_shows_is_measured() {
        let amplitude = 0.05;
        let (mut frequencies, mut deviations) = (0, 0);
        for seed in 0..10 {
            let found = lines(seed, |time_s| amplitude * (TAU * 23.4567 * time_s).sin());
            let [line] = found[..] else { panic!("{seed}: {found:?}") };
            assert_eq!(line.width, None);
            let frequency = (line.frequency.value - 23.4567) / line.frequency.error;
            let deviation = (line.deviation.value - amplitude / 2f64.sqrt()) / line.deviation.error;
            frequencies += usize::from(frequency.abs() < 1.96);
            deviations += usize::from(deviation.abs() < 1.96);
            // 6·10⁻⁵ each.
            assert!(frequency.abs() < 4.0 && deviation.abs() < 4.0, "{seed}: {line:?}");
        }
        // 6 or fewer of ten have a probability of 10⁻³.
        assert!(frequencies > 6 && deviations > 6, "{frequencies} {deviations}");
    }

    /// Sidebands of a quarter of the amplitude, more than 2.5 resolutions from the line.
    #[test]
    fn two_sidebands_are_a_change_of_their_line() {
        let resolution = 1.0 / (0.01 * STRETCH as f64);
        for changes in [4.0, 7.0, 20.0] {
            let found = lines(1, |time_s| {
                let change = 1.0 + 0.5 * (TAU * changes * resolution * time_s).sin();
                0.2 * change * (TAU * 23.4567 * time_s).sin()
            });
            let [line] = found[..] else { panic!("{changes}: {found:?}") };
            let change = line.modulation.expect("two sidebands");
            assert!((change.frequency.value / resolution - changes).abs() < 0.25, "{changes}: {change:?}");
            assert!((change.depth.value - 0.5).abs() < 4.0 * change.depth.error, "{changes}: {change:?}");
        }
    }

    /// At 20 Hz, 0.5 Hz wide.
    #[test]
    fn a_resonance_is_measured() {
        let mut random = ChaCha8Rng::seed_from_u64(99);
        let (width, frequency) = (0.5, 20.0);
        let radius = (-std::f64::consts::PI * width * 0.01f64).exp();
        let turn = TAU * frequency * 0.01;
        let (mut cosine, mut sine) = (0.0, 0.0);
        let deviation = 0.1;
        let found = lines(5, |_| {
            let kick = deviation * (1.0 - radius * radius).sqrt();
            (cosine, sine) = (
                radius * (cosine * turn.cos() - sine * turn.sin()) + kick * random.sample::<f64, _>(StandardNormal),
                radius * (cosine * turn.sin() + sine * turn.cos()) + kick * random.sample::<f64, _>(StandardNormal),
            );
            cosine
        });
        let [line] = found[..] else { panic!("{found:?}") };
        let measured = line.width.expect("wider than the resolution of 0.024 Hz");
        let within = |measured: crate::bounds::MeasuredValue, truth: f64| {
            assert!((measured.value - truth).abs() < 4.0 * measured.error, "{measured:?} {truth}");
        };
        within(line.frequency, frequency);
        within(line.deviation, deviation);
        within(measured, width);
    }

    /// A strong sinusoid has skirts that stand out of the mean spectrum.
    #[test]
    fn a_strong_sinusoid_is_one_line() {
        for (seed, amplitude) in [(1, 0.35), (2, 1.0), (3, 10.0)] {
            for frequency in [20.3, 23.4567] {
                let found = lines(seed, |time_s| amplitude * (TAU * frequency * time_s).sin());
                let [line] = found[..] else { panic!("{amplitude} {frequency}: {found:?}") };
                assert_eq!(line.width, None, "{amplitude} {frequency}");
                assert!((line.frequency.value - frequency).abs() < 4.0 * line.frequency.error, "{line:?}");
            }
        }
    }
}
