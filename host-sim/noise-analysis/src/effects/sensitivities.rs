//! Biases that follow what the sensor measures beside: temperature, supply, acceleration.

use super::kind::{AddedVariance, AveragingTime, BiasBlocks, Kind, NamedParameter, Occurrence, named};
use super::response::ResponseVariance;
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use measurement::Quantity;
use serde::Serialize;

/// A bias in proportion to the temperature.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TemperatureSensitivity {
    /// In the unit per degC.
    #[serde(skip)]
    pub sensitivity: ChannelEstimate,
    pub sigmas: f64,
}

impl Kind for TemperatureSensitivity {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("sensitivity", self.sensitivity.parameter_per("degC")).size().lasting()]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.followed(Quantity::Temperature, "", self.sensitivity.value)
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        blocks.followed(Quantity::Temperature, "", self.sensitivity.value)
    }
}

/// A bias in proportion to the supply voltage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SupplySensitivity {
    /// In the unit per V.
    #[serde(skip)]
    pub sensitivity: ChannelEstimate,
    pub sigmas: f64,
}

impl Kind for SupplySensitivity {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("sensitivity", self.sensitivity.parameter_per("V")).size().lasting()]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.followed(Quantity::SupplyVoltage, "", self.sensitivity.value)
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        blocks.followed(Quantity::SupplyVoltage, "", self.sensitivity.value)
    }
}

/// A bias that follows a parabola of the temperature.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TemperatureCurvature {
    /// At the reference temperature, in the unit per °C.
    #[serde(skip)]
    pub sensitivity: ChannelEstimate,
    /// Factor of the square, in the unit per °C².
    #[serde(skip)]
    pub curvature: ChannelEstimate,
    /// Temperature at which the parabola is expanded, °C: the mean of the record.
    pub reference_degc: f64,
    pub p_value: f64,
    /// Allan variance of the part that follows the square.
    #[serde(skip)]
    pub response: ResponseVariance,
}

impl Kind for TemperatureCurvature {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("sensitivity", self.sensitivity.parameter_per("degC")).size().lasting(),
            named("curvature", self.curvature.parameter_per("degC^2")).size().lasting(),
            named("reference", BoundedEstimate::exact(self.reference_degc).parameter("degC")),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        // The model has the part that is proportional, and the samples are corrected for the square.
        AddedVariance {
            corrected: self.response.at(at.tau_s()),
            ..at.followed(Quantity::Temperature, "", self.sensitivity.value)
        }
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        // Both are about the mean temperature.
        let squares = |(_, means): (f64, Vec<f64>)| means.iter().map(|value| value * value).collect();
        let of_square = blocks.followed(Quantity::Temperature, "", 1.0).into_iter().map(squares);
        let linear = blocks.followed(Quantity::Temperature, "", self.sensitivity.value);
        linear.into_iter().chain(of_square.map(|squares| (self.curvature.value, squares))).collect()
    }
}

/// A bias that follows the temperature behind a low-pass filter: the sensing element warms up later than the thermometer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThermalLag {
    /// In the unit per °C.
    #[serde(skip)]
    pub sensitivity: ChannelEstimate,
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    pub p_value: f64,
    #[serde(skip)]
    pub response: ResponseVariance,
}

impl Kind for ThermalLag {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("sensitivity", self.sensitivity.parameter_per("degC")).size().lasting(),
            named("time_constant", self.time_constant_s.parameter("s")).lasting(),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        AddedVariance::corrected(self.response.at(at.tau_s()))
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

/// A rate in proportion to the measured specific force: g-sensitivity of a gyro.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AccelerationSensitivity {
    /// Along x, y and z, in the unit per g; `None` where there is no such channel or the rate does not follow it.
    #[serde(skip)]
    pub sensitivity: [Option<ChannelEstimate>; 3],
    pub sigmas: f64,
}

impl Kind for AccelerationSensitivity {
    fn parameters(&self) -> Vec<NamedParameter> {
        const NAMES: [&str; 3] = ["sensitivity_x", "sensitivity_y", "sensitivity_z"];
        let by_axis = NAMES.into_iter().zip(self.sensitivity);
        by_axis.filter_map(|(name, of)| Some(named(name, of?.parameter_per("g")).size().lasting())).collect()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        self.axes().map(|(axis, of)| at.followed(Quantity::SpecificForce, axis, of.value)).sum()
    }

    fn course(&self, blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        self.axes().flat_map(|(axis, of)| blocks.followed(Quantity::SpecificForce, axis, of.value)).collect()
    }
}

impl AccelerationSensitivity {
    /// Axes in the order of the sensitivities.
    pub const AXES: [&str; 3] = ["x", "y", "z"];

    pub fn axes(&self) -> impl Iterator<Item = (&'static str, ChannelEstimate)> {
        Self::AXES.into_iter().zip(self.sensitivity).filter_map(|(axis, of)| Some((axis, of?)))
    }
}

/// A bias in proportion to the variance of an acceleration: vibration that an even-order non-linearity rectifies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VibrationRectification {
    /// In the unit over the square of `per`.
    #[serde(skip)]
    pub sensitivity: ChannelEstimate,
    /// Unit of the accelerometer.
    pub per: &'static str,
    pub accelerometer: &'static str,
    /// Root mean square of the strongest vibration, in the unit `per`.
    pub strongest: f64,
    pub p_value: f64,
    #[serde(skip)]
    pub response: ResponseVariance,
}

impl Kind for VibrationRectification {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("sensitivity", self.sensitivity.parameter_per(&format!("{}^2", self.per))).size().lasting()]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::Once
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        AddedVariance::corrected(self.response.at(at.tau_s()))
    }
}

/// Drift that a channel shares with another one, too large to be caused by what that one measures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SharedDrift {
    /// Drift of the channel over that of the other one, in the unit over `per`.
    #[serde(skip)]
    pub ratio: ChannelEstimate,
    /// Unit of the other channel.
    pub per: &'static str,
    pub with: &'static str,
    pub sigmas: f64,
    /// The largest plausible sensitivity over the data sheet's.
    pub largest_multiple: f64,
}

impl Kind for SharedDrift {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("ratio", self.ratio.parameter_per(self.per)).size().lasting()]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::OnceAUnit
    }
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
