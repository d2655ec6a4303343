//! A square wave: a fundamental with its odd harmonics, whose amplitudes fall as 1/k.

use super::evidence::{LineEvidence, Multiples};
use super::kind::{Kind, amplitude_at_frequency, no_variance};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// A signal that is switched.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SquareWave {
    /// Hz
    #[serde(skip)]
    pub frequency_hz: BoundedEstimate,
    /// Half the distance of its levels.
    #[serde(skip)]
    pub amplitude: ChannelEstimate,
    /// Its lines.
    pub multiples: Multiples,
    /// What shows the lowest of them.
    pub line: LineEvidence,
}

impl Kind for SquareWave {
    const NAME: &'static str = "square_wave";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("frequency", self.frequency_hz.parameter("Hz")), ("amplitude", self.amplitude.parameter())]
    }

    amplitude_at_frequency!();

    no_variance!();
}
