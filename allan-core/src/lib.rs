//! Streaming Allan variance of integer samples, its confidence, and a noise model fitted to it, in memory that is fixed
//! at compile time.
//!
//! | step | module | items |
//! |---|---|---|
//! | samples to counts | `quantizer`, `time_stamps` | [`Quantizer`], [`PhaseCounts`], [`TimeStamps`] |
//! | samples to exact sums | `cascade`, `moments` | [`Cascade`], [`Snapshot`] |
//! | sums to a curve | `curve`, [`noise_type`], [`confidence`] | [`Curve`] of [`AllanPoint`]s |
//! | curve to coefficients | [`term`], [`model`], [`fit`] | [`NoiseTerm`], [`Model`], [`fit::fit`] |
//! | residual to missing terms | [`trace`] | [`trace::trace`] |
//! | several channels | `coupling`, [`regression`] | [`Coupling`], [`regression::CovariateRegression`] |
//! | other statistics | `hadamard`, `fractional_octaves`, [`slope_method`], [`telegraph`] | [`Hadamard`], [`FractionalOctaves`] |
//!
//! ```
//! use allan_core::{Cascade, NoiseTerm, fit::fit};
//!
//! let mut cascade = Cascade::<16, 8>::new(); // 16 octaves, 8-fold overlap
//! let mut state = 1_u64;
//! for _ in 0..100_000 {
//!     state = state * 16_807 % 2_147_483_647;
//!     cascade.push((state % 100) as i32); // white noise with a standard deviation of 100/√12 counts
//! }
//! let curve = cascade.curve(0.01); // sample period in s
//! let model = fit(&curve, &[NoiseTerm::AngleRandomWalk]);
//! let n = model.get(NoiseTerm::AngleRandomWalk).unwrap().value; // counts·√s
//! assert!((n / (100.0 / 12.0_f64.sqrt() * 0.1) - 1.0).abs() < 0.02);
//! ```
//!
//! Everything up to the sums is integer arithmetic without rounding. From the curve on it is floating point, computed by
//! the same code on every platform. A microcontroller and a server therefore agree to the bit.
//!
//! New to the Allan variance? The [`guide`] says what it is for, how long to record, and how to choose the parameters.
//!
//! With the feature `serde`, [`Cascade`], [`Coupling`], [`Hadamard`] and [`FractionalOctaves`] can be serialised; a
//! deserialised estimator continues to the bit.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

#[cfg(test)]
extern crate self as allan_core;
#[cfg(test)]
extern crate std; // for the simulation that unit tests share with the integration tests

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;

mod cascade;
pub mod confidence;
mod coupling;
mod curve;
pub mod fit;
#[cfg(feature = "defmt")]
mod formatted;
mod fractional_octaves;
pub mod guide;
mod hadamard;
#[cfg(feature = "host")]
pub mod host;
mod interpolation;
mod list;
mod math;
pub mod model;
mod moments;
pub mod noise_type;
mod quantizer;
pub mod regression;
#[cfg(feature = "serde")]
mod serialized;
#[cfg(test)]
#[path = "../tests/support/simulation.rs"]
mod simulation;
pub mod slope_method;
pub mod telegraph;
pub mod term;
mod time_stamps;
pub mod trace;

pub use cascade::Cascade;
pub use cascade::checkpoint::OctaveSums;
pub use cascade::snapshot::Snapshot;
pub use coupling::{Coupling, Covariance};
pub use curve::{AllanPoint, Curve, CurveView, TableError};
pub use fractional_octaves::FractionalOctaves;
pub use hadamard::{Hadamard, HadamardPoint};
pub use interpolation::Interpolation;
pub use list::{List, ListValues};
pub use model::Model;
pub use noise_type::{PowerLaw, VarianceFractions};
pub use quantizer::{PhaseCounts, Quantizer, SampleError, integer_count};
pub use term::NoiseTerm;
pub use time_stamps::{TimeStampError, TimeStamps};
