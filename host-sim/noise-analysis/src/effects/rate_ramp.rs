//! A bias that changes in proportion to time.

use super::evidence::CurveEvidence;
use super::kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, Occurrence};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use crate::units::coefficient_unit;
use allan_core::NoiseTerm;
use serde::Serialize;

/// A steady drift.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LinearDrift {
    /// In the unit per s.
    #[serde(skip)]
    pub slope: ChannelEstimate,
    /// What shows it.
    pub evidence: LinearDriftEvidence,
}

/// What shows a steady drift.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LinearDriftEvidence {
    /// The curve.
    Curve(CurveEvidence),
    /// A regression on time.
    Regression {
        /// Probability of such a slope by chance in white, flicker and walking noise of any mixture.
        p_value: f64,
    },
}

impl Kind for LinearDrift {
    const NAME: &'static str = "rate_ramp";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("slope", self.slope_parameter())]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.slope.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.slope.estimate())]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::InChannel
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.of_term(&NoiseTerm::RateRamp, self.slope.value)
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        vec![(self.slope.value, blocks.time_s.to_vec())]
    }
}

impl LinearDrift {
    /// The slope with its unit.
    #[must_use]
    pub fn slope_parameter(&self) -> Parameter {
        self.slope.estimate().parameter(coefficient_unit(&NoiseTerm::RateRamp, self.slope.unit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rate is an angle per second, its slope one per second squared.
    #[test]
    fn a_slope_has_one_unit_whatever_shows_it() {
        let curve = CurveEvidence { excess: 0.1, tau_s: 1.0, sigmas: 9.0, gain_sigmas: 9.0 };
        for evidence in [LinearDriftEvidence::Curve(curve), LinearDriftEvidence::Regression { p_value: 1e-9 }] {
            for (unit, expected) in [("deg/s", "deg/s^2"), ("g", "g/s")] {
                let slope = BoundedEstimate::exact(1e-3).in_unit(unit);
                assert_eq!(LinearDrift { slope, evidence }.slope_parameter().unit, expected);
            }
        }
    }
}
