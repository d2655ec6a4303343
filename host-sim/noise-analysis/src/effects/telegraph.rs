//! Random telegraph noise: jumps to and fro between two levels at random times.

use super::evidence::CurveEvidence;
use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// Two levels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TelegraphNoise {
    /// Time constant of the autocorrelation, s: half of the mean time between two jumps, where the levels are as frequent.
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    /// Distance of the levels.
    #[serde(skip)]
    pub amplitude: ChannelEstimate,
    /// What tells it from a Markov process.
    pub evidence: TelegraphEvidence,
}

/// What tells random telegraph noise from a Gaussian process of the same spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TelegraphEvidence {
    /// The kurtosis behind the term of the curve.
    Kurtosis {
        /// Excess kurtosis over that of two equally frequent levels.
        ratio: f64,
        /// Standard deviation of the ratio.
        error: f64,
        /// What the curve shows of the term.
        curve: CurveEvidence,
    },
    /// The levels in the samples.
    Levels {
        /// Number of jumps.
        jumps: f64,
        /// Gain in ln likelihood over a Gaussian process of any correlation time.
        gain: f64,
    },
}

impl Kind for TelegraphNoise {
    const NAME: &'static str = "telegraph";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("time_constant", self.time_constant_s.parameter("s")), ("amplitude", self.amplitude.parameter())]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.amplitude.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.time_constant_s), Some(self.amplitude.estimate())]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::InChannel
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        // Two levels that are equally frequent are two standard deviations apart.
        at.of_markov(self.time_constant_s.value, 0.5 * self.amplitude.value)
    }

    no_course!();
}
