//! A sinusoid that was taken out of a record.

use super::line_envelope::MOST_PERIODS;
use super::line_models::Sine;
use super::spectral_line::SpectralLine;
use crate::bounds::MeasuredValue;
use crate::samples::uniform_series::UniformSeries;
use std::f64::consts::PI;

/// A sinusoid that stands out of the noise.
#[derive(Clone, Copy)]
pub(super) struct FoundSine {
    pub sine: Sine,
    /// Noise around it, unit²/Hz.
    pub density: f64,
    /// Probability of such a peak at any frequency, without lines.
    pub p_value: f64,
}

impl FoundSine {
    /// Its ordinate over the noise.
    pub(super) fn over_noise(&self, series: &UniformSeries) -> f64 {
        self.sine.density(series) / self.density
    }

    /// As a line of the spectrum of `series`.
    pub(super) fn line(&self, series: &UniformSeries) -> SpectralLine {
        let (amplitude, ratio) = (self.sine.amplitude(), self.over_noise(series));
        SpectralLine {
            frequency: MeasuredValue {
                value: self.sine.frequency,
                error: 1.5f64.sqrt() / (PI * series.duration() * ratio.sqrt()),
            },
            deviation: MeasuredValue { value: amplitude / 2f64.sqrt(), error: amplitude / (2.0 * ratio.sqrt()) },
            width: None,
            statistic: 2.0 * ratio,
            p_value: self.p_value,
            shape_p_value: 1.0,
            modulation: None,
        }
    }

    /// True if a line at `frequency`, Hz, is distinct but near enough for a sideband.
    pub(super) fn is_near(&self, frequency: f64, duration: f64) -> bool {
        (1.0..=MOST_PERIODS as f64 + 1.0).contains(&self.resolutions_from(frequency, duration))
    }

    pub(super) fn resolutions_from(&self, frequency: f64, duration: f64) -> f64 {
        (self.sine.frequency - frequency).abs() * duration
    }
}
