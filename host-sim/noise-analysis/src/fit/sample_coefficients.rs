//! Coefficients by all samples in place of those by the curve, where the curve does not contradict them.

use crate::OCTAVES;
use crate::distributions::DESCRIBED;
use crate::fit::noise_terms::sinusoids;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::{SampleSpectrum, Welch};
use allan_core::fit::goodness;
use allan_core::{Curve, Model};
use serde::Serialize;

/// Largest difference of the durations of the samples and of the curve, as a part of that of the curve.
const SAME_DURATION: f64 = 0.01;

/// What the coefficients of a model are fitted to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CoefficientsFrom {
    /// All samples.
    Samples,
    /// The curve: too many samples are missing or only curves are kept, the channel is not traced, or the model has a ramp.
    #[default]
    Octaves,
    /// The curve, which the coefficients by all samples do not describe: what the record has is not this model.
    OctavesAgainstSamples,
}

/// The samples that a curve was estimated from, less the share of the covariates.
#[derive(Clone, Copy)]
pub(crate) struct SamplesOfCurve<'a> {
    /// The samples, or their means.
    pub rest: &'a UniformSeries,
    /// The spectrum of the samples where the means alone are kept.
    pub spectrum: Option<&'a Welch>,
}

impl SamplesOfCurve<'_> {
    /// Their spectrum without lines at these frequencies in Hz; `None` where too few of the samples of `curve` are kept.
    pub(crate) fn spectrum(&self, curve: &Curve<OCTAVES>, lines: &[f64]) -> Option<SampleSpectrum> {
        let Self { rest, spectrum } = self;
        let samples_per_mean = (rest.sample_period() / curve.sample_period()).round();
        let samples = rest.present() as f64 * samples_per_mean;
        match spectrum {
            _ if samples < (1.0 - SAME_DURATION) * curve.samples() as f64 => None,
            None if samples_per_mean > 1.0 => None,
            None => SampleSpectrum::of_samples(rest, lines),
            Some(spectrum) => SampleSpectrum::of_means(rest, samples_per_mean as u64, spectrum, lines),
        }
    }
}

/// `model`, fitted to `curve`, with the coefficients and the bounds by its samples; otherwise what those of `model` are from.
pub(crate) fn by_samples(
    curve: &Curve<OCTAVES>,
    model: &Model,
    samples: SamplesOfCurve,
) -> Result<Model, CoefficientsFrom> {
    let lines = sinusoids(model.terms().iter().map(|term| &term.kind));
    let fitted = samples.spectrum(curve, &lines).and_then(|spectrum| spectrum.fitted(model));
    let by_samples = fitted.ok_or(CoefficientsFrom::Octaves)?;
    let is_described = goodness(curve, &by_samples).p_value >= DESCRIBED;
    if is_described { Ok(by_samples) } else { Err(CoefficientsFrom::OctavesAgainstSamples) }
}
