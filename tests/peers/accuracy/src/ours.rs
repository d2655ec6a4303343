//! This project's own estimator and fit.

use crate::case::{Case, Coefficients, SAMPLE_PERIOD, SAMPLES};
use allan_core::model::FittedTerm;
use allan_core::{Cascade, Model, NoiseTerm, fit::fit};
use noise_analysis::record_length::relative_error;

/// Counts in the standard deviation of the white noise: rounding adds 1/12 count², a part in 10⁷.
const COUNTS: f64 = 1000.0;

/// Fits `kinds` to the curve of a series; coefficients and bounds are in the unit of the series.
pub(crate) fn fitted(case: &Case, series: &[f64], kinds: &[NoiseTerm]) -> Model {
    let lsb = case.truth[0] / SAMPLE_PERIOD.sqrt() / COUNTS;
    let mut cascade = Cascade::<24, 8>::new();
    for value in series {
        cascade.push((value / lsb).round() as i32);
    }
    fit(&cascade.curve(SAMPLE_PERIOD), kinds).scaled(lsb)
}

/// The terms that the case is made of.
pub(crate) fn true_kinds(case: &Case) -> Vec<NoiseTerm> {
    NoiseTerm::BASELINE.into_iter().zip(case.truth).filter(|(_, value)| *value > 0.0).map(|(kind, _)| kind).collect()
}

/// Relative error of N, B, K that no unbiased method can go below, on average.
pub(crate) fn limit(case: &Case) -> [Option<f64>; 3] {
    let truth = Model::new(
        SAMPLE_PERIOD,
        NoiseTerm::BASELINE.into_iter().zip(case.truth).map(|(kind, value)| FittedTerm::exact(kind, value)),
    );
    std::array::from_fn(|term| {
        (case.truth[term] > 0.0).then(|| relative_error(&truth, term, SAMPLES as f64 * SAMPLE_PERIOD))?
    })
}

/// N, B, K of a model.
pub(crate) fn coefficients(model: &Model) -> Coefficients {
    NoiseTerm::BASELINE.map(|kind| model.terms().iter().find(|term| term.kind == kind).map(|term| term.value))
}

/// Whether the 95 % bounds of N, B, K hold the truth.
pub(crate) fn covered(case: &Case, model: &Model) -> [Option<bool>; 3] {
    let mut truth = case.truth.into_iter();
    NoiseTerm::BASELINE.map(|kind| {
        let truth = truth.next()?;
        let term = model.terms().iter().find(|term| term.kind == kind)?;
        Some((term.low..=term.high).contains(&truth))
    })
}
