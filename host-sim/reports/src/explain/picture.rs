//! The picture of an explained channel: what the first half taught, against the curve of the second.

use crate::plot::{PlotError, allan};
use allan_core::Model;
use noise_analysis::explain::ChannelExplanation;
use noise_analysis::report::{ChannelReport, CurvePoint, ModelError, ModelReport, ReadOff};

/// The curve of the second half, the declared and the predictive model of the first, and the residual, as an SVG document.
///
/// # Errors
/// The drawing library refuses.
pub fn picture(of: &ChannelExplanation) -> Result<String, PlotError> {
    let unseen = &of.parts.unseen;
    let model = |model: &Model, [fitted, error]: [f64; 2]| ModelReport {
        terms: Vec::new(),
        adev: unseen.points().iter().map(|point| model.avar(point.n).sqrt()).collect(),
        fitted: ModelError { deviance_per_point: Some(fitted), rms_percent: None },
        unseen: ModelError { deviance_per_point: Some(error), rms_percent: None },
    };
    allan(&ChannelReport {
        name: format!("{}, second half; models of the first", of.channel.name),
        unit: of.channel.unit.to_owned(),
        samples: unseen.samples(),
        // The same degrees of freedom as in the tables.
        curve: unseen.points().iter().map(|point| CurvePoint::of(point, unseen.samples())).collect(),
        read_off: ReadOff { angle_random_walk: None, bias_instability: None, rate_random_walk: None },
        before: model(&of.trace.before, of.errors.declared),
        practice: Default::default(),
        effects: Vec::new(),
        after: model(&of.predictive, of.errors.predictive),
    })
}
