//! A chirp: a line whose frequency runs evenly from one end of the record to the other, as that of a motor whose speed changes.

use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use super::sinusoid::avar_of_sine;
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// Frequencies of a run whose Allan variances are averaged.
const FREQUENCIES: u32 = 32;

/// A line whose frequency runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Chirp {
    /// Frequency at the beginning of the record, Hz.
    #[serde(skip)]
    pub start_hz: BoundedEstimate,
    /// Frequency at its end, Hz.
    #[serde(skip)]
    pub end_hz: BoundedEstimate,
    /// Change of the frequency, Hz/s.
    #[serde(skip)]
    pub rate_hz_per_s: BoundedEstimate,
    /// Amplitude.
    #[serde(skip)]
    pub amplitude: ChannelEstimate,
    /// Power over the noise of short spectra.
    pub excess: f64,
    /// Probability anywhere by chance.
    pub p_value: f64,
}

impl Kind for Chirp {
    const NAME: &'static str = "chirp";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![
            ("start", self.start_hz.parameter("Hz")),
            ("end", self.end_hz.parameter("Hz")),
            ("rate", self.rate_hz_per_s.parameter("Hz/s")),
            ("amplitude", self.amplitude.parameter()),
        ]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.amplitude.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        // Half a record has another end.
        vec![Some(self.rate_hz_per_s), Some(self.amplitude.estimate())]
    }

    fn occurrence(&self) -> Occurrence {
        let ends = [self.start_hz, self.end_hz];
        Occurrence::AtFrequency(BoundedEstimate {
            value: 0.5 * (self.start_hz.value + self.end_hz.value),
            low: ends.iter().map(|of| of.low).fold(f64::INFINITY, f64::min),
            high: ends.iter().map(|of| of.high).fold(0.0, f64::max),
        })
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let frequencies = [self.start_hz.value, self.end_hz.value];
        AddedVariance::modelled(avar_of_run(self.amplitude.value, frequencies, at.n, at.period_s))
    }

    no_course!();
}

/// Allan variance of a line whose frequency runs evenly from one to another, in Hz: the mean of those of sinusoids at each of the
/// frequencies.
pub(crate) fn avar_of_run(amplitude: f64, [first, last]: [f64; 2], n: u64, period_s: f64) -> f64 {
    let frequency = |number: u32| first + (last - first) * (f64::from(number) + 0.5) / f64::from(FREQUENCIES);
    let mean = (0..FREQUENCIES).map(|number| avar_of_sine(frequency(number), n, period_s)).sum::<f64>()
        / f64::from(FREQUENCIES);
    amplitude * amplitude * mean
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{AveragingTime, Kind};
    use std::f64::consts::TAU;

    /// The Allan variance of a sampled chirp from 4 to 12 Hz, by its definition.
    #[test]
    fn the_variance_is_that_of_its_samples() {
        const SAMPLES: usize = 60_000;
        let (period_s, [start, end]) = (0.01, [4.0, 12.0]);
        let exact = |value: f64| BoundedEstimate::exact(value);
        let duration_s = SAMPLES as f64 * period_s;
        let chirp = Chirp {
            start_hz: exact(start),
            end_hz: exact(end),
            rate_hz_per_s: exact((end - start) / duration_s),
            amplitude: exact(0.3).in_unit("g"),
            excess: 1.0,
            p_value: 1e-9,
        };
        let sample = |at: usize| {
            let time_s = at as f64 * period_s;
            0.3 * (TAU * (start + 0.5 * (end - start) * time_s / duration_s) * time_s).sin()
        };
        let mut sums = vec![0.0];
        (0..SAMPLES).for_each(|at| sums.push(sums[at] + sample(at)));
        for n in [1_usize, 2, 4, 8, 16] {
            let differences = sums.windows(2 * n + 1).map(|of| (of[2 * n] - 2.0 * of[n] + of[0]) / n as f64);
            let count = (SAMPLES + 1 - 2 * n) as f64;
            let expected = 0.5 * differences.map(|of| of * of).sum::<f64>() / count;
            let at = AveragingTime {
                n: n as u64,
                period_s,
                samples: SAMPLES as u64,
                model_avar: 0.0,
                adev_of: &|_, _| None,
            };
            let found = chirp.avar(&at).modelled;
            assert!((found / expected - 1.0).abs() < 0.01, "{n}: {found} {expected}");
        }
        assert_eq!(chirp.parameters().len(), 4);
    }
}
