//! Assessment of a channel's model for use in navigation: its coefficients in the usual units, the error of the integrated
//! channel as predicted and as the second half shows it, the innovations of a Kalman filter that is built from it, and the
//! record length that its coefficients need.

pub mod innovations;
pub mod navigation;
pub mod record_length;
mod spectral_white_noise;

pub use innovations::Innovations;

use crate::findings::Parameter;
use crate::series::Series;
use crate::spectra::correlation_time;
use crate::uniform_series::UniformSeries;
use crate::units::{Conversion, GRAVITY, conversions};
use allan_core::model::FittedTerm;
use allan_core::{Model, NoiseTerm};
use innovations::filter_innovations;
use navigation::{CALIBRATION_S, IntegratedError, integrated_errors};
use serde::Serialize;

/// Assessment of a channel's model. The JSON report has it under `practice`.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Assessment {
    /// The coefficients in the usual units.
    pub coefficients: Vec<Coefficient>,
    /// Error of the integrated channel without aiding.
    pub drift: Vec<NavigationDrift>,
    /// Of a Kalman filter built from the model, on the second half of the record.
    pub innovations: Option<Innovations>,
    /// N by Welch's spectrum of the whole record, without the Allan variance; absent where the record does not identify it.
    pub angle_random_walk_by_spectrum: Option<Parameter>,
    /// Why the record does not identify N by the spectrum, or why that differs from N of the fit by more than both
    /// intervals allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angle_random_walk_by_spectrum_note: Option<String>,
    /// Correlation time of the model's Markov process by the autocorrelation of the whole record.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub markov_time_by_autocorrelation: Option<Parameter>,
    /// Record length at which each coefficient is known to ±20 %.
    pub record: Vec<RecordLength>,
}

/// A coefficient in one unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coefficient {
    /// Such as `angle_random_walk`.
    pub kind: String,
    /// Whether it is a standard deviation of samples at the record's rate, instead of a coefficient of the continuous process.
    pub discrete: bool,
    /// In its unit, with 95 % bounds.
    #[serde(flatten)]
    pub value: Parameter,
}

/// Root mean square error of an angular rate or an acceleration that is integrated; its bias is estimated as the mean of
/// [`CALIBRATION_S`] before.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NavigationDrift {
    /// Time of integration, s.
    pub seconds: f64,
    /// Time over which the bias is estimated, s.
    pub calibration_s: f64,
    /// By the model, in `unit`.
    pub predicted: f64,
    /// In the second half of the record, in `unit`, with 95 % bounds.
    pub observed: Option<Parameter>,
    /// `deg` or `m/s`.
    pub unit: String,
}

/// The record length that a coefficient needs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordLength {
    /// Such as `rate_random_walk`.
    pub kind: String,
    /// Length of the half to which the model is fitted, s; absent where it is more than a month or the data does not show
    /// the term.
    pub half_s: Option<f64>,
    /// Hours more than this record, for both halves.
    pub more_hours: Option<f64>,
}

impl Assessment {
    /// Assesses `model`, which was fitted to the first half of `series`. `fits` are the reported models of that half and of
    /// the whole record, in which the covariates' share may have been taken off.
    #[must_use]
    pub fn new(series: &Series, model: &Model, fits: [&Model; 2]) -> Self {
        let whole = UniformSeries::from_series(series);
        let halfway = whole.values().len() / 2;
        let [of_half, of_whole] = fits;
        let by_spectrum = spectral_white_noise::estimate(&whole, of_whole, of_half, series.resolution, series.unit);
        let unseen = UniformSeries::new(whole.sample_period(), whole.values()[halfway..].to_vec());
        Self {
            coefficients: coefficients(model, series.unit),
            drift: drift(model, series.unit, &unseen),
            innovations: filter_innovations(model, &unseen),
            angle_random_walk_by_spectrum: by_spectrum.angle_random_walk,
            angle_random_walk_by_spectrum_note: by_spectrum.note,
            markov_time_by_autocorrelation: correlation_time(&whole, model)
                .map(|time| Parameter::new(time.value, time.low, time.high, "s")),
            record: record_lengths(model, whole.duration() / 2.0),
        }
    }
}

/// Name of a term's coefficient; that of white noise behind a filter is N.
fn name(kind: &NoiseTerm) -> &'static str {
    match kind {
        NoiseTerm::Filtered(_) => NoiseTerm::AngleRandomWalk.name(),
        kind => kind.name(),
    }
}

fn coefficients(model: &Model, unit: &str) -> Vec<Coefficient> {
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
    model.terms().iter().flat_map(of).collect()
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

/// The record length that each coefficient of `model` needs, whose half record has a length of `half` s.
fn record_lengths(model: &Model, half: f64) -> Vec<RecordLength> {
    let of = |(index, term): (usize, &FittedTerm)| {
        let half_s = record_length::required_length(model, index, half);
        let more_hours = half_s.map(|length| 2.0 * (length - half) / 3600.0);
        RecordLength { kind: name(&term.kind).to_owned(), half_s, more_hours }
    };
    model.terms().iter().enumerate().map(of).collect()
}
