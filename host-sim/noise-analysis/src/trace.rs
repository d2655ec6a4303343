//! What the Allan curve cannot show: effects that are traced in the samples themselves.
//!
//! Every detector says how likely the data are with the effect against without, and how probable so much would be
//! by chance anywhere in the record. A [`Finding`] carries the repair that takes the effect out of the data.

mod bias_step;
pub mod block;
pub mod coarse_counts;
pub mod deliveries;
pub mod evidence;
pub mod level;
pub mod noises;
pub mod normal;
mod rate_ramp;
pub mod sample_clock;
pub mod series;
pub mod spikes;
pub mod two_levels;

#[cfg(test)]
mod tests;

pub use series::{Repair, Series};

use crate::report::{Effect, Parameter};
use std::collections::BTreeMap;

/// Highest probability, over the whole record of a channel, of a finding where there is nothing.
pub const SIGNIFICANCE: f64 = 2e-4;

/// An effect that was found in the samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// As reported.
    pub effect: Effect,
    /// −2 ln of the likelihood without the effect over that with it.
    pub deviance: f64,
    /// Probability of as much by chance anywhere in the record.
    pub p_value: f64,
    /// What takes the effect out of the channel's data.
    pub repair: Repair,
}

fn parameter(value: f64, low: f64, high: f64, unit: &str) -> Parameter {
    Parameter { value, low, high, unit: unit.to_owned() }
}

fn effect<const COUNT: usize>(kind: &str, parameters: [(&str, Parameter); COUNT], evidence: String) -> Effect {
    let parameters: BTreeMap<String, Parameter> =
        parameters.into_iter().map(|(name, parameter)| (name.to_owned(), parameter)).collect();
    Effect { kind: kind.to_owned(), parameters, evidence }
}
