//! Exponentially correlated noise: a first-order Gauss-Markov process.

use super::evidence::CurveEvidence;
use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// A Markov process.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MarkovProcess {
    /// Standard deviation.
    #[serde(skip)]
    pub deviation: ChannelEstimate,
    /// Correlation time, s.
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    /// What shows it.
    pub evidence: MarkovEvidence,
}

/// What shows a Markov process.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MarkovEvidence {
    /// The curve.
    Curve(CurveEvidence),
    /// The spectrum, which is flat below a corner where a random walk would rise.
    Spectrum {
        /// Hz
        corner_hz: f64,
        /// Gain in ln likelihood.
        gain: f64,
    },
}

impl MarkovProcess {
    /// Averaging time of the largest Allan deviation, in time constants (IEEE Std 952, annex C).
    pub(crate) const PEAK: f64 = 1.89;
}

impl Kind for MarkovProcess {
    const NAME: &'static str = "markov";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("deviation", self.deviation.parameter()), ("time_constant", self.time_constant_s.parameter("s"))]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.deviation.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.deviation.estimate()), Some(self.time_constant_s)]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::InChannel
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.of_markov(self.time_constant_s.value, self.deviation.value)
    }

    no_course!();
}
