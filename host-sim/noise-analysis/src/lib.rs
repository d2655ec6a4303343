//! Noise analysis: the samples of a sensor and its profile in, findings out.
//!
//! ```text
//! Measurement ─► CondensedRecord ─► preprocessing (detectors) ─► estimators ─► covariates ─► channel_lines ─► channel_fit
//!                      └─► series ─► assessment                                └───────── traced_part ───────────┘ │
//!                                                     report ◄─ causes ◄─ naming ◄─ slow_drift ◄───────────────────┘
//!
//! traced_record: all of this for the whole record      first_half: models of the first half, errors on the second
//! ```
//!
//! A part of a recording, be it the whole, a half or curves alone, is fitted by `traced_part`: the model of each channel
//! (`traced_model`), then the one filter of the sensor by all channels (`part_filter`), with the bounds of the noise behind it
//! (`octave_covariance`). `contradiction` tells where a model fails.
//!
//! Once the filter is agreed on, `nonstationarity` tells whether the noise changes while the record is made, which decides what
//! the models of the first half are fitted to.
//!
//! A [`condensed_record`] has means in the place of samples, of one sample each where the record is short. [`long_record`] condenses a
//! recording that is too long to be kept; `sample_curves` has the curves at the averaging times that are too short for its means.
//!
//! [`quick`] makes the report of the curves alone, from samples that are read in blocks.
//!
//! [`analysis::analyze`] is the pipeline to a [`report::Report`]. `spectra` and `detectors` depend neither on the model nor on
//! the report. [`effects`] has every kind of effect, one file each, as numbers; the crate `reports` has the words.

pub mod analysis;
pub mod assessment;
pub mod bounds;
mod causes;
mod channel_fit;
mod channel_lines;
pub mod comparison;
pub mod condensed_record;
pub mod contradiction;
mod covariates;
pub mod detectors;
pub mod distributions;
pub mod effects;
mod estimators;
mod exclusion;
pub mod figure_data;
pub mod findings;
mod first_half;
mod gapped_cascade;
pub mod gauss_markov;
mod interpolation;
pub mod long_record;
mod minimum;
mod motion;
mod naming;
mod noise_terms;
pub mod nonstationarity;
mod octave_covariance;
pub mod parallel;
mod part_filter;
mod part_report;
mod preprocessing;
pub mod quick;
pub mod report;
mod sample_curves;
mod sample_effects;
mod sample_screen;
mod sampling_faults;
pub mod series;
pub mod several;
#[cfg(test)]
#[path = "../tests/support/simulated_part.rs"]
mod simulated_part;
mod slow_drift;
pub mod spectra;
mod spectral_lines;
mod streamed_curves;
mod traced_model;
mod traced_part;
mod traced_record;
mod unexplained;
mod unexplained_signals;
pub mod uniform_series;
pub mod units;

/// Octaves of every estimator of the analysis: averaging factors up to 2²³ samples. The device uses as many.
pub const OCTAVES: usize = 24;
/// Overlap of the second differences of every estimator of the analysis. The device uses the same.
pub const OVERLAP: usize = 8;
