//! Samples on a time base: series of a channel, with and without gaps, and their estimators.

pub(crate) mod epoch_ranges;
pub(crate) mod exclusion;
pub(crate) mod gapped_cascade;
pub(crate) mod interpolation;
pub(crate) mod neighbouring_gaps;
pub(crate) mod rounding;
pub mod series;
pub(crate) mod streamed_curves;
pub mod uniform_series;
