#![doc = include_str!("../README.md")]
//! # Modules
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
//! Everything up to the sums is integer arithmetic without rounding; from the curve on, floating point gives the same
//! bits on every platform.
//!
//! The [`guide`] says how long to record and how to choose the parameters.
//!
//! With the feature `serde`, [`Cascade`], [`Coupling`], [`Hadamard`] and [`FractionalOctaves`] can be serialised; a
//! deserialised estimator continues to the bit.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

#[cfg(test)]
extern crate self as allan_core;
#[cfg(test)]
extern crate std; // for the simulation that unit tests share with the integration tests

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
