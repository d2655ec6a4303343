//! Coefficients by all samples in place of those by the curve, where the curve does not contradict them.

use crate::OCTAVES;
use crate::distributions::DESCRIBED;
use crate::fit::noise_terms::sinusoids;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::{SampleSpectrum, Welch};
use allan_core::fit::goodness;
use allan_core::{Curve, Model, NoiseTerm};
use serde::Serialize;

/// Largest difference of the durations of the samples and of the curve, as a part of that of the curve.
const SAME_DURATION: f64 = 0.01;
/// Segments of Welch's spectrum, half-overlapping ones not counted, and samples of the longest one: it resolves the nulls of 2 × 128 taps.
const LEAST_SEGMENTS: usize = 16;
const LONGEST_SEGMENT: usize = 2048;

/// The data that the coefficients of a model are fitted to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CoefficientsFrom {
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
    /// Their spectrum without lines at these frequencies, Hz; `None` where too few samples of `curve` are kept, or there is a long gap.
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

    /// Their Welch spectrum, which leaves out long gaps, without lines at these frequencies, Hz; `None` where means alone are kept.
    pub(crate) fn averaged_spectrum(&self, curve: &Curve<OCTAVES>, lines: &[f64]) -> Option<SampleSpectrum> {
        let of = |spectrum: &Welch, interpolated: f64| {
            SampleSpectrum::of_welch(spectrum, self.rest.rounding(), lines, interpolated)
        };
        if let Some(spectrum) = self.spectrum {
            return Some(of(spectrum, curve.points().first().map_or(0.0, |point| point.replaced)));
        }
        let length = (self.rest.present() / LEAST_SEGMENTS).clamp(1, LONGEST_SEGMENT).ilog2();
        let spectrum = self.are_samples(curve).then(|| Welch::estimate(self.rest, 1 << length))?;
        Some(of(&spectrum?, self.rest.interpolated().1))
    }

    /// The spectrum of their longest part without a gap that interpolation does not close; `None` where the means alone are kept.
    fn spectrum_without_gaps(&self, curve: &Curve<OCTAVES>, lines: &[f64]) -> Option<SampleSpectrum> {
        self.are_samples(curve).then(|| SampleSpectrum::of_samples(&self.rest.longest_interpolated(), lines))?
    }

    /// True if they are the samples of `curve` and not their means.
    fn are_samples(&self, curve: &Curve<OCTAVES>) -> bool {
        self.rest.sample_period() < 1.5 * curve.sample_period()
    }
}

/// Twice the gain in ln likelihood of the samples of `curve` with `one` model over the `other` one, which has as many terms and the same lines;
/// `None` where the spectrum of the samples is not known.
pub(crate) fn gain_by_samples(
    curve: &Curve<OCTAVES>,
    [one, other]: [&Model; 2],
    samples: SamplesOfCurve,
) -> Option<f64> {
    let lines = sinusoids(one.terms().iter().map(|term| &term.kind));
    let spectrum = samples.spectrum(curve, &lines)?;
    Some(spectrum.gain(one, other))
}

/// Probability that the spectrum of the `samples`, or that of their longest part without a long gap, contradicts as much the quantization of
/// `model`; `None` where it has none, or too few samples tell its shape.
pub(crate) fn quantization_p_value(curve: &Curve<OCTAVES>, model: &Model, samples: SamplesOfCurve) -> Option<f64> {
    let at = model.terms().iter().position(|term| term.kind == NoiseTerm::Quantization)?;
    let lines = sinusoids(model.terms().iter().map(|term| &term.kind));
    let of_all = samples.spectrum(curve, &lines).and_then(|spectrum| spectrum.term_p_value(model, at));
    of_all.or_else(|| samples.spectrum_without_gaps(curve, &lines)?.term_p_value(model, at))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::findings::REFUTED;
    use allan_core::model::FittedTerm;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    const PERIOD_S: f64 = 0.01;
    const SAMPLES: usize = 12_000;
    const DEVIATION: f64 = 100.0;
    const KINDS: [NoiseTerm; 4] =
        [NoiseTerm::AngleRandomWalk, NoiseTerm::BiasInstability, NoiseTerm::RateRandomWalk, NoiseTerm::Quantization];

    /// Q of [`angle_error`], in counts times s: the deviation of the errors of the angle.
    const QUANTIZATION: f64 = DEVIATION * std::f64::consts::FRAC_1_SQRT_2 * PERIOD_S;

    /// Probability of a quantization of at least `low` in white noise and what is `added`; one of so many samples is missing.
    fn p_value(seed: u64, low: f64, one_of: usize, mut added: impl FnMut(&mut ChaCha8Rng) -> f64) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut values = Vec::new();
        for at in 0..SAMPLES {
            let value = (added(&mut random) + DEVIATION * random.sample::<f64, _>(StandardNormal)).round();
            values.push(if at % one_of == 40 { f64::NAN } else { value });
        }
        let spectrum = SampleSpectrum::of_samples(&UniformSeries::new(PERIOD_S, values), &[]).expect("a spectrum");
        let model = Model::new(PERIOD_S, KINDS.map(|kind| FittedTerm::exact(kind, low)));
        spectrum.term_p_value(&model, 3).expect("few are interpolated")
    }

    /// Rates by an angle with white errors, of the same power as the noise: differences of errors that have half of it.
    fn angle_error() -> impl FnMut(&mut ChaCha8Rng) -> f64 {
        let mut last = 0.0;
        move |random| {
            let error = DEVIATION / 2_f64.sqrt() * random.sample::<f64, _>(StandardNormal);
            let difference = error - last;
            last = error;
            difference
        }
    }

    /// True quantization with half of the power is refuted by chance in one of 5,000 cases: more than one of 60 is, in one of 14,000. A band
    /// at 0.45 of the sample rate, a tenth of it wide and of a third of the power, raises the curve at one sample as well.
    #[test]
    fn the_spectrum_tells_quantization_from_a_band() {
        let refuted = (0..60).filter(|&seed| p_value(seed, 0.0, 80, angle_error()) < REFUTED).count();
        assert!(refuted <= 1, "{refuted} of 60");
        let banded = |seed: u64| {
            let (mut re, mut im) = (0.0, 0.0);
            let kept = (-0.1_f64 * TAU / 2.0).exp();
            let (sine, cosine) = (0.45 * TAU).sin_cos();
            let drive = DEVIATION / 2_f64.sqrt() * (1.0 - kept * kept).sqrt();
            p_value(seed, 0.0, 80, move |random| {
                let [a, b]: [f64; 2] = [(); 2].map(|()| random.sample(StandardNormal));
                (re, im) = (kept * (re * cosine - im * sine) + drive * a, kept * (re * sine + im * cosine) + drive * b);
                re
            })
        };
        let refuted = (0..20).filter(|&seed| banded(seed) < REFUTED).count();
        assert_eq!(refuted, 20);
    }

    /// Q is known to 2 % where its power is that of the noise. White noise shows Q², over that power, to 0.018: 0.16 is nine deviations.
    #[test]
    fn the_spectrum_contradicts_more_quantization_than_it_shows() {
        let refuted =
            (0..60).filter(|&seed| p_value(seed, 0.95 * QUANTIZATION, SAMPLES, angle_error()) < REFUTED).count();
        assert!(refuted <= 1, "{refuted} of 60");
        for seed in 0..20 {
            assert!(p_value(seed, 0.4 * QUANTIZATION, SAMPLES, |_| 0.0) < REFUTED, "{seed}");
        }
    }
}
