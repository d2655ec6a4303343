//! The published characterisation, repeated on noise whose coefficients are known.
//!
//! An hour of gyro z at 204.8 SPS from the virtual part, with its default filter and its quantization, seed after seed: the
//! coefficients read off the slopes over the paper's intervals, beside the fit, each with its bias and its scatter. Only
//! here can they be judged: a measured sensor does not tell what is true.

mod experiment;
mod slopes;
mod table;

pub use experiment::{Experiment, Outcome};
pub use slopes::{INTERVALS, read_off};

/// N in deg/√s, B in deg/s, K in deg/s^1.5: what the paper found for its gyro z.
pub const TRUTH: [f64; 3] = [0.0368, 0.0093, 0.0013];
/// Symbols of the three.
pub const SYMBOLS: [&str; 3] = ["N", "B", "K"];
/// Samples a second.
pub const RATE_HZ: f64 = 204.8;
/// Length of the record, s.
pub const SECONDS: f64 = 3600.0;
