//! A recording as it is analysed: condensed to means, preprocessed, in curves.

pub mod condensed_record;
pub(crate) mod estimators;
pub mod long_record;
pub(crate) mod preprocessing;
pub(crate) mod sample_curves;
pub(crate) mod sample_effects;
mod sample_screen;
pub(crate) mod sampling_faults;
