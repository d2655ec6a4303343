//! From an estimator to what is reported of it: exact sums, and the declared model fitted to them.

use crate::estimators::Estimator;
use adis16405_driver::{Channel, Config};
use allan_core::{Curve, Kind, Model, check, fit::fit};
use link::{ChannelReport, Coefficient, ModelError, Point, Term};

/// Octaves of averaging factors: up to 2²³ samples, 11 hours at 204.8 samples a second.
pub const OCTAVES: usize = 24;
/// Overlap of the differences.
pub const OVERLAP: usize = 8;

/// The curve of one channel in its unit.
fn curve(channel: Channel, estimator: &Estimator, config: Config) -> Curve<OCTAVES> {
    estimator.curve(1.0 / config.sample_period().hz()).scaled(channel.lsb(config.range()))
}

/// The declared model fitted to one channel, in its unit.
#[must_use]
#[inline(never)] // so that its stack is not everybody's
pub fn channel_model(channel: Channel, estimator: &Estimator, config: Config) -> Model {
    fit(&curve(channel, estimator, config), &Kind::DECLARED)
}

/// What is reported of one channel. `model` is fitted to it, `previous` to the epoch before.
#[must_use]
pub fn channel_report(
    channel: Channel,
    estimator: &Estimator,
    config: Config,
    model: Option<&Model>,
    previous: Option<&Model>,
) -> ChannelReport {
    let coefficients = model.into_iter().flat_map(Model::terms).map(|term| {
        let (value, low, high) = (term.value, term.low, term.high);
        Coefficient { term: term_of(term.kind), value, low, high }
    });
    let points = (0..OCTAVES).filter_map(|octave| {
        let (sum, count) = estimator.sum_of_squares(octave)?;
        (count > 0).then_some(Point { n: 1 << octave, sum, count })
    });
    let unseen = previous.and_then(|previous| model_error(previous, &curve(channel, estimator, config)));
    ChannelReport {
        channel: channel as u8,
        samples: estimator.len(),
        missing: estimator.missing(),
        points: points.take(link::MAX_POINTS).collect(),
        coefficients: coefficients.take(link::MAX_COEFFICIENTS).collect(),
        unseen,
    }
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
