//! Steady lines of the spectrum.

use super::evidence::{LineEvidence, LineSource, Multiples, SpectrumEvidence};
use super::kind::{AddedVariance, AveragingTime, Kind, NamedParameter, Occurrence, named};
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use allan_core::NoiseTerm;
use allan_core::term::{Resonance, Sinusoid};
use serde::Serialize;

/// A line no wider than the record resolves.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SinusoidalLine {
    #[serde(skip)]
    pub frequency_hz: BoundedEstimate,
    #[serde(skip)]
    pub amplitude: ChannelEstimate,
    /// The lines of the same signal, this one among them; `None` where it is alone.
    pub multiples: Option<Multiples>,
    pub evidence: LineEvidence,
}

impl SinusoidalLine {
    /// True if it is at half of the sample rate: an offset of every second sample.
    #[must_use]
    pub const fn is_at_half_rate(&self) -> bool {
        matches!(self.evidence.source, LineSource::Spectrum(SpectrumEvidence { is_at_half_rate: true, .. }))
    }
}

impl Kind for SinusoidalLine {
    fn parameters(&self) -> Vec<NamedParameter> {
        let own = [
            named("frequency", self.frequency_hz.parameter("Hz")).lasting(),
            named("amplitude", self.amplitude.parameter()).size().lasting(),
        ];
        own.into_iter().chain(self.multiples.as_ref().map(Multiples::parameter)).collect()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtFrequency(self.frequency_hz)
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let term = NoiseTerm::Sinusoid(Sinusoid { frequency: self.frequency_hz.value });
        at.of_term(&term, self.amplitude.value)
    }
}

/// A line that is wider than the record resolves: a damped oscillation, or a frequency that wanders.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResonantLine {
    #[serde(skip)]
    pub frequency_hz: BoundedEstimate,
    /// Full width at half maximum, Hz.
    #[serde(skip)]
    pub bandwidth_hz: BoundedEstimate,
    /// Standard deviation of the whole band.
    #[serde(skip)]
    pub deviation: ChannelEstimate,
    /// The lines of the same signal, this one among them; `None` where it is alone.
    pub multiples: Option<Multiples>,
    pub evidence: LineEvidence,
}

impl Kind for ResonantLine {
    fn parameters(&self) -> Vec<NamedParameter> {
        let own = [
            named("frequency", self.frequency_hz.parameter("Hz")).lasting(),
            named("bandwidth", self.bandwidth_hz.parameter("Hz")).lasting(),
            named("deviation", self.deviation.parameter()).size().lasting(),
        ];
        own.into_iter().chain(self.multiples.as_ref().map(Multiples::parameter)).collect()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtFrequency(self.frequency_hz)
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let (frequency, bandwidth) = (self.frequency_hz.value, self.bandwidth_hz.value);
        let term = NoiseTerm::Resonance(Resonance { frequency, bandwidth });
        at.of_term(&term, self.deviation.value)
    }
}

/// A square wave: a fundamental with its odd harmonics, whose amplitudes fall as 1/k.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SquareWave {
    #[serde(skip)]
    pub frequency_hz: BoundedEstimate,
    /// Half the distance of its levels.
    #[serde(skip)]
    pub amplitude: ChannelEstimate,
    pub multiples: Multiples,
    /// Evidence of the lowest of them.
    pub line: LineEvidence,
}

impl Kind for SquareWave {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("frequency", self.frequency_hz.parameter("Hz")).lasting(),
            named("amplitude", self.amplitude.parameter()).size().lasting(),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtFrequency(self.frequency_hz)
    }
}
