//! Every test of this crate in one program, so that what it links is compiled and linked once.

mod cascade;
mod confidence;
mod coupling;
mod coverage;
mod fit;
mod gaps;
#[cfg(feature = "host")]
mod host;
mod kurtosis;
mod memory;
mod other_variances;
#[cfg(feature = "serde")]
mod range;
mod regression;
mod samples;
#[cfg(feature = "serde")]
mod serialized;
#[cfg(feature = "serde")]
mod serialized_values;
mod simulated_confidence;
#[path = "support/simulation.rs"]
mod simulation;
mod small_firmware;
mod terms;
mod trace;
