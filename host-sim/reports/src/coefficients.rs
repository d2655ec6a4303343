//! Names of the coefficients, and N of a model whose white noise has two terms.

use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::report::assessment::sum_of_white_noise;
use noise_analysis::report::{ChannelReport, Parameter, TermReport};

/// Coefficients of the baseline model, by their names in a report.
pub(crate) const KINDS: [&str; 3] = ["angle_random_walk", "bias_instability", "rate_random_walk"];
pub(crate) const LETTERS: [&str; 3] = ["N", "B", "K"];

/// Probability by which chance alone gives a sentence.
pub(crate) const CHANCE: f64 = 0.01;

/// N of all white noise of a model together.
pub(crate) fn white_noise(terms: impl Iterator<Item = Parameter>) -> Option<Parameter> {
    let (estimates, units): (Vec<BoundedEstimate>, Vec<String>) = terms.map(|of| (of.estimate(), of.unit)).unzip();
    Some(sum_of_white_noise(&estimates).parameter(units.into_iter().next()?))
}

/// A coefficient of the model to use; N of all white noise, also below the corner of a process that replaces it.
pub fn coefficient(channel: &ChannelReport, kind: &str) -> Option<Parameter> {
    let mut terms = channel.refitted.terms.iter();
    if kind == KINDS[0] {
        return white_noise(terms.filter_map(TermReport::angle_random_walk));
    }
    terms.find(|term| term.kind() == kind).map(TermReport::coefficient)
}
