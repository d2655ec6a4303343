//! Streaming Allan variance of integer samples, its confidence and a noise model, in memory fixed at compile time.
//!
//! Samples go into a [`Cascade`], which any number of times gives a [`Curve`]: σ²(τ) at octave-spaced averaging
//! times, each with its equivalent degrees of freedom. [`fit`](fit::fit) turns a curve into coefficients with
//! intervals, [`read_off`] into the coefficients that the classical slopes give, and
//! [`ModelError`](check::ModelError) says how far a model is from a curve that it has not seen.
//!
//! ```
//! use allan_core::{Cascade, Kind, fit::fit};
//!
//! let mut cascade = Cascade::<16, 8>::new();
//! let mut state = 1_u64; // any stream of counts
//! for _ in 0..100_000 {
//!     state = state * 16_807 % 2_147_483_647;
//!     cascade.push((state % 100) as i32);
//! }
//! let curve = cascade.curve(0.01);
//! let model = fit(&curve, &[Kind::AngleRandomWalk]);
//! let n = model.terms()[0].value; // counts·√s: the uniform law's √(1/12)·100 times √0.01 s
//! assert!((n / (100.0 / 12.0_f64.sqrt() * 0.1) - 1.0).abs() < 0.02);
//! ```
//!
//! [`Coupling`], [`Hadamard`] and [`Between`] read the running sums that a [`Cascade`] holds anyway: the Allan
//! covariance of two channels, a variance blind to drift, and averaging factors between the octaves. With the feature
//! `serde` all four can be kept, sent and resumed to the bit.
//!
//! Everything up to the curve is integer arithmetic without rounding, so a microcontroller and a server agree to
//! the bit. Everything from the curve on is floating point by the same code and `libm`, so they agree there too.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

#[cfg(test)]
extern crate std;

mod between;
mod cascade;
pub mod check;
mod chi_square;
pub mod common_mode;
pub mod confidence;
mod coupling;
mod curve;
pub mod fit;
mod hadamard;
mod math;
pub mod model;
mod noise_type;
pub mod read_off;
pub mod regression;
#[cfg(feature = "serde")]
mod state;
pub mod telegraph;
pub mod term;
pub mod trace;

pub use between::Between;
pub use cascade::{Cascade, Learnt};
pub use coupling::{Coupling, Covariance};
pub use curve::{Curve, Point};
pub use hadamard::{Hadamard, HadamardPoint};
pub use model::Model;
pub use noise_type::Noise;
pub use term::Kind;
