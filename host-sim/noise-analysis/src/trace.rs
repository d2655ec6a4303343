//! What the Allan curve cannot show: effects that are traced in the samples themselves.
//!
//! Every detector says how likely the data are with the effect against without, and how probable so much would be
//! by chance anywhere in the record. A [`Finding`] carries the repair that takes the effect out of the data.

mod bias_step;
pub mod block;
pub mod coarse_counts;
pub mod evidence;
pub mod level;
pub mod noises;
mod rate_ramp;
pub mod spikes;
pub mod two_levels;

#[cfg(test)]
mod tests;

pub use crate::distributions as normal;
pub use crate::findings::{Finding, Repair, SIGNIFICANCE};
pub use crate::series::Series;
