//! A bias in proportion to the measured supply voltage.

use super::kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, Occurrence};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use measurement::Quantity;

/// A sensitivity to the supply.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SupplySensitivity {
    /// In the unit per V.
    pub sensitivity: ChannelEstimate,
    /// Significance, standard deviations.
    pub sigmas: f64,
}

impl Kind for SupplySensitivity {
    const NAME: &'static str = "supply";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![("sensitivity", self.sensitivity.parameter_per("V"))]
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
        at.followed(Quantity::SupplyVoltage, "", self.sensitivity.value)
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        blocks.followed(Quantity::SupplyVoltage, "", self.sensitivity.value)
    }
}
