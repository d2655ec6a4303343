//! Noise analysis: the samples of a sensor and its profile in, findings out.
//!
//! ```text
//! Measurement ─► record: CondensedRecord ─► preprocessing (detectors) ─► estimators ─┐
//!                                                                                    ▼
//!       report ◄─ rivals: causes ◄─ table ◄─ proposals ◄─ fit: channel_fit ◄─ covariates, lines of the spectra
//! ```
//!
//! | folder | stage |
//! |---|---|
//! | `samples` | series on a time base, and the estimators that are fed with them |
//! | `detectors`, `spectra` | what samples and their spectra show, without a model |
//! | `record` | a recording, condensed to means, preprocessed, in curves |
//! | `effects` | every kind of effect, by theme, as numbers; the crate `reports` has the words |
//! | `fit` | the noise model of one channel, how it is edited, and the filter that all channels share |
//! | `rivals` | what is proposed for a channel, the [table](rivals::table) that tells what stands, and which findings are one cause |
//! | `halves` | the fit of a part: the whole, and the first half with its errors on the second |
//! | `nonstationarity` | whether the noise changes while the record is made, and what the models are fitted to then |
//! | `report` | what is reported of a channel and of the sensor |
//!
//! [`analysis::analyze`] is the pipeline from a recording to its [`report::Report`]. [`quick`] makes the report of the curves alone, from
//! samples that are read in blocks. Either fits a part of a recording by one function, `halves::traced_part`. A record has means in the
//! place of samples, of one sample each where it is short; [`record::long_record`] condenses a recording that is too long to be kept.

pub mod analysis;
pub mod bounds;
pub mod detectors;
pub mod distributions;
pub mod effects;
pub mod fit;
mod halves;
mod minimum;
pub mod nonstationarity;
pub mod parallel;
pub mod quick;
pub mod record;
pub mod report;
pub mod rivals;
mod robust;
pub mod samples;
#[cfg(test)]
#[path = "../tests/support/simulated_part.rs"]
mod simulated_part;
pub mod spectra;
pub mod units;

/// Octaves of every estimator of the analysis: averaging factors up to 2²³ samples. The device uses as many.
pub const OCTAVES: usize = 24;
/// Overlap of the second differences of every estimator of the analysis. The device uses the same.
pub const OVERLAP: usize = 8;
