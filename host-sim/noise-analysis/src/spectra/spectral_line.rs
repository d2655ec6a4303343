//! A line that stands out of the background of a spectrum.

use super::line_envelope::Modulation;
use super::line_models::Lorentz;
use crate::bounds::MeasuredValue;

/// Distance of sidebands beyond the taper's side lobes, and largest difference of their distances, resolutions of a spectrum without phases.
const LOBE_RESOLUTIONS: f64 = 2.5;
const LEAST_SYMMETRIC: f64 = 0.5;
/// Largest relative difference of equal sidebands, and in standard deviations.
const SIDEBAND_RATIO: f64 = 0.25;
const SIDEBAND_SIGMAS: f64 = 3.0;

/// A line that stands out of the background.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectralLine {
    /// Hz.
    pub frequency: MeasuredValue,
    /// For the line's signal, in the unit of the series: 1/√2 of a sinusoid's amplitude.
    pub deviation: MeasuredValue,
    /// Full width at half maximum, Hz; `None` for a sinusoid.
    pub width: Option<MeasuredValue>,
    /// −2 log-likelihood ratio of the background against background and line.
    pub statistic: f64,
    /// Probability of such a peak at any frequency, without lines.
    pub p_value: f64,
    /// p-value as a resonance; 1 of a sinusoid.
    pub shape_p_value: f64,
    /// Periodic change of a line without a width; `None` if it may be constant.
    pub modulation: Option<Modulation>,
}

impl SpectralLine {
    /// Amplitude of the sinusoid; for a resonance, of a sinusoid of the same power.
    #[must_use]
    pub fn amplitude(&self) -> MeasuredValue {
        let root = 2f64.sqrt();
        MeasuredValue { value: root * self.deviation.value, error: root * self.deviation.error }
    }

    /// True if a weaker line is a sideband of this one in a record of `duration`, s.
    pub(super) fn has_sideband(&self, other: &Self, duration: f64) -> bool {
        let distance = other.frequency.value - self.frequency.value;
        other.deviation.value < self.deviation.value
            && self.modulation.is_some_and(|change| change.is_sideband(distance, duration))
    }

    /// The change of a sinusoid with two others equally far from it and equally strong, in a spectrum of this `resolution`, Hz, which has
    /// no phases.
    pub(super) fn modulation_by_sidebands(&self, sides: [&Self; 2], resolution: f64) -> Option<Modulation> {
        let [one, other] = sides;
        let distances = sides.map(|side| (side.frequency.value - self.frequency.value) / resolution);
        let is_beside = distances.iter().all(|distance| distance.abs() > LOBE_RESOLUTIONS);
        let is_symmetric = distances.iter().sum::<f64>().abs() < LEAST_SYMMETRIC;
        let mean = 0.5 * (one.deviation.value + other.deviation.value);
        let error = one.deviation.error.hypot(other.deviation.error);
        let difference = (one.deviation.value - other.deviation.value).abs();
        let is_equal = difference < SIDEBAND_RATIO * mean + SIDEBAND_SIGMAS * error;
        let are_sinusoids = [self, one, other].iter().all(|of| of.width.is_none());
        // A sideband has half the depth.
        let over_line = 2.0 / self.deviation.value;
        let statistic = one.statistic + other.statistic;
        (is_beside && is_symmetric && is_equal && are_sinusoids).then(|| Modulation {
            frequency: MeasuredValue {
                value: 0.5 * (one.frequency.value - other.frequency.value).abs(),
                error: 0.5 * one.frequency.error.hypot(other.frequency.error),
            },
            depth: MeasuredValue { value: over_line * mean, error: 0.5 * over_line * error },
            of_phase: false,
            statistic,
            with_multiples: statistic,
        })
    }
}

#[derive(Clone, Copy)]
pub(super) struct Resonance {
    pub line: SpectralLine,
    pub lorentz: Lorentz,
}
