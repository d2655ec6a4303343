//! What an analysis found, as data: the JSON schema, and the source of the terminal table and of the page.
//!
//! A report says nothing of where its samples came from, so that a recording read from a file and the same
//! recording replayed over the bus give the same bytes.

pub use crate::findings::{Effect, Parameter};
use crate::practice::Practice;
use allan_core::AllanPoint;
use allan_core::slope_method::percentage_accuracy;
use serde::Serialize;
use std::collections::BTreeMap;

/// Version of the JSON schema; field names are a promise within one version.
pub const SCHEMA: u32 = 1;

/// A whole analysis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Given by the user, or measured from the time stamps, in Hz.
    pub sample_rate_hz: f64,
    /// Samples that the estimator used.
    pub samples: u64,
    /// Samples that are missing or were refused, by cause; `gap` counts those that never arrived.
    pub dropped: BTreeMap<String, u64>,
    /// Samples that were used although something about them was noticed, by cause.
    pub flagged: BTreeMap<String, u64>,
    /// In the order of the burst.
    pub channels: Vec<ChannelReport>,
}

/// One output of the sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelReport {
    /// The channel's name, such as `gyro_z`.
    pub name: String,
    /// Unit of every deviation of the channel, such as `deg/s`.
    pub unit: String,
    /// Samples used.
    pub samples: u64,
    /// Measured over the whole record, octave by octave.
    pub curve: Vec<CurvePoint>,
    /// The coefficients as the classical slopes give them, beside the fit.
    pub read_off: ReadOff,
    /// The declared model: angle random walk, bias instability, rate random walk.
    pub before: ModelReport,
    /// Effects that the declared model lacks.
    pub effects: Vec<Effect>,
    /// The declared model with the effects.
    pub after: ModelReport,
    /// What that model is good for.
    pub practice: Practice,
}

/// One octave of the measured Allan deviation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Averaging factor, samples.
    pub n: u64,
    /// Averaging time, s.
    pub tau_s: f64,
    /// Allan deviation in the channel's unit.
    pub adev: f64,
    /// Lower 95 % bound of `adev`.
    pub low: f64,
    /// Upper 95 % bound of `adev`.
    pub high: f64,
    /// Equivalent degrees of freedom.
    pub edf: f64,
    /// `100/sqrt(2(N/n−1))`, the percentage accuracy by which the classical method judges a point.
    pub accuracy_percent: f64,
}

impl CurvePoint {
    /// A point of a curve of `samples` samples, in the curve's unit.
    #[must_use]
    pub fn of(point: &AllanPoint, samples: u64) -> Self {
        Self {
            n: point.n,
            tau_s: point.tau,
            adev: point.avar.sqrt(),
            low: point.low.sqrt(),
            high: point.high.sqrt(),
            edf: point.edf,
            accuracy_percent: percentage_accuracy(samples, point.n),
        }
    }
}

/// Coefficients read off the slopes of the curve; absent where the slope does not occur.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReadOff {
    /// The −½ line at 1 s.
    pub angle_random_walk: Option<ReadOffValue>,
    /// The flat minimum times `sqrt(π/(2 ln 2))`.
    pub bias_instability: Option<ReadOffValue>,
    /// The +½ line at 3 s.
    pub rate_random_walk: Option<ReadOffValue>,
}

/// One coefficient and where on the curve it was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReadOffValue {
    /// In `unit`.
    pub value: f64,
    /// Such as `deg/sqrt(s)`.
    pub unit: String,
    /// Start of the interval in which the slope was found, s.
    pub from_s: f64,
    /// End of that interval, s.
    pub to_s: f64,
}

/// A fitted model and how wrong it is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelReport {
    /// The terms, with their parameters.
    pub terms: Vec<Term>,
    /// The model's Allan deviation at each point of the curve, in the channel's unit.
    pub adev: Vec<f64>,
    /// Against the first half of the record, which the model was fitted to.
    pub fitted: ModelError,
    /// Against the second half, which the fit has not seen.
    pub unseen: ModelError,
}

/// One term of a noise model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Term {
    /// Such as `angle_random_walk`.
    pub kind: String,
    /// By name; a term with a single parameter calls it `value`.
    pub parameters: BTreeMap<String, Parameter>,
}

/// How wrong a model is, over the octaves with `n ≤ M/8` of a part of `M` samples; absent when there are none.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelError {
    /// `mean edf·(ln(m/v) + v/m − 1)`; 1 is what a true model scores on the data that it was fitted to.
    pub deviance_per_point: Option<f64>,
    /// `100·sqrt(mean (½ ln(v/m))²)`.
    pub rms_percent: Option<f64>,
}
