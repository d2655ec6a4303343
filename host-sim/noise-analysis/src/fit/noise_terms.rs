//! What the terms of a noise model are: white noise, filters, lines.

use allan_core::{Model, NoiseTerm};
use std::f64::consts::PI;

/// Farthest that a time constant and another one, or the octave of the curve that it may belong to, are apart to be one, in octaves:
/// either is known to a factor of 2.
const SAME_TIME_OCTAVES: f64 = 2.0;

/// Whether two time constants, s, may be those of one process.
pub(crate) fn is_same_time(one_s: f64, other_s: f64) -> bool {
    (one_s / other_s).log2().abs() <= SAME_TIME_OCTAVES
}

/// Whether a term is white noise behind a filter.
pub(crate) fn is_filter(kind: &NoiseTerm) -> bool {
    matches!(kind, NoiseTerm::Filtered(_) | NoiseTerm::LowPass(_))
}

/// Whether a term is white noise, filtered or not.
pub(crate) fn is_white(kind: &NoiseTerm) -> bool {
    is_filter(kind) || *kind == NoiseTerm::AngleRandomWalk
}

/// Whether a term is a line.
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
