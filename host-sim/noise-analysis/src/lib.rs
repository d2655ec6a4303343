//! Noise analysis: the samples of a sensor and its profile in, findings out.
//!
//! ```text
//! Measurement ─► preprocessing (sampling_faults, detectors) ─► estimators ─► covariates ─► spectral_lines ─► channel_fit
//!                      └─► series ─► assessment                                                            │
//!                                                               report ◄─ naming ◄─ slow_drift ◄───────────┘
//! ```
//!
//! `analysis` calls all of these; `nonstationarity` is the second entry, for what changes while the record is made.
//!
//! [`analysis::analyze`] is the pipeline to a [`report::Report`], [`nonstationarity::explain`] the one to an
//! [`nonstationarity::Explanation`]. `spectra` and `detectors` are used by both and
//! depend neither on the model nor on the report.

pub mod analysis;
pub mod assessment;
mod channel_fit;
mod covariates;
pub mod detectors;
pub mod distributions;
mod estimators;
pub mod findings;
mod interpolation;
mod naming;
pub mod nonstationarity;
mod preprocessing;
pub mod report;
mod sampling_faults;
pub mod series;
mod slow_drift;
pub mod spectra;
mod spectral_lines;
pub mod uniform_series;
mod units;

/// Octaves of every estimator of the analysis: averaging factors up to 2²³ samples. The device uses as many.
pub const OCTAVES: usize = 24;
/// Overlap of the second differences of every estimator of the analysis. The device uses the same.
pub const OVERLAP: usize = 8;
