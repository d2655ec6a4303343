//! Periodic signals that are no steady line: their amplitude, phase or frequency changes, or their form is no sinusoid.

use super::evidence::LineEvidence;
use super::kind::{AddedVariance, AveragingTime, Kind, NamedParameter, Occurrence, named};
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use allan_core::NoiseTerm;
use allan_core::term::Sinusoid;
use serde::Serialize;

/// A line whose amplitude or phase changes evenly, as of a machine whose load changes, or of two whose speeds differ a little.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModulatedLine {
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
    /// True if the phase changes, and not the amplitude.
    pub of_phase: bool,
    pub evidence: ModulationEvidence,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ModulationEvidence {
    /// Its envelope over the record, of a line of this significance in standard deviations.
    Envelope { sigmas: f64 },
    /// A line on either side, equally strong and equally far.
    Sidebands(LineEvidence),
}

impl Kind for ModulatedLine {
    fn parameters(&self) -> Vec<NamedParameter> {
        let (depth, unit) = if self.of_phase { ("phase_deviation", "rad") } else { ("depth", "") };
        vec![
            named("frequency", self.frequency_hz.parameter("Hz")).lasting(),
            named("amplitude", self.amplitude.parameter()).size().lasting(),
            named(depth, self.depth.parameter(unit)),
            named("period", self.period_s.parameter("s")),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtFrequency(self.frequency_hz)
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let line = |frequency: f64| NoiseTerm::Sinusoid(Sinusoid { frequency });
        let frequency = self.frequency_hz.value;
        let sideband = 0.5 * self.depth.value * self.amplitude.value;
        let of_sideband = |frequency: f64| sideband * sideband * line(frequency).avar(at.n, at.period_s);
        // The model has the line, and no term for its sidebands.
        let [below, above] = [-1.0, 1.0].map(|side| of_sideband(frequency + side / self.period_s.value));
        AddedVariance { corrected: below + above, ..at.of_term(&line(frequency), self.amplitude.value) }
    }
}

/// A line whose frequency runs evenly from one end of the record to the other, as that of a motor whose speed changes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Chirp {
    #[serde(skip)]
    pub start_hz: BoundedEstimate,
    #[serde(skip)]
    pub end_hz: BoundedEstimate,
    #[serde(skip)]
    pub rate_hz_per_s: BoundedEstimate,
    #[serde(skip)]
    pub amplitude: ChannelEstimate,
    /// Power over the noise of short spectra.
    pub excess: f64,
    pub p_value: f64,
}

impl Kind for Chirp {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("start", self.start_hz.parameter("Hz")),
            named("end", self.end_hz.parameter("Hz")),
            // Half a record has another end, and the same rate.
            named("rate", self.rate_hz_per_s.parameter("Hz/s")).lasting(),
            named("amplitude", self.amplitude.parameter()).size().lasting(),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        let ends = [self.start_hz, self.end_hz];
        Occurrence::AtFrequency(BoundedEstimate {
            value: 0.5 * (self.start_hz.value + self.end_hz.value),
            low: ends.iter().map(|end| end.low).fold(f64::INFINITY, f64::min),
            high: ends.iter().map(|end| end.high).fold(0.0, f64::max),
        })
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let frequencies = [self.start_hz.value, self.end_hz.value];
        AddedVariance::modelled(avar_of_run(self.amplitude.value, frequencies, at.n, at.period_s))
    }
}

/// Allan variance of a line whose frequency runs evenly from one to another, in Hz: the mean of those of sinusoids at each frequency.
pub(crate) fn avar_of_run(amplitude: f64, [first, last]: [f64; 2], n: u64, period_s: f64) -> f64 {
    const FREQUENCIES: u32 = 32;
    let frequency = |number: u32| first + (last - first) * (f64::from(number) + 0.5) / f64::from(FREQUENCIES);
    let mean = (0..FREQUENCIES).map(|number| avar_of_sine(frequency(number), n, period_s)).sum::<f64>()
        / f64::from(FREQUENCIES);
    amplitude * amplitude * mean
}

/// A slow signal that is the same every period and no sinusoid, as of a thermostat or of a load that comes on every minute.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Periodic {
    /// Frequency of its fundamental, Hz.
    #[serde(skip)]
    pub frequency_hz: BoundedEstimate,
    #[serde(skip)]
    pub amplitude: ChannelEstimate,
    /// Deviation of the second to the last harmonic over that of the fundamental, %.
    #[serde(skip)]
    pub harmonics_percent: BoundedEstimate,
    /// Amplitudes of these harmonics, in the unit of the channel: 0 of one that does not show.
    pub harmonics: Vec<f64>,
    /// Power of the harmonics over the noise.
    pub sum: f64,
    pub p_value: f64,
}

impl Kind for Periodic {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("frequency", self.frequency_hz.parameter("Hz")).lasting(),
            named("amplitude", self.amplitude.parameter()).size().lasting(),
            named("harmonics_percent", self.harmonics_percent.parameter("%")),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtFrequency(self.frequency_hz)
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let amplitudes = std::iter::once(self.amplitude.value).chain(self.harmonics.iter().copied());
        AddedVariance::modelled(avar_of_harmonics(self.frequency_hz.value, amplitudes, at.n, at.period_s))
    }
}

/// Allan variance of a signal with these `amplitudes` of its harmonics, the first of which is at a `frequency` in Hz.
pub(crate) fn avar_of_harmonics(frequency: f64, amplitudes: impl Iterator<Item = f64>, n: u64, period_s: f64) -> f64 {
    let of = |(number, amplitude): (f64, f64)| amplitude * amplitude * avar_of_sine(number * frequency, n, period_s);
    (1..).map(f64::from).zip(amplitudes).map(of).sum()
}

/// Allan variance of a sinusoid of amplitude 1, beyond half the sample rate that of its alias; a frequency of 0 has none.
fn avar_of_sine(frequency: f64, n: u64, period_s: f64) -> f64 {
    let avar = NoiseTerm::Sinusoid(Sinusoid { frequency }).avar(n, period_s);
    if avar.is_finite() { avar } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::kind::tests::assert_avar;
    use std::f64::consts::TAU;

    // The ends of the records do not hold whole periods of the differences: 1 % of the variance.

    #[test]
    fn the_variance_of_a_modulated_line_is_that_of_its_samples() {
        const PERIOD_S: f64 = 0.02;
        let line = ModulatedLine {
            frequency_hz: BoundedEstimate::exact(3.1),
            amplitude: BoundedEstimate::exact(0.3).in_unit("g"),
            depth: BoundedEstimate::exact(0.5),
            period_s: BoundedEstimate::exact(5.0),
            of_phase: false,
            evidence: ModulationEvidence::Envelope { sigmas: 9.0 },
        };
        let sample = |at: u32| {
            let time_s = PERIOD_S * f64::from(at);
            0.3 * (1.0 + 0.5 * (TAU * time_s / 5.0).sin()) * (TAU * 3.1 * time_s).sin()
        };
        let samples: Vec<f64> = (0..60_000).map(sample).collect();
        assert_avar(&line, &samples, PERIOD_S, &[1, 4, 7, 50], 0.01);
    }

    #[test]
    fn the_variance_of_a_chirp_is_that_of_its_samples() {
        const SAMPLES: u32 = 60_000;
        let (period_s, [start, end]) = (0.01, [4.0, 12.0]);
        let duration_s = f64::from(SAMPLES) * period_s;
        let chirp = Chirp {
            start_hz: BoundedEstimate::exact(start),
            end_hz: BoundedEstimate::exact(end),
            rate_hz_per_s: BoundedEstimate::exact((end - start) / duration_s),
            amplitude: BoundedEstimate::exact(0.3).in_unit("g"),
            excess: 1.0,
            p_value: 1e-9,
        };
        let sample = |at: u32| {
            let time_s = f64::from(at) * period_s;
            0.3 * (TAU * (start + 0.5 * (end - start) * time_s / duration_s) * time_s).sin()
        };
        let samples: Vec<f64> = (0..SAMPLES).map(sample).collect();
        assert_avar(&chirp, &samples, period_s, &[1, 2, 4, 8, 16], 0.01);
    }

    /// A period of 20 s with three harmonics.
    #[test]
    fn the_variance_of_a_periodic_signal_is_that_of_its_samples() {
        const PERIOD_S: f64 = 0.1;
        let amplitudes = [0.3, 0.2, 0.1];
        let periodic = Periodic {
            frequency_hz: BoundedEstimate::exact(0.05),
            amplitude: BoundedEstimate::exact(amplitudes[0]).in_unit("g"),
            harmonics_percent: BoundedEstimate::exact(75.0),
            harmonics: amplitudes[1..].to_vec(),
            sum: 100.0,
            p_value: 1e-9,
        };
        let sample = |at: u32| {
            let harmonics = (1..).map(f64::from).zip(&amplitudes);
            harmonics.map(|(k, amplitude)| amplitude * (TAU * 0.05 * k * PERIOD_S * f64::from(at)).sin()).sum()
        };
        let samples: Vec<f64> = (0..40_000).map(sample).collect();
        assert_avar(&periodic, &samples, PERIOD_S, &[1, 4, 16, 64, 256], 0.01);
    }
}
