//! A square wave: a fundamental with its odd harmonics, whose amplitudes fall as 1/k.

use super::evidence::{LineEvidence, Multiples};
use super::kind::{Kind, amplitude_at_frequency, no_variance};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};

/// A signal that is switched.
#[derive(Debug, Clone, PartialEq)]
pub struct SquareWave {
    /// Hz
    pub frequency_hz: BoundedEstimate,
    /// Half the distance of its levels.
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
