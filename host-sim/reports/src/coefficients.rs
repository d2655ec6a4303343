//! Names of the coefficients, and N of a model whose white noise has two terms.

use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::report::Parameter;
use noise_analysis::report::assessment::sum_of_white_noise;

/// Coefficients of the baseline model, by their names in a report.
pub(crate) const KINDS: [&str; 3] = ["angle_random_walk", "bias_instability", "rate_random_walk"];
pub(crate) const LETTERS: [&str; 3] = ["N", "B", "K"];

/// N of all white noise of a model together.
pub(crate) fn white_noise(terms: impl Iterator<Item = Parameter>) -> Option<Parameter> {
    let (estimates, units): (Vec<BoundedEstimate>, Vec<String>) = terms.map(|of| (of.estimate(), of.unit)).unzip();
    Some(sum_of_white_noise(&estimates).parameter(units.into_iter().next()?))
}
