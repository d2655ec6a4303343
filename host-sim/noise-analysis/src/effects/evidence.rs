//! Evidence that several kinds of effects share.

use super::kind::{NamedParameter, named};
use crate::bounds::BoundedEstimate;
use serde::Serialize;

/// The largest departure of the curve from the model without an added term.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CurveEvidence {
    /// `σ/σ_model − 1` at the averaging time where it is most significant.
    pub excess: f64,
    pub tau_s: f64,
    pub sigmas: f64,
    /// Gain of the fit by the term, in standard deviations.
    pub gain_sigmas: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LineEvidence {
    pub has_width: bool,
    pub source: LineSource,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LineSource {
    Curve(CurveEvidence),
    Spectrum(SpectrumEvidence),
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpectrumEvidence {
    pub frequency_hz: f64,
    /// True if that is half of the sample rate: an offset of every second sample.
    pub is_at_half_rate: bool,
    /// Full width at half maximum, Hz; `None` of a line no wider than the record resolves.
    pub width_hz: Option<f64>,
    /// Significance of the strongest peak, standard deviations.
    pub sigmas: f64,
    pub p_value: f64,
}

/// The lines of one periodic signal.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Multiples {
    /// Numbers of the harmonics, by frequency.
    pub harmonics: Vec<u32>,
    /// Number of sidebands of these.
    pub sidebands: usize,
}

impl Multiples {
    #[must_use]
    pub fn count(&self) -> usize {
        self.harmonics.len() + self.sidebands
    }

    pub(super) fn parameter(&self) -> NamedParameter {
        named("harmonics", BoundedEstimate::exact(self.count() as f64).parameter(""))
    }
}
