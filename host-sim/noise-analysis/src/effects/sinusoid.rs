//! A line no wider than the record resolves.

use super::evidence::{LineEvidence, LineSource, Multiples, SpectrumEvidence};
use super::kind::{AddedVariance, AveragingTime, Kind, amplitude_at_frequency, no_course};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use allan_core::NoiseTerm;
use allan_core::term::Sinusoid;
use serde::Serialize;

/// A steady line.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SinusoidalLine {
    /// Hz
    #[serde(skip)]
    pub frequency_hz: BoundedEstimate,
    /// Amplitude.
    #[serde(skip)]
    pub amplitude: ChannelEstimate,
    /// The lines of the same signal, this one among them; `None` where it is alone.
    pub multiples: Option<Multiples>,
    /// What shows it.
    pub evidence: LineEvidence,
}

impl SinusoidalLine {
    /// Whether it is at half of the sample rate: an offset of every second sample.
    #[must_use]
    pub const fn is_at_half_rate(&self) -> bool {
        matches!(self.evidence.source, LineSource::Spectrum(SpectrumEvidence { is_at_half_rate: true, .. }))
    }
}

impl Kind for SinusoidalLine {
    const NAME: &'static str = "sinusoid";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        let own = [("frequency", self.frequency_hz.parameter("Hz")), ("amplitude", self.amplitude.parameter())];
        own.into_iter().chain(self.multiples.as_ref().map(Multiples::parameter)).collect()
    }

    amplitude_at_frequency!();

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let term = NoiseTerm::Sinusoid(Sinusoid { frequency: self.frequency_hz.value });
        at.of_term(&term, self.amplitude.value)
    }

    no_course!();
}

/// Allan variance of a sinusoid of amplitude 1. Its closed form is that of the alias of a frequency beyond half the sample rate; one of 0 has
/// none.
pub(super) fn avar_of_sine(frequency: f64, n: u64, period_s: f64) -> f64 {
    let avar = NoiseTerm::Sinusoid(Sinusoid { frequency }).avar(n, period_s);
    if avar.is_finite() { avar } else { 0.0 }
}
