//! A bias that follows a parabola of the measured temperature.

use super::kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, Occurrence};
use super::response::ResponseVariance;
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use measurement::Quantity;
use serde::Serialize;

/// A sensitivity that changes with the temperature.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TemperatureCurvature {
    /// At the reference temperature, in the unit per °C.
    #[serde(skip)]
    pub sensitivity: ChannelEstimate,
    /// Factor of the square, in the unit per °C².
    #[serde(skip)]
    pub curvature: ChannelEstimate,
    /// Temperature at which the parabola is expanded, °C: the mean of the record.
    pub reference_degc: f64,
    /// Probability of such a curvature by chance in white, flicker and walking noise of any mixture.
    pub p_value: f64,
    /// Allan variance of the part that follows the square.
    #[serde(skip)]
    pub response: ResponseVariance,
}

impl Kind for TemperatureCurvature {
    const NAME: &'static str = "temperature_squared";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![
            ("sensitivity", self.sensitivity.parameter_per("degC")),
            ("curvature", self.curvature.parameter_per("degC^2")),
            ("reference", BoundedEstimate::exact(self.reference_degc).parameter("degC")),
        ]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.sensitivity.estimate(), self.curvature.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.sensitivity.estimate()), Some(self.curvature.estimate())]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        // The model has the part that is proportional, and the samples are corrected for the square.
        AddedVariance {
            corrected: self.response.at(at.n),
            ..at.followed(Quantity::Temperature, "", self.sensitivity.value)
        }
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        // Both are about the mean temperature.
        let squares = |(_, means): (f64, Vec<f64>)| means.iter().map(|value| value * value).collect();
        let of_square = blocks.followed(Quantity::Temperature, "", 1.0).into_iter().map(squares);
        let linear = blocks.followed(Quantity::Temperature, "", self.sensitivity.value);
        linear.into_iter().chain(of_square.map(|squares| (self.curvature.value, squares))).collect()
    }
}
