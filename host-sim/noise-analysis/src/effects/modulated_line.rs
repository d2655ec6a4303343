//! A line whose amplitude or phase goes to and fro, as of a machine whose load changes, or of two machines whose speeds differ a little.

use super::evidence::LineEvidence;
use super::kind::{AddedVariance, AveragingTime, Kind, amplitude_at_frequency, no_course};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use allan_core::NoiseTerm;
use allan_core::term::Sinusoid;
use serde::Serialize;

/// A line with an even change of its amplitude or of its phase.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModulatedLine {
    /// Hz
    #[serde(skip)]
    pub frequency_hz: BoundedEstimate,
    /// Amplitude in the middle between its largest and its smallest value.
    #[serde(skip)]
    pub amplitude: ChannelEstimate,
    /// Amplitude of the change over that of the line, or of the change of the phase in rad.
    #[serde(skip)]
    pub depth: BoundedEstimate,
    /// Time from one maximum to the next, s.
    #[serde(skip)]
    pub period_s: BoundedEstimate,
    /// Whether the phase changes, and not the amplitude.
    pub of_phase: bool,
    /// What shows the change.
    pub evidence: ModulationEvidence,
}

/// What shows that a line changes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ModulationEvidence {
    /// Its envelope over the record.
    Envelope {
        /// Significance of the line, standard deviations.
        sigmas: f64,
    },
    /// A line on either side, equally strong and equally far.
    Sidebands(LineEvidence),
}

impl Kind for ModulatedLine {
    const NAME: &'static str = "modulated_line";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        let depth = match self.of_phase {
            true => ("phase_deviation", self.depth.parameter("rad")),
            false => ("depth", self.depth.parameter("")),
        };
        vec![
            ("frequency", self.frequency_hz.parameter("Hz")),
            ("amplitude", self.amplitude.parameter()),
            depth,
            ("period", self.period_s.parameter("s")),
        ]
    }

    amplitude_at_frequency!();

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let line = |frequency: f64| NoiseTerm::Sinusoid(Sinusoid { frequency });
        let frequency = self.frequency_hz.value;
        let sideband = 0.5 * self.depth.value * self.amplitude.value;
        let of_sideband = |frequency: f64| sideband * sideband * line(frequency).avar(at.n, at.period_s);
        // The model has the line, and no term for its sidebands.
        let [below, above] = [-1.0, 1.0].map(|side| of_sideband(frequency + side / self.period_s.value));
        AddedVariance { corrected: below + above, ..at.of_term(&line(frequency), self.amplitude.value) }
    }

    no_course!();
}

#[cfg(test)]
mod tests {
    use super::{ModulatedLine, ModulationEvidence};
    use crate::bounds::BoundedEstimate;
    use crate::effects::{AveragingTime, Kind};
    use std::f64::consts::TAU;

    /// The Allan variance of the samples of a line of 3.1 Hz whose amplitude changes by half every 5 s, by its definition.
    #[test]
    fn the_variance_is_that_of_its_samples() {
        const SAMPLES: usize = 60_000;
        const PERIOD_S: f64 = 0.02;
        let line = ModulatedLine {
            frequency_hz: BoundedEstimate::exact(3.1),
            amplitude: BoundedEstimate::exact(0.3).in_unit("g"),
            depth: BoundedEstimate::exact(0.5),
            period_s: BoundedEstimate::exact(5.0),
            of_phase: false,
            evidence: ModulationEvidence::Envelope { sigmas: 9.0 },
        };
        let sample = |at: usize| {
            let time_s = PERIOD_S * at as f64;
            0.3 * (1.0 + 0.5 * (TAU * time_s / 5.0).sin()) * (TAU * 3.1 * time_s).sin()
        };
        let mut sums = vec![0.0];
        (0..SAMPLES).for_each(|at| sums.push(sums[at] + sample(at)));
        for n in [1_usize, 4, 7, 50] {
            let differences = sums.windows(2 * n + 1).map(|of| (of[2 * n] - 2.0 * of[n] + of[0]) / n as f64);
            let count = (SAMPLES + 1 - 2 * n) as f64;
            let expected = 0.5 * differences.map(|of| of * of).sum::<f64>() / count;
            let (n, samples) = (n as u64, SAMPLES as u64);
            let at = AveragingTime { n, period_s: PERIOD_S, samples, model_avar: 0.0, adev_of: &|_, _| None };
            let found = line.avar(&at);
            // Whole periods of all three lines; the ends of the record do not hold whole periods of the differences.
            assert!(((found.modelled + found.corrected) / expected - 1.0).abs() < 0.01, "{n}: {found:?} {expected}");
        }
    }
}
