//! A line that is wider than the record resolves: a damped oscillation, or a frequency that wanders.

use super::evidence::{LineEvidence, Multiples};
use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use allan_core::NoiseTerm;
use allan_core::term::Resonance;
use serde::Serialize;

/// A line with a width.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResonantLine {
    /// Hz
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
    /// What shows it.
    pub evidence: LineEvidence,
}

impl Kind for ResonantLine {
    const NAME: &'static str = "resonance";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        let own = [
            ("frequency", self.frequency_hz.parameter("Hz")),
            ("bandwidth", self.bandwidth_hz.parameter("Hz")),
            ("deviation", self.deviation.parameter()),
        ];
        own.into_iter().chain(self.multiples.as_ref().map(Multiples::parameter)).collect()
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.deviation.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.frequency_hz), None, Some(self.deviation.estimate()), Some(self.bandwidth_hz)]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtFrequency(self.frequency_hz)
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        let (frequency, bandwidth) = (self.frequency_hz.value, self.bandwidth_hz.value);
        let term = NoiseTerm::Resonance(Resonance { frequency, bandwidth });
        at.of_term(&term, self.deviation.value)
    }

    no_course!();
}
