//! A bias in proportion to the variance of an acceleration: vibration that an even-order non-linearity rectifies.

use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use super::response::ResponseVariance;
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// A sensitivity to the strength of the vibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VibrationRectification {
    /// In the unit over the square of `per`.
    #[serde(skip)]
    pub sensitivity: ChannelEstimate,
    /// Unit of the accelerometer.
    pub per: &'static str,
    /// Name of the accelerometer.
    pub accelerometer: &'static str,
    /// Root mean square of the strongest vibration, in the unit `per`.
    pub strongest: f64,
    /// Probability of such a sensitivity by chance in white, flicker and walking noise of any mixture.
    pub p_value: f64,
    /// Allan variance of the bias that follows.
    #[serde(skip)]
    pub response: ResponseVariance,
}

impl Kind for VibrationRectification {
    const NAME: &'static str = "vibration_rectification";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("sensitivity", self.sensitivity.parameter_per(&format!("{}^2", self.per)))]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.sensitivity.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.sensitivity.estimate())]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        AddedVariance::corrected(self.response.at(at.n))
    }

    no_course!();
}
