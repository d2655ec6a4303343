//! A slow signal that is the same every period and no sinusoid, as of a thermostat or of a load that comes on every minute.

use super::kind::{AddedVariance, AveragingTime, Kind, amplitude_at_frequency, no_course};
use super::sinusoid::avar_of_sine;
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// A signal that repeats.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Periodic {
    /// Of its fundamental, Hz.
    #[serde(skip)]
    pub frequency_hz: BoundedEstimate,
    /// Amplitude of the fundamental.
    #[serde(skip)]
    pub amplitude: ChannelEstimate,
    /// Deviation of the second to the last harmonic over that of the fundamental, %.
    #[serde(skip)]
    pub harmonics_percent: BoundedEstimate,
    /// Amplitudes of these harmonics, in the unit of the channel: 0 of one that does not show.
    pub harmonics: Vec<f64>,
    /// Power of the harmonics over the noise.
    pub sum: f64,
    /// Probability at any period by chance.
    pub p_value: f64,
}

impl Kind for Periodic {
    const NAME: &'static str = "periodic";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![
            ("frequency", self.frequency_hz.parameter("Hz")),
            ("amplitude", self.amplitude.parameter()),
            ("harmonics_percent", self.harmonics_percent.parameter("%")),
        ]
    }

    amplitude_at_frequency!();

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let amplitudes = std::iter::once(self.amplitude.value).chain(self.harmonics.iter().copied());
        AddedVariance::modelled(avar_of_harmonics(self.frequency_hz.value, amplitudes, at.n, at.period_s))
    }

    no_course!();
}

/// Allan variance of a signal with these `amplitudes` of its harmonics, the first of which is at a `frequency` in Hz.
pub(crate) fn avar_of_harmonics(frequency: f64, amplitudes: impl Iterator<Item = f64>, n: u64, period_s: f64) -> f64 {
    let of = |(number, amplitude): (f64, f64)| amplitude * amplitude * avar_of_sine(number * frequency, n, period_s);
    (1..).map(f64::from).zip(amplitudes).map(of).sum()
}

#[cfg(test)]
mod tests {
    use super::Periodic;
    use crate::bounds::BoundedEstimate;
    use crate::effects::{AveragingTime, Kind};
    use std::f64::consts::TAU;

    /// The Allan variance of the samples of a period of 20 s with three harmonics, by its definition.
    #[test]
    fn the_variance_is_that_of_its_samples() {
        const SAMPLES: usize = 40_000;
        const PERIOD_S: f64 = 0.1;
        let amplitudes = [0.3, 0.2, 0.1];
        let exact = |value: f64| BoundedEstimate::exact(value);
        let periodic = Periodic {
            frequency_hz: exact(0.05),
            amplitude: exact(amplitudes[0]).in_unit("g"),
            harmonics_percent: exact(75.0),
            harmonics: amplitudes[1..].to_vec(),
            sum: 100.0,
            p_value: 1e-9,
        };
        let sample = |at: usize| {
            let of = |(number, amplitude): (f64, &f64)| amplitude * (TAU * 0.05 * number * PERIOD_S * at as f64).sin();
            (1..).map(f64::from).zip(&amplitudes).map(of).sum::<f64>()
        };
        let mut sums = vec![0.0];
        (0..SAMPLES).for_each(|at| sums.push(sums[at] + sample(at)));
        for n in [1_usize, 4, 16, 64, 256] {
            let differences = sums.windows(2 * n + 1).map(|of| (of[2 * n] - 2.0 * of[n] + of[0]) / n as f64);
            let count = (SAMPLES + 1 - 2 * n) as f64;
            let expected = 0.5 * differences.map(|of| of * of).sum::<f64>() / count;
            let (n, samples) = (n as u64, SAMPLES as u64);
            let at = AveragingTime { n, period_s: PERIOD_S, samples, model_avar: 0.0, adev_of: &|_, _| None };
            let found = periodic.avar(&at).modelled;
            // The ends of the record do not hold whole periods of the differences.
            assert!((found / expected - 1.0).abs() < 0.01, "{n}: {found} {expected}");
        }
    }
}
