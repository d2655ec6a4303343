//! A bias that follows the temperature behind a low-pass filter: the sensing element warms up later than the thermometer.

use super::kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, Occurrence};
use super::response::ResponseVariance;
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use measurement::Quantity;
use serde::Serialize;

/// A sensitivity to the temperature of some time ago.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThermalLag {
    /// In the unit per °C.
    #[serde(skip)]
    pub sensitivity: ChannelEstimate,
    /// Time constant of the lag, s.
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    /// Probability of such a sensitivity by chance in white, flicker and walking noise of any mixture.
    pub p_value: f64,
    /// Allan variance of the bias that follows.
    #[serde(skip)]
    pub response: ResponseVariance,
}

impl Kind for ThermalLag {
    const NAME: &'static str = "thermal_lag";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![
            ("sensitivity", self.sensitivity.parameter_per("degC")),
            ("time_constant", self.time_constant_s.parameter("s")),
        ]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.sensitivity.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        vec![Some(self.sensitivity.estimate()), Some(self.time_constant_s)]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        AddedVariance::corrected(self.response.at(at.n))
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        let temperature = blocks.followed(Quantity::Temperature, "", self.sensitivity.value).into_iter();
        temperature.map(|(factor, of)| (factor, low_pass(blocks.time_s, &of, self.time_constant_s.value))).collect()
    }
}

/// `values` behind a low-pass filter of the first order with the time constant `lag`, s, that begins in balance.
fn low_pass(times: &[f64], values: &[f64], lag: f64) -> Vec<f64> {
    let mut state = values.first().copied().unwrap_or(0.0);
    let mut last = times.first().copied().unwrap_or(0.0);
    let follow = |(time, value): (&f64, &f64)| {
        state += (1.0 - (-(time - last) / lag).exp()) * (value - state);
        last = *time;
        state
    };
    times.iter().zip(values).map(follow).collect()
}

#[cfg(test)]
mod tests {
    use super::low_pass;

    #[test]
    fn a_low_pass_follows_a_step_exponentially() {
        let times: Vec<f64> = (0..1000).map(f64::from).collect();
        let step: Vec<f64> = times.iter().map(|time| f64::from(*time >= 1.0)).collect();
        for (time, value) in times.iter().zip(low_pass(&times, &step, 100.0)).skip(1) {
            assert!((value - (1.0 - (-time / 100.0).exp())).abs() < 1e-9, "{time}");
        }
    }
}
