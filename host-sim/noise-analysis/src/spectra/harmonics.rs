//! The harmonics of a periodic signal above those by which it is found.
//!
//! The fall of a sawtooth and the edges of short pulses have harmonics far above the eighth, of which each is weaker than the noise. They are
//! sought octave by octave, by the mean of all harmonics of an octave over the mean half-way between them. The frequency is the one at
//! which all of them together have the largest power over the noise; each octave tells it as much better as the next one needs it.

use super::line_models::PhaseSums;
use crate::bounds::BoundedEstimate;
use crate::distributions::{NORMAL_975, mean_ratio_tail};
use crate::samples::uniform_series::UniformSeries;
use std::f64::consts::PI;
use std::ops::RangeInclusive;

/// Largest probability by chance that the harmonics of an octave exceed the noise as much as they do.
const BY_CHANCE: f64 = 1e-3;
/// Means of blocks to a period of the highest harmonic that is sought in them: they have 0.97 of its amplitude.
const BLOCKS_PER_PERIOD: f64 = 8.0;
/// Steps of the highest harmonic to a resolution where the frequency is sought, and how many of them on each side of what is known: a resolution.
const STEPS: f64 = 8.0;

/// Variance of a frequency under the taper over that without it: Σt²·Σw²t²/(Σwt²)², counted from the middle of the record.
const TAPERED: f64 = 1.12;

/// The harmonics of a signal, from the first one on.
pub(super) struct Harmonics {
    /// Of the fundamental, Hz.
    fundamental: f64,
    harmonics: Vec<Harmonic>,
    /// Of the record, Hz.
    resolution: f64,
}

struct Harmonic {
    number: f64,
    /// At its frequency and near it.
    sums: PhaseSums,
    /// Mean ordinate half-way between the harmonics of its octave.
    noise: f64,
}

impl Harmonic {
    /// Its ordinate over the noise, for a fundamental in Hz.
    fn over_noise(&self, fundamental: f64) -> f64 {
        self.sums.power_at(self.number * fundamental) / self.noise
    }
}

impl Harmonics {
    /// Those of a fundamental, in Hz, of which the first `known` are there.
    pub(super) fn measure(series: &UniformSeries, fundamental: f64, known: usize) -> Self {
        let mut found = Self { fundamental, harmonics: Vec::new(), resolution: 1.0 / series.duration() };
        let mut numbers = 1..=known;
        while let Some(octave) = found.octave(series, numbers.clone()) {
            let count = octave.len() as f64;
            let mean = octave.iter().map(|of| of.over_noise(found.fundamental)).sum::<f64>() / count;
            if *numbers.start() > 1 && mean_ratio_tail(mean, count, count) > BY_CHANCE {
                break;
            }
            found.harmonics.extend(octave);
            found.fundamental = found.strongest_fundamental();
            numbers = numbers.end() + 1..=2 * numbers.end();
        }
        found
    }

    /// The harmonics of these numbers; `None` where the samples are too far apart for them.
    fn octave(&self, series: &UniformSeries, numbers: RangeInclusive<usize>) -> Option<Vec<Harmonic>> {
        let highest = self.fundamental * *numbers.end() as f64;
        let samples = 1.0 / (BLOCKS_PER_PERIOD * highest * series.sample_period());
        let blocks = (samples >= 1.0).then(|| series.averaged(samples as usize).detrended())?;
        let sums = |number: f64| PhaseSums::new(&blocks, number * self.fundamental);
        let numbers: Vec<f64> = numbers.map(|number| number as f64).collect();
        let between = numbers.iter().map(|number| sums(number + 0.5).power_at((number + 0.5) * self.fundamental));
        let noise = between.sum::<f64>() / numbers.len() as f64;
        let harmonic = |number: f64| Harmonic { number, sums: sums(number), noise };
        (noise > 0.0).then(|| numbers.into_iter().map(harmonic).collect())
    }

    /// The fundamental near the one that is known at which the harmonics have the largest power over the noise, Hz.
    fn strongest_fundamental(&self) -> f64 {
        let step = self.resolution / (STEPS * self.harmonics.len() as f64);
        let power = |steps: f64| {
            let fundamental = self.fundamental + steps * step;
            self.harmonics.iter().map(|of| of.over_noise(fundamental)).sum::<f64>()
        };
        let powers = (-(STEPS as i32)..=STEPS as i32).map(|steps| (f64::from(steps), power(f64::from(steps))));
        let (best, largest) = powers.fold((0.0, 0.0), |best, of| if of.1 > best.1 { of } else { best });
        // Maximum of the parabola through three points.
        let [left, right] = [power(best - 1.0), power(best + 1.0)];
        let curvature = 2.0 * largest - left - right;
        let shift = if curvature > 0.0 { (0.5 * (right - left) / curvature).clamp(-1.0, 1.0) } else { 0.0 };
        self.fundamental + (best + shift) * step
    }

    /// Frequency of the fundamental, Hz; `None` if the harmonics do not exceed the noise.
    ///
    /// The summit of |S + N|² by the signal's transform S and the noise's N: the slope has the noise of S·N and of N·N, of S² + 1 over the
    /// noise, and the curvature S². Where S² is large this is the Cramér-Rao bound, 3/(2π²S²T²) of a sinusoid over T.
    pub(super) fn frequency(&self) -> Option<BoundedEstimate> {
        let of = self.fundamental;
        let (mut whole, mut excess) = (0.0, 0.0);
        for harmonic in &self.harmonics {
            let (square, over_noise) = (harmonic.number * harmonic.number, harmonic.over_noise(of));
            whole += square * over_noise;
            excess += square * (over_noise - 1.0);
        }
        let error = NORMAL_975 * (1.5 * TAPERED * whole).sqrt() / excess * self.resolution / PI;
        (excess > 0.0).then_some(BoundedEstimate::new(of, of - error, of + error))
    }

    /// Amplitudes from the first one on, in the unit of the series: 0 of one that has less than the noise.
    pub(super) fn amplitudes(&self) -> impl Iterator<Item = f64> {
        self.harmonics.iter().map(|harmonic| {
            let over_noise = harmonic.over_noise(self.fundamental);
            let sine = harmonic.sums.fit_at(harmonic.number * self.fundamental);
            sine.amplitude() * ((over_noise - 1.0).max(0.0) / over_noise).sqrt()
        })
    }
}
