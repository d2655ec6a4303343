//! Sleep.

use core::num::NonZeroU8;

/// How long the part sleeps (SLP_CNT).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Sleep {
    /// So many half seconds; then it wakes by itself.
    HalfSeconds(NonZeroU8),
    /// Until it is woken, reset, or powered anew (bit 8). Linux and an Arduino library have this bit; Analog Devices'
    /// register map lists only the eight below it.
    Indefinite,
}
