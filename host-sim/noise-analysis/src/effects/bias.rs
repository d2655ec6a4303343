//! Changes of the bias over time.

use super::evidence::CurveEvidence;
use super::kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, NamedParameter, Occurrence, named};
use super::response::ResponseVariance;
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use crate::units::coefficient_unit;
use allan_core::NoiseTerm;
use serde::Serialize;

/// A bias that changes in proportion to time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LinearDrift {
    /// In the unit per s.
    #[serde(skip)]
    pub slope: ChannelEstimate,
    pub evidence: LinearDriftEvidence,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LinearDriftEvidence {
    Curve(CurveEvidence),
    /// A regression on time: the probability of such a slope by chance in white, flicker and walking noise of any mixture.
    Regression {
        p_value: f64,
    },
}

impl LinearDrift {
    #[must_use]
    pub fn slope_parameter(&self) -> Parameter {
        self.slope.estimate().parameter(coefficient_unit(&NoiseTerm::RateRamp, self.slope.unit))
    }
}

impl Kind for LinearDrift {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("slope", self.slope_parameter()).size().lasting()]
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.of_term(&NoiseTerm::RateRamp, self.slope.value)
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        vec![(self.slope.value, blocks.time_s.to_vec())]
    }
}

/// A bias that becomes another one from one sample to the next.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LevelStep {
    #[serde(skip)]
    pub time_s: BoundedEstimate,
    /// New level less the old one.
    #[serde(skip)]
    pub size: ChannelEstimate,
    pub p_value: f64,
}

impl Kind for LevelStep {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("time", self.time_s.parameter("s")), named("size", self.size.parameter()).size()]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::AtTime { from_s: self.time_s.low, to_s: self.time_s.high }
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        // The squared second differences that it touches, averaged over all of them.
        match (at.samples + 1).checked_sub(2 * at.n) {
            None | Some(0) => AddedVariance::NONE,
            Some(count) => AddedVariance::corrected(self.size.value.powi(2) * at.n as f64 / (3.0 * count as f64)),
        }
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        vec![(self.size.value, blocks.time_s.iter().map(|time| f64::from(*time >= self.time_s.value)).collect())]
    }
}

/// A bias that settles exponentially after the start of the record, as of a part that warms itself after it was turned on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TurnOnTransient {
    /// Bias at the start less the bias that it settles to.
    #[serde(skip)]
    pub size: ChannelEstimate,
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    pub p_value: f64,
    #[serde(skip)]
    pub response: ResponseVariance,
}

impl Kind for TurnOnTransient {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("size", self.size.parameter()).size(), named("time_constant", self.time_constant_s.parameter("s"))]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::OnceAUnit
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        AddedVariance::corrected(self.response.at(at.tau_s()))
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        let settling = |time: &f64| (-time / self.time_constant_s.value).exp();
        vec![(self.size.value, blocks.time_s.iter().map(settling).collect())]
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
