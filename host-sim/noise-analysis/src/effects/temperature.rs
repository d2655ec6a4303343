//! A bias in proportion to the measured temperature.

use super::kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, Occurrence};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use measurement::Quantity;

/// A sensitivity to temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TemperatureSensitivity {
    /// In the unit per °C.
    pub sensitivity: ChannelEstimate,
    /// Significance, standard deviations.
    pub sigmas: f64,
}

impl Kind for TemperatureSensitivity {
    const NAME: &'static str = "temperature";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("sensitivity", self.sensitivity.parameter_per("degC"))]
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
        at.followed(Quantity::Temperature, "", self.sensitivity.value)
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        blocks.followed(Quantity::Temperature, "", self.sensitivity.value)
    }
}
