//! Noise analysis: the samples of a sensor and its profile in, findings out.
//!
//! ```text
//! Measurement ─► series ─► preprocessing (time_base, detectors) ─► estimators ─► covariates ─► spectral_lines ─► channel_fit
//!                                                                  └─► slow_drift ─► naming ─► analysis ─► report
//! series ─► assessment: what the model is worth in navigation
//! series ─► nonstationarity: what changes while the record is made
//! ```
//!
//! [`analysis::analyze`] is the pipeline to a [`report::Report`], [`nonstationarity::explain`] the one to an
//! [`nonstationarity::Explanation`]. `spectra` and `detectors` serve both and know
//! neither the model nor the report.

pub mod analysis;
pub mod assessment;
mod channel_fit;
mod covariates;
pub mod detectors;
pub mod distributions;
mod estimators;
pub mod findings;
mod naming;
pub mod nonstationarity;
mod preprocessing;
pub mod report;
pub mod series;
mod slow_drift;
pub mod spectra;
mod spectral_lines;
mod time_base;
pub mod uniform_series;
mod units;

/// Octaves of every estimator of the analysis: averaging factors up to 2²³ samples. The device uses as many.
pub const OCTAVES: usize = 24;
/// Overlap of the second differences of every estimator of the analysis. The device uses the same.
pub const OVERLAP: usize = 8;
