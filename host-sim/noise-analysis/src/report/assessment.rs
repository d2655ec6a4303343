//! Assessment of a channel's model for use in navigation: its coefficients in the usual units, the error of the integrated
//! channel as predicted and as the second half shows it, the innovations of a Kalman filter that is built from it, and the
//! record length that its coefficients need.

pub mod innovations;
pub mod navigation;
pub mod record_length;

pub use innovations::Innovations;

use crate::bounds::{BoundedEstimate, Parameter};
use crate::fit::noise_terms::{is_filter, is_white, white_noise_of_process};
pub use crate::fit::sample_coefficients::CoefficientsFrom;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::units::{Conversion, GRAVITY, conversions};
use allan_core::model::FittedTerm;
use allan_core::term::{MovingAverageFilter, Resonance, Sinusoid};
use allan_core::{Model, NoiseTerm};
use innovations::filter_innovations;
use navigation::{CALIBRATION_S, IntegratedError, integrated_errors};
use serde::Serialize;
use std::f64::consts::PI;

/// Least part of a line that means of samples have.
const LEAST_GAIN: f64 = 1e-6;

/// Assessment of a channel's model. The JSON report has it under `practice`.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Assessment {
    /// The coefficients of the model that was fitted to the whole record, in the usual units.
    pub coefficients: Vec<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coefficients_note: Option<String>,
    pub coefficients_from: CoefficientsFrom,
    /// Error of the integrated channel without aiding.
    pub drift: Vec<NavigationDrift>,
    /// Innovations of a Kalman filter built from the model, on the second half of the record.
    pub innovations: Option<Innovations>,
    /// Record length at which each coefficient is known to ±20 % by a fit to all of it.
    pub record: Vec<RecordLength>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coefficient {
    /// Such as `angle_random_walk`.
    pub kind: String,
    /// True if it is a standard deviation of samples at the record's rate, instead of a coefficient of the continuous process.
    pub discrete: bool,
    /// In its unit, with 95 % bounds.
    #[serde(flatten)]
    pub value: Parameter,
}

/// Root mean square error of an integrated rate or acceleration, whose bias is estimated as the mean of [`CALIBRATION_S`] before.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NavigationDrift {
    /// Time of integration, s.
    pub seconds: f64,
    pub calibration_s: f64,
    /// By the model, in `unit`.
    pub predicted: f64,
    /// In the second half of the record, in `unit`, with 95 % bounds.
    pub observed: Option<Parameter>,
    /// `deg` or `m/s`.
    pub unit: String,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordLength {
    /// Such as `rate_random_walk`.
    pub kind: String,
    /// Half of that length, s; absent where the length is more than a month or the data does not show the term.
    pub half_s: Option<f64>,
    /// Hours more than this record.
    pub more_hours: Option<f64>,
}

#[derive(Debug, Clone, Copy)]
pub struct AssessedModels<'a> {
    /// Fitted to the whole record: the model that people use.
    pub refitted: &'a Model,
    pub coefficients_from: CoefficientsFrom,
    /// As `refitted`, with the share of the covariates, which the samples still have.
    pub uncompensated: &'a Model,
    /// Fitted to the first half alone, with the share of the covariates: the second half is a test of it.
    pub of_first_half: &'a Model,
}

impl Assessment {
    /// Assesses the models of a channel by a `series` of samples or means; `unseen` has the second half with what the first foretells.
    #[must_use]
    pub fn new(series: &Series, unseen: &Series, models: AssessedModels) -> Self {
        let AssessedModels { refitted, coefficients_from, uncompensated, of_first_half } = models;
        let whole = UniformSeries::from_series(series);
        let unseen = UniformSeries::from_series(unseen);
        if !is_known(refitted) {
            return Self::unknown(!series.values.is_empty());
        }
        let of_series = |model: &Model| sampled_every(model, whole.sample_period());
        Self {
            coefficients: coefficients(refitted, series.unit, series.resolution),
            coefficients_note: None,
            coefficients_from,
            drift: drift(&of_series(uncompensated), series.unit, &unseen),
            innovations: filter_innovations(&of_series(of_first_half), &unseen),
            record: record_lengths(refitted, whole.duration()),
        }
    }
}

impl Assessment {
    /// Assesses the model `refitted` of a channel in `unit`, with this resolution, which was fitted to a record of `duration_s` seconds. It needs
    /// no samples, only whether there are any.
    pub(crate) fn of_model(
        refitted: &Model,
        (unit, resolution): (&str, f64),
        duration_s: f64,
        has_samples: bool,
    ) -> Self {
        if !is_known(refitted) {
            return Self::unknown(has_samples);
        }
        Self {
            coefficients: coefficients(refitted, unit, resolution),
            record: record_lengths(refitted, duration_s),
            ..Self::default()
        }
    }

    /// For a model of which nothing is known.
    fn unknown(has_samples: bool) -> Self {
        let note = if has_samples {
            "the channel never changes by a count: nothing is known of its noise but that it is below the rounding"
        } else {
            "no sample of the channel was used"
        };
        Self { coefficients_note: Some(note.to_owned()), ..Self::default() }
    }
}

/// A model of samples every `period` s of the same noise, of which the samples may be means: a filter counts samples, and of a line the
/// means have a part, at the alias of its frequency.
fn sampled_every(model: &Model, period: f64) -> Model {
    let ratio = period / model.sample_period();
    if ratio <= 1.0 {
        return model.clone();
    }
    let line = |frequency: f64| {
        let (turns, of_sample) = (frequency * period, frequency * model.sample_period());
        let gain = (PI * turns).sin() / (ratio * (PI * of_sample).sin());
        ((turns - turns.round()).abs() / period, gain.abs())
    };
    let term = |term: &FittedTerm| {
        let (kind, gain) = match term.kind {
            NoiseTerm::Filtered(filter) => {
                (NoiseTerm::Filtered(MovingAverageFilter { decimation: filter.decimation * ratio, ..filter }), 1.0)
            }
            // Means over more than its length are white.
            NoiseTerm::LowPass(_) => (NoiseTerm::AngleRandomWalk, 1.0),
            NoiseTerm::Sinusoid(sinusoid) => {
                let (frequency, gain) = line(sinusoid.frequency);
                (NoiseTerm::Sinusoid(Sinusoid { frequency }), gain)
            }
            NoiseTerm::Resonance(resonance) => {
                let (frequency, gain) = line(resonance.frequency);
                (NoiseTerm::Resonance(Resonance { frequency, ..resonance }), gain)
            }
            kind => (kind, 1.0),
        };
        // A line at a multiple of the rate of the means vanishes.
        let mut term = term.with_bounds(gain * term.low, gain * term.high);
        (term.kind, term.value) = (kind, gain * term.value);
        (gain > LEAST_GAIN).then_some(term)
    };
    Model::new(period, model.terms().iter().filter_map(term))
}

/// True if the record says anything of a term: an upper bound of 0 belongs to a channel that never changes.
fn is_known(model: &Model) -> bool {
    model.terms().iter().any(|term| term.high > 0.0)
}

/// The terms of a model with the white noise as one: what passed the filter and what entered after it add up at averaging
/// times longer than the filter, and their sum is N; so does a process that stands in the place of white noise in a channel with this `resolution`.
fn terms_with_one_white_noise(model: &Model, resolution: f64) -> Vec<FittedTerm> {
    let (white, others): (Vec<FittedTerm>, Vec<FittedTerm>) =
        model.terms().iter().copied().partition(|term| is_white(&term.kind));
    let of_white = white.iter().map(|&FittedTerm { value, low, high, .. }| BoundedEstimate { value, low, high });
    let of_processes = others.iter().filter_map(|term| white_noise_of_process(model, term, resolution));
    let parts: Vec<BoundedEstimate> = of_white.chain(of_processes).collect();
    let BoundedEstimate { value, low, high } = sum_of_white_noise(&parts);
    let one = FittedTerm::exact(NoiseTerm::AngleRandomWalk, value).with_bounds(low, high);
    (!parts.is_empty()).then_some(one).into_iter().chain(others).collect()
}

/// N of several white noises that add up, such as what passed a filter and what entered after it: the root of the sum of their
/// squares, whose errors are taken as independent. All in one unit.
#[must_use]
pub fn sum_of_white_noise(parts: &[BoundedEstimate]) -> BoundedEstimate {
    if let [one] = parts {
        return *one;
    }
    let root_of_sum = |of: &dyn Fn(&BoundedEstimate) -> f64| parts.iter().map(of).sum::<f64>().max(0.0).sqrt();
    let value = root_of_sum(&|of| of.value * of.value);
    let below = root_of_sum(&|of| (of.value * of.value - of.low * of.low).powi(2));
    let above = root_of_sum(&|of| (of.high * of.high - of.value * of.value).powi(2));
    BoundedEstimate { value, low: (value * value - below).max(0.0).sqrt(), high: (value * value + above).sqrt() }
}

/// Name of a term's coefficient; that of white noise behind a filter is N.
fn name(kind: &NoiseTerm) -> &'static str {
    match kind {
        kind if is_filter(kind) => NoiseTerm::AngleRandomWalk.name(),
        kind => kind.name(),
    }
}

fn coefficients(model: &Model, unit: &str, resolution: f64) -> Vec<Coefficient> {
    let rate_hz = 1.0 / model.sample_period();
    let of = |term: &FittedTerm| {
        let (kind, value, low, high) = (name(&term.kind), term.value, term.low, term.high);
        let converted = move |Conversion { unit, factor, discrete }: Conversion| Coefficient {
            kind: kind.to_owned(),
            discrete,
            value: Parameter::new(value * factor, low * factor, high * factor, unit),
        };
        conversions(kind, unit, rate_hz).into_iter().map(converted)
    };
    terms_with_one_white_noise(model, resolution).iter().flat_map(of).collect()
}

fn drift(model: &Model, unit: &str, unseen: &UniformSeries) -> Vec<NavigationDrift> {
    let (unit, factor) = match unit {
        "deg/s" => ("deg", 1.0),
        "g" => ("m/s", GRAVITY),
        _ => return Vec::new(),
    };
    let of = |error: IntegratedError| NavigationDrift {
        seconds: error.seconds,
        calibration_s: CALIBRATION_S,
        predicted: factor * error.predicted,
        observed: error.observed.map(|observed| {
            Parameter::new(factor * observed.value, factor * observed.low, factor * observed.high, unit)
        }),
        unit: unit.to_owned(),
    };
    integrated_errors(model, unseen).into_iter().map(of).collect()
}

/// Record lengths for the coefficients of `model`, fitted to `duration` s. Of white noise behind a filter and after it, the larger is N.
fn record_lengths(model: &Model, duration: f64) -> Vec<RecordLength> {
    let largest = model.terms().iter().filter(|term| is_white(&term.kind)).map(|term| term.value).fold(0.0, f64::max);
    let is_smaller = |term: &FittedTerm| is_white(&term.kind) && term.value < largest;
    let of = |(index, term): (usize, &FittedTerm)| {
        let length = record_length::required_length(model, index, duration);
        let more_hours = length.map(|length| (length - duration) / 3600.0);
        RecordLength { kind: name(&term.kind).to_owned(), half_s: length.map(|length| length / 2.0), more_hours }
    };
    model.terms().iter().enumerate().filter(|(_, term)| !is_smaller(term)).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::sampled_every;
    use allan_core::model::FittedTerm;
    use allan_core::term::Sinusoid;
    use allan_core::{Model, NoiseTerm};

    /// The second differences of means of eight samples are those of the samples at eight times the averaging time.
    #[test]
    fn means_of_a_line_have_the_allan_variance_of_its_samples() {
        for frequency in [1.0, 5.0, 20.5, 33.0] {
            let line = FittedTerm::exact(NoiseTerm::Sinusoid(Sinusoid { frequency }), 0.2);
            let samples = Model::new(0.005, [line]);
            let means = sampled_every(&samples, 0.04);
            for n in [1, 2, 4, 64] {
                let (of_means, of_samples) = (means.avar(n), samples.avar(8 * n));
                assert!((of_means - of_samples).abs() < 1e-9 * 0.04, "{frequency} Hz, {n}: {of_means} {of_samples}");
            }
        }
        // A multiple of the rate of the means.
        let line = FittedTerm::exact(NoiseTerm::Sinusoid(Sinusoid { frequency: 25.0 }), 0.2);
        assert!(sampled_every(&Model::new(0.005, [line]), 0.04).terms().is_empty());
    }
}
