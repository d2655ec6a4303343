//! Kinds of effects that can be added to measured samples.

use crate::undeclared::effect::EffectKind;
use crate::undeclared::outside::OutsideKind;
use serde::Serialize;

/// A kind of effect that is hidden in measured noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HiddenKind {
    Known(EffectKind),
    Outside(OutsideKind),
}

impl HiddenKind {
    /// Every kind that can be added to samples that were measured, in the order of the table.
    pub const ALL: [Self; 24] = [
        Self::Known(EffectKind::Sinusoid),
        Self::Known(EffectKind::Resonance),
        Self::Known(EffectKind::Markov),
        Self::Known(EffectKind::Telegraph),
        Self::Known(EffectKind::Quantization),
        Self::Known(EffectKind::RateRamp),
        Self::Known(EffectKind::CommonMode),
        Self::Known(EffectKind::Spikes),
        Self::Known(EffectKind::BiasStep),
        Self::Known(EffectKind::DroppedSamples),
        Self::Known(EffectKind::RepeatedSamples),
        Self::Outside(OutsideKind::Chirp),
        Self::Outside(OutsideKind::Decays),
        Self::Outside(OutsideKind::Sawtooth),
        Self::Outside(OutsideKind::ModulatedLine),
        Self::Outside(OutsideKind::HeldValue),
        Self::Outside(OutsideKind::AlternatingConverters),
        Self::Outside(OutsideKind::SelfHeating),
        Self::Outside(OutsideKind::DeadTime),
        Self::Outside(OutsideKind::SupplyDroop),
        Self::Outside(OutsideKind::SwitchedLine),
        Self::Outside(OutsideKind::MissingCodes),
        Self::Outside(OutsideKind::WanderingBand),
        Self::Outside(OutsideKind::Knock),
    ];

    /// Its name in the tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Known(kind) => kind.name(),
            Self::Outside(kind) => kind.name(),
        }
    }
}
