//! Detectors of effects in the samples of one channel that the Allan curve hardly shows.
//!
//! ```text
//! Series ─┬► noise_levels ─┬► knocks ─► knock_search       stretches that are louder than those around them
//!         │                └► level_change, level_wandering
//!         │                                                a level that becomes another one, or that grows and falls
//!         ├► prediction ─► spikes                          single samples
//!         ├► effective_lsb                                 values rounded to several counts
//!         ├► output_range                                  values that are cut off, and noise below a count
//!         ├► stuck_output                                  an output that stays at one value
//!         └► block_means, noise_grid ─► gls_regression ─► bias
//!                                                          steps, ramps, transients (turn_on), covariates of the bias:
//!                                                          thermal_response, vibration_rectification (bias_response)
//! UniformSeries ─► random_telegraph                        jumps to and fro between two levels
//! ```
//!
//! Each returns the effect with its parameters and, if there is one, the correction that removes it from the samples.

pub(crate) mod bias;
pub(crate) mod bias_response;
mod bias_step;
pub(crate) mod block_cosines;
pub mod block_means;
mod change_point;
pub(crate) mod effective_lsb;
pub mod gls_regression;
pub(crate) mod knock_search;
pub(crate) mod knocks;
pub(crate) mod level_change;
mod level_wandering;
mod log_levels;
pub mod noise_grid;
mod noise_levels;
pub(crate) mod output_range;
mod prediction;
pub(crate) mod random_telegraph;
pub(crate) mod spikes;
pub(crate) mod stuck_output;
mod telegraph_models;
pub(crate) mod thermal_response;
mod time_constant;
mod turn_on;
pub(crate) mod vibration_rectification;

#[cfg(test)]
mod knock_tests;
#[cfg(test)]
mod tests;
