//! Kinds of effects that can be added to measured samples.

use crate::undeclared::effect::EffectKind;
use crate::undeclared::outside::OutsideKind;
use clap::ValueEnum;
use serde::Serialize;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HiddenKind {
    Known(EffectKind),
    Outside(OutsideKind),
}

impl HiddenKind {
    /// Every kind that can be added to samples that were measured, in the order of the table.
    pub fn all() -> Vec<Self> {
        use EffectKind::{Acceleration, FilterBandwidth, SampleClock, Supply, Temperature};
        let is_of_sensor =
            |kind: &EffectKind| matches!(kind, Acceleration | FilterBandwidth | SampleClock | Supply | Temperature);
        let of_sensor = |kind: &OutsideKind| matches!(kind, OutsideKind::ClockStep | OutsideKind::LevelByTemperature);
        let known = EffectKind::ALL.into_iter().filter(|kind| !is_of_sensor(kind)).map(Self::Known);
        let outside = OutsideKind::value_variants().iter().copied().filter(|kind| !of_sensor(kind));
        known.chain(outside.map(Self::Outside)).collect()
    }
}
