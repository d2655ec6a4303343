//! Corrections between sensors.

/// Corrections that the part can make by itself, MSC_CTRL bits 7 and 6.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Compensation {
    /// Takes the effect of linear acceleration out of the gyros' bias.
    pub linear_acceleration: bool,
    /// Refers the three accelerometers to one point.
    pub origin_alignment: bool,
}
