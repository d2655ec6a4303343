//! Coefficients of a model, whose white noise may have two terms, and the rows of their tables by slope method and fit.

use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::report::assessment::sum_of_white_noise;
use noise_analysis::report::{ChannelReport, Parameter, SlopeMethodValue, TermReport};

/// N of all white noise of a model together.
pub(crate) fn white_noise(terms: impl Iterator<Item = (BoundedEstimate, String)>) -> Option<(BoundedEstimate, String)> {
    let (estimates, units): (Vec<BoundedEstimate>, Vec<String>) = terms.unzip();
    Some((sum_of_white_noise(&estimates), units.into_iter().next()?))
}

/// Kind, letter and slope of the coefficients that the slope method gives (IEEE Std 952, annex C).
pub const SLOPES: [(&str, &str, &str); 3] = [
    ("angle_random_walk", "N", "slope −½, at 1 s"),
    ("bias_instability", "B", "flat minimum / 0.664"),
    ("rate_random_walk", "K", "slope +½, at 3 s"),
];

/// A coefficient by both methods.
#[derive(Debug, Clone, PartialEq)]
pub struct CoefficientRow<'a> {
    pub kind: &'static str,
    /// Letter in formulas; empty for a term that is not of the baseline model.
    pub symbol: &'static str,
    /// Slope, and where the coefficient is read; empty for a term without a slope.
    pub slope: &'static str,
    /// Unit of both values; empty without either.
    pub unit: String,
    /// By the slope method; absent without such a slope.
    pub slope_value: Option<&'a SlopeMethodValue>,
    /// By the fit of the baseline model to the first half; absent if the model lacks the term.
    pub fit: Option<Parameter>,
}

/// N, B and K in this order, then the other terms of the baseline model of `channel`.
pub fn rows(channel: &ChannelReport) -> Vec<CoefficientRow<'_>> {
    let read_off = &channel.read_off;
    let values =
        [read_off.angle_random_walk.as_ref(), read_off.bias_instability.as_ref(), read_off.rate_random_walk.as_ref()];
    let classical = SLOPES.iter().zip(values).map(|(&(kind, symbol, slope), slope_value)| {
        let fit = channel.before.terms.iter().find(|term| term.kind() == kind).map(TermReport::coefficient);
        let unit = slope_value.map(|value| &value.unit).or(fit.as_ref().map(|parameter| &parameter.unit));
        let unit = unit.cloned().unwrap_or_default();
        CoefficientRow { kind, symbol, slope, unit, slope_value, fit }
    });
    let others = channel.before.terms.iter().filter(|term| SLOPES.iter().all(|(kind, ..)| term.kind() != *kind));
    let others = others.flat_map(|term| {
        term.parameters().into_values().map(move |parameter| CoefficientRow {
            kind: term.kind(),
            symbol: "",
            slope: "",
            unit: parameter.unit.clone(),
            slope_value: None,
            fit: Some(parameter),
        })
    });
    classical.chain(others).collect()
}
