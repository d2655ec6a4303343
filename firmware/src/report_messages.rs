//! Report messages: the sums of one channel, and a model's error.

use crate::channels::{ChannelEstimator, OCTAVES};
use crate::statistics::ChannelSums;
use adis16405_driver::Channel;
use allan_core::model::{Discrepancy, FittedTerm};
use allan_core::{Curve, Model, NoiseTerm};
use heapless::Vec;
use link::{ChannelMessage, ReportedCoefficient, ReportedModelError, ReportedOctave, ReportedTerm};

impl ChannelSums {
    /// The report on one channel, without losses; `unseen_error` is the error of the previous epoch's model.
    pub fn report(
        &self,
        channel: Channel,
        baseline: Option<&Model>,
        unseen_error: Option<ReportedModelError>,
    ) -> ChannelMessage {
        let mut report = ChannelMessage {
            channel: channel as u8,
            samples: self.samples,
            missing: self.missing,
            octaves: Vec::new(),
            coefficients: Vec::new(),
            unseen_error,
            lost: 0,
            refused: 0,
            self_test_failed: false,
            replaced: self.gaps.iter().map(|gaps| u64::from(gaps.replaced())).sum(),
        };
        let mut curve = Curve::empty();
        ChannelEstimator::rebuild_curve(&mut curve, 1.0, self.samples, |octave| self.octave(octave));
        let octaves = curve.points().iter().map(|point| {
            let (sum, count) = self.octaves[point.n.trailing_zeros() as usize];
            ReportedOctave { n: point.n, sum, count, interpolation: point.interpolation as f32 }
        });
        report.octaves.extend(octaves.take(link::MAX_OCTAVES));
        let coefficients = baseline.into_iter().flat_map(Model::terms).map(reported_coefficient);
        report.coefficients.extend(coefficients.take(link::MAX_COEFFICIENTS));
        report
    }
}

/// Error of a model on a curve; `None` without comparable octaves.
pub(crate) fn model_error(model: &Model, curve: &Curve<OCTAVES>) -> Option<ReportedModelError> {
    let error = Discrepancy::between(model, curve)?;
    Some(ReportedModelError { deviance_per_point: error.deviance_per_point, rms_percent: error.rms_percent })
}

pub(crate) fn reported_coefficient(fitted: &FittedTerm) -> ReportedCoefficient {
    let FittedTerm { kind, value, low, high, .. } = *fitted;
    let term = match kind {
        NoiseTerm::Quantization => ReportedTerm::Quantization,
        NoiseTerm::AngleRandomWalk => ReportedTerm::AngleRandomWalk,
        NoiseTerm::BiasInstability => ReportedTerm::BiasInstability,
        NoiseTerm::RateRandomWalk => ReportedTerm::RateRandomWalk,
        NoiseTerm::RateRamp => ReportedTerm::RateRamp,
        // The search has no candidate with a second-order low-pass.
        NoiseTerm::Filtered(_) | NoiseTerm::LowPass(_) => ReportedTerm::Filtered,
        NoiseTerm::Markov(_) => ReportedTerm::Markov,
        NoiseTerm::Resonance(_) => ReportedTerm::Resonance,
        NoiseTerm::Sinusoid(_) => ReportedTerm::Sinusoid,
    };
    ReportedCoefficient { term, value, low, high }
}
