//! Classes of the terms of a noise model: white noise, filters, lines.

use crate::bounds::BoundedEstimate;
use crate::samples::rounding::Rounding;
use allan_core::model::FittedTerm;
use allan_core::term::Markov;
use allan_core::{Model, NoiseTerm};
use std::f64::consts::PI;

/// Farthest, in octaves, that two time constants, or one and its octave of the curve, are apart to be one: each is known to a factor of 2.
const SAME_TIME_OCTAVES: f64 = 2.0;

pub(crate) fn is_same_time(one_s: f64, other_s: f64) -> bool {
    (one_s / other_s).log2().abs() <= SAME_TIME_OCTAVES
}

/// True if a term is white noise behind a filter.
pub(crate) fn is_filter(kind: &NoiseTerm) -> bool {
    matches!(kind, NoiseTerm::Filtered(_) | NoiseTerm::LowPass(_))
}

/// True if a term is white noise, filtered or not.
pub(crate) fn is_white(kind: &NoiseTerm) -> bool {
    is_filter(kind) || *kind == NoiseTerm::AngleRandomWalk
}

pub(crate) fn is_line(kind: &NoiseTerm) -> bool {
    line_frequency(kind).is_some()
}

/// Frequency of a term that is a line, Hz.
pub(crate) fn line_frequency(kind: &NoiseTerm) -> Option<f64> {
    match kind {
        NoiseTerm::Sinusoid(line) => Some(line.frequency),
        NoiseTerm::Resonance(line) => Some(line.frequency),
        _ => None,
    }
}

/// Frequencies of the sinusoids among `kinds`, Hz.
pub(crate) fn sinusoids<'a>(kinds: impl Iterator<Item = &'a NoiseTerm>) -> Vec<f64> {
    let frequency = |kind: &NoiseTerm| match kind {
        NoiseTerm::Sinusoid(line) => Some(line.frequency),
        _ => None,
    };
    kinds.filter_map(frequency).collect()
}

/// Longest correlation time, in samples, of a Markov process that is white noise behind a low-pass filter of the first order.
pub(crate) const MAX_LOW_PASS_SAMPLES: f64 = 64.0;

/// N below the corner of a Markov process in the place of the white noise of a channel with this `resolution`; `None` of another one.
///
/// A sampled process of deviation `s` and correlation time `T` has there the two-sided density `s²·dt·coth(dt/2T)`, and
/// `s²·dt·tanh(dt/2T)` at half the sample rate. It stands in the place of white noise if the white noise of the model is known to be above it
/// nowhere, or if it is as fast as a filter and that noise is no more than that of rounding. The density far above the corner, in proportion to
/// `s²/T`, is known best, so that the errors of `s` and `T` have one sign: their lower bounds give that of N.
pub(crate) fn white_noise_of_process(model: &Model, term: &FittedTerm, resolution: f64) -> Option<BoundedEstimate> {
    let NoiseTerm::Markov(Markov { time_constant }) = term.kind else { return None };
    let period_s = model.sample_period();
    let half_turn = |time_constant: f64| (0.5 * period_s / time_constant).tanh();
    let at_half_the_rate = term.value * term.value * period_s * half_turn(time_constant);
    let white = model.terms().iter().filter(|term| is_white(&term.kind));
    let left: f64 = white.map(|term| term.low * term.low).sum();
    let rounding = Rounding::white(resolution, period_s).variance() * period_s;
    let is_filter = time_constant < MAX_LOW_PASS_SAMPLES * period_s && left <= rounding;
    if left > at_half_the_rate && !is_filter {
        return None;
    }
    let below_corner = |deviation: f64, time_constant: f64| deviation * (period_s / half_turn(time_constant)).sqrt();
    let (_, _, (shortest, longest)) = term.shape_parameters().next()?;
    let value = below_corner(term.value, time_constant);
    Some(BoundedEstimate { value, low: below_corner(term.low, shortest), high: below_corner(term.high, longest) })
}

/// Length of the impulse response of the longest filter in a model, s.
pub(crate) fn filter_length_s(model: &Model) -> f64 {
    let length = |kind: &NoiseTerm| match kind {
        NoiseTerm::Filtered(filter) => {
            f64::from(filter.stages) * f64::from(filter.taps) * model.sample_period() / filter.decimation
        }
        // As long as the moving average whose impulse response has the same mean, 2ζ/ω₀.
        NoiseTerm::LowPass(filter) => 2.0 * filter.damping / (PI * filter.frequency),
        _ => 0.0,
    };
    model.terms().iter().map(|term| length(&term.kind)).fold(0.0, f64::max)
}
