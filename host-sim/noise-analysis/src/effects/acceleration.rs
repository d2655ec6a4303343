//! A rate in proportion to the measured specific force: g-sensitivity of a gyro.

use super::kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, Occurrence};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use measurement::Quantity;
use serde::Serialize;

/// A sensitivity to the specific force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AccelerationSensitivity {
    /// Along x, y and z, in the unit per g; `None` where there is no such channel or the rate does not follow it.
    #[serde(skip)]
    pub sensitivity: [Option<ChannelEstimate>; 3],
    /// Significance of the clearest of them, standard deviations.
    pub sigmas: f64,
}

impl Kind for AccelerationSensitivity {
    const NAME: &'static str = "acceleration";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        let named = |(name, of): (&'static str, Option<ChannelEstimate>)| Some((name, of?.parameter_per("g")));
        NAMES.into_iter().zip(self.sensitivity).filter_map(named).collect()
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        self.sensitivity.into_iter().flatten().map(ChannelEstimate::estimate).collect()
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        self.sensitivity.map(|of| of.map(ChannelEstimate::estimate)).to_vec()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        self.axes().map(|(axis, of)| at.followed(Quantity::SpecificForce, axis, of.value)).sum()
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        self.axes().flat_map(|(axis, of)| blocks.followed(Quantity::SpecificForce, axis, of.value)).collect()
    }
}

/// Of the parameters, by axis.
const NAMES: [&str; 3] = ["sensitivity_x", "sensitivity_y", "sensitivity_z"];

impl AccelerationSensitivity {
    /// Axes in the order of the sensitivities.
    pub const AXES: [&str; 3] = ["x", "y", "z"];

    /// The sensitivities that are known, each with its axis.
    pub fn axes(&self) -> impl Iterator<Item = (&'static str, ChannelEstimate)> {
        Self::AXES.into_iter().zip(self.sensitivity).filter_map(|(axis, of)| Some((axis, of?)))
    }
}
