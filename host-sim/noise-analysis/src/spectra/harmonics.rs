//! Multiples of a frequency, and higher harmonics of a periodic signal than those by which it was found.
//!
//! Each may be weaker than the noise, so they are sought octave by octave by their mean over that half-way between. The
//! frequency is that of the largest total power.

use super::line_models::PhaseSums;
use crate::bounds::{BoundedEstimate, MeasuredValue};
use crate::distributions::mean_ratio_tail;
use crate::minimum::summit;
use crate::samples::uniform_series::UniformSeries;
use std::f64::consts::PI;
use std::ops::RangeInclusive;

/// Largest p-value of the harmonics of an octave.
const BY_CHANCE: f64 = 1e-3;
/// Means per period of the highest harmonic: 0.97 of its amplitude.
const BLOCKS_PER_PERIOD: f64 = 8.0;
/// Steps per resolution of the highest harmonic, and on each side of the known frequency.
const STEPS: f64 = 8.0;

/// Variance of a frequency by the taper: Σt²·Σw²t²/(Σwt²)² from the middle.
const TAPERED: f64 = 1.12;

/// The multiple of a fundamental, from the first to the `highest`, that is nearest to a frequency, and its distance.
pub(crate) fn nearest_multiple(frequency: f64, fundamental: f64, highest: f64) -> (f64, f64) {
    let multiple = (frequency / fundamental).round().clamp(1.0, highest);
    (multiple, (frequency - multiple * fundamental).abs())
}

pub(super) struct Harmonics {
    fundamental: f64,
    harmonics: Vec<Harmonic>,
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
    fn over_noise(&self, fundamental: f64) -> f64 {
        self.sums.power_at(self.number * fundamental) / self.noise
    }
}

impl Harmonics {
    /// For a fundamental in Hz whose first `known` harmonics are significant.
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

    /// `None` if the sample rate is too low.
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

    /// The fundamental near the known one with the largest total power, Hz.
    fn strongest_fundamental(&self) -> f64 {
        let step = self.resolution / (STEPS * self.harmonics.len() as f64);
        let power = |steps: f64| {
            let fundamental = self.fundamental + steps * step;
            self.harmonics.iter().map(|of| of.over_noise(fundamental)).sum::<f64>()
        };
        let powers = (-(STEPS as i32)..=STEPS as i32).map(|steps| (f64::from(steps), power(f64::from(steps))));
        let (best, largest) = powers.fold((0.0, 0.0), |best, of| if of.1 > best.1 { of } else { best });
        self.fundamental + (best + summit([power(best - 1.0), largest, power(best + 1.0)])) * step
    }

    /// Frequency of the fundamental, Hz (Cramér-Rao bound); `None` if the harmonics do not exceed the noise.
    pub(super) fn frequency(&self) -> Option<BoundedEstimate> {
        let of = self.fundamental;
        let (mut whole, mut excess) = (0.0, 0.0);
        for harmonic in &self.harmonics {
            let (square, over_noise) = (harmonic.number * harmonic.number, harmonic.over_noise(of));
            whole += square * over_noise;
            excess += square * (over_noise - 1.0);
        }
        let error = (1.5 * TAPERED * whole).sqrt() / excess * self.resolution / PI;
        (excess > 0.0).then(|| MeasuredValue { value: of, error }.bounds())
    }

    /// Amplitudes from the first one on, in the unit of the series: 0 below the noise.
    pub(super) fn amplitudes(&self) -> impl Iterator<Item = f64> {
        self.harmonics.iter().map(|harmonic| {
            let over_noise = harmonic.over_noise(self.fundamental);
            let sine = harmonic.sums.fit_at(harmonic.number * self.fundamental);
            sine.amplitude() * ((over_noise - 1.0).max(0.0) / over_noise).sqrt()
        })
    }
}
