//! From an estimator to what is reported of it: exact sums, and the declared model fitted to them.

use adis16405_driver::{Channel, Config};
use allan_core::fit::fit;
use allan_core::{Cascade, Kind};
use link::{ChannelReport, Coefficient, Point, Term};

/// Octaves of averaging factors: up to 2²³ samples, 11 hours at 204.8 samples a second.
pub const OCTAVES: usize = 24;
/// Overlap of the differences.
pub const OVERLAP: usize = 8;

/// What is reported of one channel.
#[must_use]
pub fn channel_report(channel: Channel, estimator: &Cascade<OCTAVES, OVERLAP>, config: Config) -> ChannelReport {
    let curve = estimator.curve(1.0 / config.sample_period().hz()).scaled(channel.lsb(config.range()));
    let model = fit(&curve, &Kind::DECLARED);
    let coefficients = model.terms().iter().filter_map(|term| {
        let kind = match term.kind {
            Kind::AngleRandomWalk => Term::AngleRandomWalk,
            Kind::BiasInstability => Term::BiasInstability,
            Kind::RateRandomWalk => Term::RateRandomWalk,
            _ => return None,
        };
        Some(Coefficient { term: kind, value: term.value, low: term.low, high: term.high })
    });
    let points = (0..OCTAVES).filter_map(|octave| {
        let (sum, count) = estimator.sum_of_squares(octave)?;
        (count > 0).then_some(Point { n: 1 << octave, sum, count })
    });
    ChannelReport {
        channel: channel as u8,
        samples: estimator.len(),
        missing: estimator.missing(),
        points: points.take(link::MAX_POINTS).collect(),
        coefficients: coefficients.take(link::MAX_COEFFICIENTS).collect(),
    }
}
