//! From an estimator's sums to what is reported of it: exact sums, and the declared model fitted to them.

use crate::sums::Sums;
use adis16405_driver::{Channel, Config};
use allan_core::{Curve, Kind, Model, check, fit::fit, model};
use heapless::Vec;
use link::{ChannelReport, Coefficient, ModelError, Point, Term};

/// Octaves of averaging factors: up to 2²³ samples, 11 hours at 204.8 samples a second.
pub const OCTAVES: usize = 24;
/// Overlap of the differences.
pub const OVERLAP: usize = 8;

/// The declared model fitted to one channel, in its unit.
#[must_use]
#[inline(never)] // here and below: so that its stack is not everybody's
pub fn channel_model(channel: Channel, sums: &Sums, config: Config) -> Model {
    let mut curve = Curve::empty();
    sums.draw(&mut curve, channel, config);
    fit(&curve, &Kind::DECLARED)
}

/// How wrong a model is on the curve of one channel; `None` if no octave can be compared.
#[must_use]
#[inline(never)]
pub fn unseen_error(channel: Channel, sums: &Sums, config: Config, model: &Model) -> Option<ModelError> {
    let mut curve = Curve::empty();
    sums.draw(&mut curve, channel, config);
    model_error(model, &curve)
}

/// What is reported of one channel: the model that was fitted to it, and how wrong that of the epoch before is.
#[must_use]
pub fn channel_report(
    channel: Channel,
    sums: &Sums,
    model: Option<&Model>,
    unseen: Option<ModelError>,
) -> ChannelReport {
    let mut report = ChannelReport {
        channel: channel as u8,
        samples: sums.samples,
        missing: sums.missing,
        points: Vec::new(),
        coefficients: Vec::new(),
        unseen,
    };
    let octaves = sums.octaves.iter().enumerate().filter(|(_, (_, count))| *count > 0);
    let points = octaves.map(|(octave, &(sum, count))| Point { n: 1 << octave, sum, count });
    report.points.extend(points.take(link::MAX_POINTS));
    let coefficient = |term: &model::Term| {
        let (value, low, high) = (term.value, term.low, term.high);
        Coefficient { term: term_of(term.kind), value, low, high }
    };
    let coefficients = model.into_iter().flat_map(Model::terms).map(coefficient);
    report.coefficients.extend(coefficients.take(link::MAX_COEFFICIENTS));
    report
}

/// How wrong a model is on a curve; `None` if no octave can be compared.
pub(crate) fn model_error(model: &Model, curve: &Curve<OCTAVES>) -> Option<ModelError> {
    let error = check::ModelError::between(model, curve)?;
    Some(ModelError { deviance_per_point: error.deviance_per_point, rms_percent: error.rms_percent })
}

pub(crate) fn term_of(kind: Kind) -> Term {
    match kind {
        Kind::Quantization => Term::Quantization,
        Kind::AngleRandomWalk => Term::AngleRandomWalk,
        Kind::BiasInstability => Term::BiasInstability,
        Kind::RateRandomWalk => Term::RateRandomWalk,
        Kind::RateRamp => Term::RateRamp,
        Kind::Filtered(_) => Term::Filtered,
        Kind::Markov(_) => Term::Markov,
        Kind::Resonance(_) => Term::Resonance,
        Kind::Sinusoid(_) => Term::Sinusoid,
    }
}
