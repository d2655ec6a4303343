//! Rounding: of the angle before the output, and of the values that are recorded.

use super::evidence::CurveEvidence;
use super::kind::{AddedVariance, AveragingTime, Kind, NamedParameter, named};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use crate::distributions::ROUNDING;
use crate::units::coefficient_unit;
use allan_core::NoiseTerm;
use serde::Serialize;

/// Quantization noise, white noise of the angle: its steps, as of a counter or an integrator before the output.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AngleQuantization {
    /// Q, in the unit times s.
    #[serde(skip)]
    pub coefficient: ChannelEstimate,
    pub evidence: CurveEvidence,
}

impl AngleQuantization {
    #[must_use]
    pub fn coefficient_parameter(&self) -> Parameter {
        self.coefficient.estimate().parameter(coefficient_unit(&NoiseTerm::Quantization, self.coefficient.unit))
    }
}

impl Kind for AngleQuantization {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("value", self.coefficient_parameter()).size().lasting()]
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.of_term(&NoiseTerm::Quantization, self.coefficient.value)
    }
}

/// Values that are multiples of several counts: they were rounded before they were recorded.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EffectiveLsb {
    /// Smallest distance of two values; it is exact.
    #[serde(skip)]
    pub step: ChannelEstimate,
    pub counts: u32,
    pub values: usize,
    pub changes: usize,
}

impl Kind for EffectiveLsb {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("step", self.step.parameter()).size().lasting()]
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        // Rounding error is uniform within a step, and white where noise reaches over several steps.
        AddedVariance::modelled(ROUNDING * self.step.value.powi(2) / at.n as f64)
    }
}

/// Noise that does not reach from one count to the next.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NoiseBelowCount {
    /// Allan deviation at the shortest averaging times, where it is nearest to what dithers; 0 if the value never changes. Before the
    /// rounding it may be anything up to the upper bound.
    #[serde(skip)]
    pub deviation: ChannelEstimate,
    pub counts: f64,
    /// Least deviation from which on rounding adds white noise alone, counts.
    pub dithered_counts: f64,
}

impl Kind for NoiseBelowCount {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![named("deviation", self.deviation.parameter()).size().lasting()]
    }
}

/// Values that a converter never gives between others that it gives often: a differential non-linearity of −1 LSB (IEEE Std 1241).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MissingCodes {
    /// Number of codes within the range of the record that never occur.
    pub codes: u32,
    /// The largest distance of which all distances between missing codes are multiples; it is exact.
    #[serde(skip)]
    pub spacing: ChannelEstimate,
    /// Samples that the missing codes would have if each had as many as the rarer of its neighbours.
    pub expected: f64,
}

impl Kind for MissingCodes {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("codes", BoundedEstimate::exact(self.codes.into()).parameter("")),
            named("spacing", self.spacing.parameter()).size().lasting(),
        ]
    }
}
