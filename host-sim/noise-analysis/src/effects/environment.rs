//! A bias that follows the temperature or the supply in proportion.

use super::kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, Occurrence};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use measurement::Quantity;
use serde::Serialize;

macro_rules! sensitivity {
    ($(#[$doc:meta])* $kind:ident, $name:literal, $quantity:ident, $per:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
        pub struct $kind {
            #[doc = concat!("In the unit per ", $per, ".")]
            #[serde(skip)]
            pub sensitivity: ChannelEstimate,
            /// Significance, standard deviations.
            pub sigmas: f64,
        }

        impl Kind for $kind {
            const NAME: &'static str = $name;

            fn parameters(&self) -> Vec<(&'static str, Parameter)> {
                vec![("sensitivity", self.sensitivity.parameter_per($per))]
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
                at.followed(Quantity::$quantity, "", self.sensitivity.value)
            }

            fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
                blocks.followed(Quantity::$quantity, "", self.sensitivity.value)
            }
        }
    };
}

sensitivity!(
    /// A sensitivity to temperature.
    TemperatureSensitivity, "temperature", Temperature, "degC"
);
sensitivity!(
    /// A sensitivity to the supply.
    SupplySensitivity, "supply", SupplyVoltage, "V"
);
