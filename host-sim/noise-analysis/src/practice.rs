//! Out of a channel's model, something to use: its coefficients in every unit, what it predicts for a vehicle beside what
//! unseen data shows, whether a filter built from it would be right, and how much longer to record.

use crate::innovation;
use crate::navigation::{self, CALIBRATION_S};
use crate::record_length;
use crate::report::Parameter;
use crate::series::Series;
use crate::spectra::{Welch, correlation_time};
use crate::uniform_series::UniformSeries;
use crate::units::{GRAVITY, conversions};
use allan_core::{Model, NoiseTerm};
use serde::Serialize;

/// Stretches of Welch's estimate: long enough for the nulls of the part's filter, short enough for a precise level.
const WELCH_SAMPLES: usize = 1 << 13;
/// Half-width of what is left out of a spectrum around a sinusoid, in widths of Welch's window.
const LINE_WIDTHS: f64 = 4.0;

/// What a channel's model is good for.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Practice {
    /// The coefficients in the units that people ask for.
    pub coefficients: Vec<Coefficient>,
    /// Error of the integrated channel without help.
    pub drift: Vec<Drift>,
    /// Of a Kalman filter built from the model, on the half of the record that the fit has not seen.
    pub innovations: Option<Innovations>,
    /// N by Welch's spectrum of the whole record, which knows nothing of the Allan variance.
    pub angle_random_walk_by_spectrum: Option<Parameter>,
    /// Correlation time of the model's Markov process by the autocorrelation of the whole record.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub markov_time_by_autocorrelation: Option<Parameter>,
    /// Records that would tell a coefficient to ±20 %.
    pub record: Vec<Record>,
}

/// A coefficient in one unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coefficient {
    /// Such as `angle_random_walk`.
    pub kind: String,
    /// Whether it is a standard deviation of samples at the record's rate instead of one of the continuous process.
    pub discrete: bool,
    /// In its unit, with 95 % bounds.
    #[serde(flatten)]
    pub value: Parameter,
}

/// Root mean square of the integral of a rate or an acceleration whose bias is the mean of the 60 s before.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drift {
    /// Time of integration, s.
    pub seconds: f64,
    /// Time over which the bias was learnt, s.
    pub calibration_s: f64,
    /// As the model says, in `unit`.
    pub predicted: f64,
    /// As the unseen half shows, in `unit`, with 95 % bounds.
    pub observed: Option<Parameter>,
    /// `deg` or `m/s`.
    pub unit: String,
}

/// What the innovations say.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Innovations {
    /// Innovations that were judged.
    pub count: usize,
    /// Mean of the squares over the expected variance, with the bounds between which 95 % of true models are.
    pub normalised: f64,
    /// Lower bound of `normalised` for a true model.
    pub low: f64,
    /// Upper bound of `normalised` for a true model.
    pub high: f64,
    /// Correlation of each with the one before.
    pub correlation: f64,
    /// Chance that white innovations show as much correlation.
    pub whiteness_p: f64,
}

/// How long a record must be for a coefficient.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Record {
    /// Such as `rate_random_walk`.
    pub kind: String,
    /// Length of one half, to which the model is fitted, s; absent where a month would not do or the term does not show.
    pub half_s: Option<f64>,
    /// Hours more than this record.
    pub more_hours: Option<f64>,
}

impl Practice {
    /// Of a channel, `model` being fitted to the first half of `series`.
    #[must_use]
    pub fn of(series: &Series, model: &Model) -> Self {
        let whole = UniformSeries::from_series(series);
        let halfway = whole.values().len() / 2;
        let unseen = UniformSeries::new(whole.sample_period(), whole.values()[halfway..].to_vec());
        Self {
            coefficients: coefficients(model, series.unit),
            drift: drift(model, series.unit, &unseen),
            innovations: innovation::innovations(model, &unseen).map(|found| Innovations {
                count: found.count,
                normalised: found.normalised,
                low: found.consistent.0,
                high: found.consistent.1,
                correlation: found.correlation,
                whiteness_p: found.whiteness,
            }),
            angle_random_walk_by_spectrum: angle_random_walk(&whole, model, series.unit),
            markov_time_by_autocorrelation: correlation_time(&whole, model).map(|time| Parameter {
                value: time.value,
                low: time.low,
                high: time.high,
                unit: "s".to_owned(),
            }),
            record: records(model, whole.duration() / 2.0),
        }
    }
}

/// Name of a term's coefficient: behind a filter, N is still N.
fn name(kind: &NoiseTerm) -> &'static str {
    match kind {
        NoiseTerm::Filtered(_) => NoiseTerm::AngleRandomWalk.name(),
        kind => kind.name(),
    }
}

fn coefficients(model: &Model, unit: &str) -> Vec<Coefficient> {
    let rate_hz = 1.0 / model.sample_period();
    let of = |term: &allan_core::model::FittedTerm| {
        let (kind, value, low, high) = (name(&term.kind), term.value, term.low, term.high);
        let converted = move |conversion: crate::units::Conversion| Coefficient {
            kind: kind.to_owned(),
            discrete: conversion.discrete,
            value: Parameter {
                value: value * conversion.factor,
                low: low * conversion.factor,
                high: high * conversion.factor,
                unit: conversion.unit.to_owned(),
            },
        };
        conversions(kind, unit, rate_hz).into_iter().map(converted)
    };
    model.terms().iter().flat_map(of).collect()
}

fn drift(model: &Model, unit: &str, unseen: &UniformSeries) -> Vec<Drift> {
    let (unit, factor) = match unit {
        "deg/s" => ("deg", 1.0),
        "g" => ("m/s", GRAVITY),
        _ => return Vec::new(),
    };
    let of = |drift: navigation::Drift| Drift {
        seconds: drift.seconds,
        calibration_s: CALIBRATION_S,
        predicted: factor * drift.predicted,
        observed: drift.observed.map(|observed| Parameter {
            value: factor * observed.value,
            low: factor * observed.low,
            high: factor * observed.high,
            unit: unit.to_owned(),
        }),
        unit: unit.to_owned(),
    };
    navigation::drifts(model, unseen).into_iter().map(of).collect()
}

/// N by the spectrum without the lines of the model.
fn angle_random_walk(whole: &UniformSeries, model: &Model, unit: &str) -> Option<Parameter> {
    let welch = Welch::estimate(whole, WELCH_SAMPLES)?;
    let reach = LINE_WIDTHS / (WELCH_SAMPLES as f64 * whole.sample_period());
    let near = |frequency: f64| {
        model.terms().iter().any(|term| match term.kind {
            NoiseTerm::Sinusoid(sinusoid) => (frequency - sinusoid.frequency).abs() < reach,
            NoiseTerm::Resonance(resonance) => {
                (frequency - resonance.frequency).abs() < reach + LINE_WIDTHS * resonance.bandwidth
            }
            _ => false,
        })
    };
    let (shape, bands) = welch.shape(near);
    let (value, error) = (shape.angle_random_walk(), shape.angle_random_walk_error(&bands)?);
    let unit = unit.strip_suffix("/s").map_or_else(|| format!("{unit}/sqrt(Hz)"), |angle| format!("{angle}/sqrt(s)"));
    Some(Parameter { value, low: value * (1.0 - 1.96 * error), high: value * (1.0 + 1.96 * error), unit })
}

fn records(model: &Model, half: f64) -> Vec<Record> {
    let of = |(index, term): (usize, &allan_core::model::FittedTerm)| {
        let wanted = record_length::wanted(model, index, half);
        // Both halves grow.
        let more = |length: f64| 2.0 * (length - half) / 3600.0;
        Record { kind: name(&term.kind).to_owned(), half_s: wanted, more_hours: wanted.map(more) }
    };
    model.terms().iter().enumerate().map(of).collect()
}
