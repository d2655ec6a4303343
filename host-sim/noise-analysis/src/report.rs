//! The report of an analysis as plain data: the source of the JSON schema, of the terminal table and of the page.
//!
//! A report does not name the source of its samples: a file and the same recording replayed over the bus give the same bytes.
//!
//! Names end with their units (`_s`, `_hz`, `_percent`); `low` and `high` are 95 % bounds; coefficients and deviations are in `unit`.

pub mod assessment;
pub mod comparison;
pub mod figure_data;
pub(crate) mod part_report;
pub mod several;

use crate::bounds::unbounded;
pub use crate::bounds::{BoundedEstimate, Parameter};
pub use crate::effects::Effect;
pub use crate::effects::findings::{ChannelEffect, Finding, Validation};
pub use crate::fit::contradiction::Contradiction;
use crate::fit::event_share::EventShare;
pub use crate::fit::event_share::EventsReport;
use crate::fit::noise_terms::{is_white, white_noise_of_process};
use crate::fit::signal_share::SignalShare;
pub use crate::nonstationarity::{CommonModeRegression, Nonstationarity};
use crate::report::assessment::Assessment;
use crate::units::coefficient_unit;
use allan_core::model::{FittedTerm, cube_root_deviation};
use allan_core::{AllanPoint, Curve, Model, NoiseTerm, slope_method};
use measurement::DataSheetDeviation;
use serde::ser::SerializeStruct;
use serde::{Deserialize, Serialize, Serializer};
use std::collections::BTreeMap;

/// Version of the JSON schema; the field names are fixed within a version.
pub const SCHEMA: u32 = 2;

/// A whole analysis. Its JSON is without the findings, which the crate of the reports adds with each channel's numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    pub schema: u32,
    /// True if the report is of the curves alone, without what needs the samples themselves: spectra, spikes, steps, covariates,
    /// causes that channels have in common, and changes of the noise. Absent where it is not.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub quick: bool,
    /// Stated by the user or measured by the time stamps, Hz.
    pub sample_rate_hz: f64,
    /// Samples that the estimator used.
    pub samples: u64,
    /// Samples that are missing or were refused, by cause; `gap` counts those that never arrived.
    pub dropped: BTreeMap<String, u64>,
    /// Samples that are used although a warning was raised, by cause.
    pub flagged: BTreeMap<String, u64>,
    pub part: PartReport,
    /// Causes that the baseline models lack, one entry each.
    #[serde(skip)]
    pub findings: Vec<Finding>,
    /// Regression of the gyros and accelerometers on each other; absent where there are fewer than two, or too few samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub common_mode: Option<CommonModeRegression>,
    /// The longest part at rest by the rows of its file, s from the first of them, where the platform moved and the file was looked at.
    /// Not in the JSON, which says nothing of the file; `None` leaves it to [`ChannelReport::at_rest`].
    #[serde(skip)]
    pub longest_at_rest: Option<Stretch>,
    /// In the order of the burst.
    pub channels: Vec<ChannelReport>,
}

pub(crate) fn by_cause(counts: &BTreeMap<&'static str, u64>) -> BTreeMap<String, u64> {
    counts.iter().map(|(&cause, &count)| (cause.to_owned(), count)).collect()
}

/// Properties that a sensor has once for all its channels: the clock of its converter and the low-pass filter before its output.
///
/// Properties that the record does not identify are absent, and `notes` say why.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct PartReport {
    pub name: String,
    /// Rate of the sensor's own sample clock, Hz.
    pub clock: Option<Parameter>,
    /// Window of the filter: `bartlett`, `moving_average` or `none`.
    pub filter: Option<String>,
    /// Taps of each stage of the filter.
    pub taps: Option<Parameter>,
    /// Samples of the sensor's own clock from one recorded sample to the next.
    pub decimation: Option<Parameter>,
    pub notes: Vec<PartNote>,
}

/// Why a record does not identify the clock or the filter of a part, or not fully.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PartNote {
    /// A quick report does not look for them.
    NotSought,
    /// The noise of every inertial channel is smaller than a step of its counts, whose rounding hides the filter.
    CountsTooCoarse,
    /// Neighbouring samples are not correlated: there is no filter, or one shorter than the sample period.
    NotCorrelated { period_s: f64 },
    /// Fewer than half of the channels are correlated as behind a filter.
    Minority(Vec<&'static str>),
    /// Every value of the filter is recorded, so that the clock is the sample rate; without time stamps that is stated, not measured.
    StatedClock { sample_rate_hz: f64 },
    /// There are no time stamps to measure the clock by.
    NoTimeStamps {
        nominal_hz: f64,
        /// The sample rate at that clock, with 95 % bounds, Hz.
        sample_rate_hz: BoundedEstimate,
        stated_hz: f64,
    },
    /// The spectra give the length of the filter; the taps follow from the nominal clock.
    LengthAlone {
        /// Length of the filter in samples of the record.
        length: f64,
        /// The taps whose clock is nearest to the nominal one.
        taps: u16,
        /// Taps that have the same length, at another clock.
        other_taps: Vec<u16>,
        nominal_hz: f64,
    },
    /// A channel's own decimation is farther from the common one than chance explains.
    Contradicted { channel: &'static str, decimation: f64 },
    /// Number of channels that show the filter, and of those `able` to: their noise is larger than a count.
    NotInAll { showing: usize, able: usize },
}

/// A stretch of the record, in seconds from its first sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stretch {
    pub from_s: f64,
    pub to_s: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelReport {
    /// The channel's name, such as `gyro_z`.
    pub name: String,
    /// Unit of every deviation of the channel, such as `deg/s`.
    pub unit: String,
    /// Samples that arrived and were used as a whole, in every channel.
    pub samples: u64,
    #[serde(flatten)]
    pub missing: MissingSamples,
    /// Allan deviation over the whole record as recorded, without preprocessing, octave by octave.
    pub curve: Vec<CurvePoint>,
    /// Allan deviation of the second half as recorded, unseen by the models, at the first averaging times of `curve`, as many as it has.
    pub unseen_adev: Vec<f64>,
    pub read_off: SlopeMethodReport,
    /// The baseline model: angle random walk, bias instability, rate random walk.
    pub before: ModelReport,
    /// Effects that the baseline model lacks.
    pub effects: Vec<ChannelEffect>,
    /// The baseline model with the terms that were added.
    pub after: ModelReport,
    /// Against the second half, of the curve of the first half taken for a model. A model that describes the first half exactly
    /// leaves as much: it is what the second half does not repeat.
    pub first_half_curve: ModelErrorReport,
    /// The model of `after`, fitted once more to the whole record; its errors are those of `after`, because no unseen data is left.
    #[serde(rename = "final")]
    pub refitted: ModelReport,
    /// How the noise changes in the course of the record: of gyros and accelerometers, where the record is long enough for epochs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nonstationarity: Option<Nonstationarity>,
    /// Stretches in which the sensor was at rest: those without a motion of any channel.
    pub at_rest: Vec<Stretch>,
    #[serde(rename = "practice")]
    pub assessment: Assessment,
    #[serde(flatten)]
    pub figure_data: FigureData,
}

/// Samples that are missing in a channel, counted apart: lost on the way, refused by cause, replaced by the estimator.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct MissingSamples {
    pub lost: u64,
    /// Samples that arrived and are not used, by cause: those that the reader refused in all channels or in this one, and
    /// what the analysis keeps out of the coefficients (`repeated`, `spikes`, `knock`).
    pub refused: BTreeMap<String, u64>,
    /// Samples among these that the estimator replaced from their neighbours. The others lie in gaps that no octave bridges.
    pub replaced: u64,
}

/// One octave of the measured Allan deviation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Averaging factor, samples.
    pub n: u64,
    pub tau_s: f64,
    /// Allan deviation in the channel's unit.
    pub adev: f64,
    pub low: f64,
    /// Infinite if unknown.
    #[serde(deserialize_with = "unbounded")]
    pub high: f64,
    /// Equivalent degrees of freedom.
    pub edf: f64,
    /// Share of the samples that were missing and replaced from their neighbours, %. 0 where the differences over gaps are left out.
    #[serde(default)]
    pub replaced_percent: f64,
    /// `100/sqrt(2(N/n−1))`: the percentage accuracy of a point in the slope method, for `N` samples.
    #[serde(default)]
    pub accuracy_percent: f64,
    /// Allan deviation by equation (5) from the measured spectrum, in the channel's unit; absent at averaging times of more
    /// than a sixteenth of the record, which the spectrum does not resolve.
    pub adev_by_spectrum: Option<f64>,
    /// Allan deviation of correlated rounding errors, a part of `adev` and of the models'; 0 where they are white, and so a part of N.
    #[serde(default)]
    pub rounding: f64,
}

impl CurvePoint {
    /// A point of a curve of `samples` samples, in the curve's unit, without the deviation by the spectrum.
    #[must_use]
    pub fn new(point: &AllanPoint, samples: u64) -> Self {
        Self {
            n: point.n,
            tau_s: point.tau,
            adev: point.avar.sqrt(),
            low: point.low.sqrt(),
            high: point.high.sqrt(),
            edf: point.edf,
            replaced_percent: 100.0 * point.replaced,
            accuracy_percent: slope_method::percentage_accuracy(samples, point.n),
            adev_by_spectrum: None,
            rounding: 0.0,
        }
    }
}

/// Coefficients by the slope method; absent where the curve has no such slope.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SlopeMethodReport {
    /// The line of slope −½ at 1 s.
    pub angle_random_walk: Option<SlopeMethodValue>,
    /// The flat minimum times `sqrt(π/(2 ln 2))`.
    pub bias_instability: Option<SlopeMethodValue>,
    /// The line of slope +½ at 3 s.
    pub rate_random_walk: Option<SlopeMethodValue>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SlopeMethodValue {
    pub value: f64,
    /// Such as `deg/sqrt(s)`.
    pub unit: String,
    /// The interval in which the slope was found.
    pub from_s: f64,
    pub to_s: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelReport {
    /// The terms, with their parameters; none of a channel that never changes or has no samples.
    pub terms: Vec<TermReport>,
    /// The model's Allan deviation at each point of the curve, in the channel's unit.
    pub adev: Vec<f64>,
    /// Against the data that the model was fitted to: the first half of the record or, where the first half itself shows that
    /// the noise changes, the median of the epochs of its later half.
    pub fitted: ModelErrorReport,
    /// Against the second half of the record as it was recorded, which was not used in the fit.
    pub unseen: ModelErrorReport,
    /// Against the second half without the spikes and knocks that the rules of the first half exclude; absent where they exclude nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unseen_excluding: Option<ModelErrorReport>,
    /// The spikes and knocks that the model foretells; absent where the first half has none, and of the baseline model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub events: Option<EventsReport>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct TermReport {
    /// The term with the 95 % bounds of its coefficient and of its shape.
    pub term: FittedTerm,
    /// N below the corner of a Markov process that stands in the place of white noise, which a filter has made of it; absent of other terms.
    pub white_noise: Option<BoundedEstimate>,
    pub unit: String,
}

/// Error of a model over the octaves with `n ≤ M/8` of `M` samples, absent without any, and its largest deviation over all octaves.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ModelErrorReport {
    /// `mean edf·(ln(m/v) + v/m − 1)`; 1 is what a true model scores on the data that it was fitted to.
    pub deviance_per_point: Option<f64>,
    /// `100·sqrt(mean (½ ln(v/m))²)`.
    pub rms_percent: Option<f64>,
    /// The largest deviation of a point in standard deviations over *all* octaves; positive where the measured variance exceeds the model.
    pub worst_sigma: Option<f64>,
    pub worst_tau_s: Option<f64>,
    /// Modelled over measured Allan deviation of that point.
    pub worst_ratio: Option<f64>,
    /// The octave at which the measured variance is least probable under the model; absent where chance explains it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contradiction: Option<Contradiction>,
}

/// Data of the figures of a channel beside its Allan deviation.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FigureData {
    /// Typical noise by the data sheet; absent where it says nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data_sheet: Option<DataSheetReport>,
    /// Measured spectrum; absent where the record is too short.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spectrum: Option<SpectrumReport>,
    /// Bias over time; absent where the record is too short.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias_over_time: Option<BiasOverTime>,
}

/// Typical noise of a channel by its data sheet, in the channel's unit and seconds; `None` where it says nothing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DataSheetReport {
    /// Angle or velocity random walk, unit·√s.
    pub angle_random_walk: Option<f64>,
    /// The Allan deviation at the minimum of its curve, in the channel's unit.
    pub in_run_bias_stability: Option<f64>,
    /// Rate random walk, unit/√s.
    pub rate_random_walk: Option<f64>,
    /// The drawn curve of the Allan deviation, by averaging time; absent where the data sheet draws none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub curve: Vec<DataSheetDeviation>,
}

/// Root of the one-sided density of a channel as recorded, unit/√Hz, by ascending frequency; lines out of a band have their own point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpectrumReport {
    pub frequency_hz: Vec<f64>,
    pub density: Vec<f64>,
    pub low: Vec<f64>,
    pub high: Vec<f64>,
    /// By the model `final`, without its sinusoids and without what follows a covariate.
    pub model: Vec<f64>,
}

/// Means of successive blocks of a channel, less the mean of them all, in the channel's unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BiasOverTime {
    pub block_s: f64,
    /// Middle of each block, s from the first sample. Blocks without half of their samples are left out.
    pub time_s: Vec<f64>,
    pub mean: Vec<f64>,
    /// The part that the channel's findings explain: steps, a ramp, temperature, supply and specific force. Empty if they explain nothing.
    pub followed: Vec<f64>,
}

impl SlopeMethodReport {
    /// Reads N, B and K off the slopes of `curve`, whose channel is in `unit`.
    #[must_use]
    pub fn from_curve<const POINTS: usize>(curve: &Curve<POINTS>, unit: &str) -> Self {
        let value = |coefficient: Option<slope_method::SlopeEstimate>, kind: NoiseTerm| {
            coefficient.map(|coefficient| SlopeMethodValue {
                value: coefficient.value,
                unit: coefficient_unit(&kind, unit),
                from_s: *coefficient.interval.start(),
                to_s: *coefficient.interval.end(),
            })
        };
        Self {
            angle_random_walk: value(slope_method::angle_random_walk(curve), NoiseTerm::AngleRandomWalk),
            bias_instability: value(slope_method::bias_instability(curve), NoiseTerm::BiasInstability),
            rate_random_walk: value(slope_method::rate_random_walk(curve), NoiseTerm::RateRandomWalk),
        }
    }
}

impl TermReport {
    #[must_use]
    pub fn new(term: &FittedTerm, unit: &str) -> Self {
        Self { term: *term, white_noise: None, unit: unit.to_owned() }
    }

    /// Name of the kind, such as `angle_random_walk`.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        self.term.kind.name()
    }

    #[must_use]
    pub fn coefficient(&self) -> Parameter {
        let FittedTerm { kind, value, low, high, .. } = &self.term;
        Parameter::new(*value, *low, *high, coefficient_unit(kind, &self.unit))
    }

    /// N of a term that is white noise, behind a filter or not; otherwise `None`.
    #[must_use]
    pub fn angle_random_walk(&self) -> Option<Parameter> {
        if is_white(&self.term.kind) {
            return Some(self.coefficient());
        }
        let BoundedEstimate { value, low, high } = self.white_noise?;
        Some(Parameter::new(value, low, high, coefficient_unit(&NoiseTerm::AngleRandomWalk, &self.unit)))
    }

    /// The parameters of its shape, and its coefficient, by name; N, B, K and Q call theirs `value`. A Markov process in the place of white noise
    /// has the `white_noise` below its corner.
    #[must_use]
    pub fn parameters(&self) -> BTreeMap<&'static str, Parameter> {
        let shape = |(name, value, (low, high)): (&'static str, f64, (f64, f64))| {
            let unit = match name {
                "frequency" | "bandwidth" => "Hz",
                "time_constant" => "s",
                _ => "",
            };
            (name, Parameter::new(value, low, high, unit))
        };
        let below_corner = self.white_noise.and_then(|_| Some(("white_noise", self.angle_random_walk()?)));
        let coefficient = (self.term.kind.coefficient(), self.coefficient());
        self.term.shape_parameters().map(shape).chain([coefficient]).chain(below_corner).collect()
    }
}

impl Serialize for TermReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut written = serializer.serialize_struct("TermReport", 2)?;
        written.serialize_field("kind", self.kind())?;
        written.serialize_field("parameters", &self.parameters())?;
        written.end()
    }
}

/// The terms of a model of a channel in `unit`, whose values differ by `resolution` or more, without those of which the record says nothing, as of a channel that never
/// changes: their upper bound is 0.
#[must_use]
pub fn term_reports(model: &Model, unit: &str, resolution: f64) -> Vec<TermReport> {
    let report = |term: &FittedTerm| {
        let white_noise = white_noise_of_process(model, term, resolution);
        TermReport { white_noise, ..TermReport::new(term, unit) }
    };
    model.terms().iter().filter(|term| term.high > 0.0).map(report).collect()
}

impl ModelErrorReport {
    #[must_use]
    pub fn new<const POINTS: usize>(model: &Model, curve: &Curve<POINTS>) -> Self {
        let error = allan_core::model::Discrepancy::between(model, curve);
        let finite = |value: f64| value.is_finite().then_some(value);
        Self {
            deviance_per_point: error.and_then(|error| finite(error.deviance_per_point)),
            rms_percent: error.and_then(|error| finite(error.rms_percent)),
            worst_sigma: error.and_then(|error| finite(error.worst_sigma)),
            worst_tau_s: error.and_then(|error| finite(error.worst_tau)),
            worst_ratio: error.and_then(|error| finite(error.worst_ratio.sqrt())),
            contradiction: error.and_then(|_| Contradiction::find(model, curve)),
        }
    }

    /// The error against `curve` of `model` with the signals, and the spikes and knocks, that are foretold.
    pub(crate) fn with_shares<const POINTS: usize>(
        model: &Model,
        (signals, events): (&SignalShare, &EventShare),
        curve: &Curve<POINTS>,
    ) -> Self {
        if signals.is_empty() && events.is_empty() {
            return Self::new(model, curve);
        }
        let predicted = |point: &AllanPoint| events.added_to(signals.predicted(model, point), point.n);
        let error = Self::by_points(curve, |point| Some(predicted(point)));
        Self { contradiction: Contradiction::find_by(model, curve, predicted), ..error }
    }

    /// The error on `curve` of another curve, `other`, taken for a model, with the degrees of freedom of `model` and of the `events` in
    /// it. Octaves that `other` lacks are left out.
    pub(crate) fn of_curve<const POINTS: usize>(
        other: &Curve<POINTS>,
        curve: &Curve<POINTS>,
        model: &Model,
        events: &EventShare,
    ) -> Self {
        Self::by_points(curve, |point| {
            let of = other.points().iter().find(|of| of.n == point.n && of.avar * point.avar > 0.0)?;
            Some((of.avar, events.degrees_of_freedom(model.edf(point), (events.avar(of.n) / of.avar).min(1.0))))
        })
    }

    /// The error against `curve` of what is `modelled` at each of its points: the Allan variance, and the degrees of freedom of one that
    /// measures it. Points without are left out.
    fn by_points<const POINTS: usize>(
        curve: &Curve<POINTS>,
        modelled: impl Fn(&AllanPoint) -> Option<(f64, f64)>,
    ) -> Self {
        let (mut deviance, mut square, mut points) = (0.0, 0.0, 0.0);
        let (mut sigma, mut tau, mut ratio) = (0.0_f64, None, None);
        for point in curve.points() {
            let Some((avar, edf)) = modelled(point) else { continue };
            let measured = point.avar / avar;
            let deviation = cube_root_deviation(measured, edf);
            if deviation.abs() > sigma.abs() {
                (sigma, tau, ratio) = (deviation, Some(point.tau), Some((1.0 / measured).sqrt()));
            }
            if point.n <= curve.samples() / 8 {
                deviance += edf * (measured - 1.0 - measured.ln());
                square += measured.ln().powi(2) / 4.0;
                points += 1.0;
            }
        }
        let mean = |sum: f64| (points > 0.0 && sum.is_finite()).then(|| sum / points);
        Self {
            deviance_per_point: mean(deviance),
            rms_percent: mean(square).map(|square| 100.0 * square.sqrt()),
            worst_sigma: tau.is_some().then_some(sigma),
            worst_tau_s: tau,
            worst_ratio: ratio,
            contradiction: None,
        }
    }
}
