//! The noise of gyroscopes and accelerometers in SI units, axis by axis.

use super::exported_file::{AxisChoice, ExportError};
use crate::coefficients::KINDS;
use crate::rounding::is_upper_bound;
use crate::saved_report::{SavedChannel, SavedReport, SavedTerm};
use allan_core::model::FittedTerm;
use allan_core::term::Markov;
use allan_core::{Model, NoiseTerm};
use noise_analysis::fit::gauss_markov::{self, GaussMarkovFit, SlowNoise, SlowOctave};
use noise_analysis::report::{CurvePoint, Parameter};

/// Standard gravity, m/s².
pub(super) const GRAVITY: f64 = 9.806_65;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sensor {
    Gyroscope,
    Accelerometer,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Coefficient {
    /// In SI units; the upper 95 % bound if only that is known.
    pub value: f64,
    pub is_bound: bool,
    pub estimate: f64,
}

/// The noise of one axis in rad/s or m/s², and s.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AxisNoise<'a> {
    pub channel: &'a SavedChannel,
    pub to_si: f64,
    /// N, rad/s/√Hz or m/s²/√Hz.
    pub white: Option<Coefficient>,
    /// B, rad/s or m/s².
    pub bias_instability: Option<Coefficient>,
    /// K, rad/s²/√Hz or m/s³/√Hz.
    pub walk: Option<Coefficient>,
}

impl Sensor {
    pub(super) fn prefix(self) -> &'static str {
        match self {
            Self::Gyroscope => "gyro_",
            Self::Accelerometer => "accl_",
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Gyroscope => "gyroscope",
            Self::Accelerometer => "accelerometer",
        }
    }

    /// Factor from a channel's unit to rad/s or m/s².
    fn to_si(self, unit: &str) -> Option<f64> {
        match (self, unit) {
            (Self::Gyroscope, "deg/s") => Some(std::f64::consts::PI / 180.0),
            (Self::Accelerometer, "g") => Some(GRAVITY),
            (Self::Gyroscope, "rad/s") | (Self::Accelerometer, "m/s^2") => Some(1.0),
            _ => None,
        }
    }

    pub(super) fn axes(self, report: &SavedReport) -> Vec<AxisNoise<'_>> {
        let own = report.channels.iter().filter(|channel| channel.name.starts_with(self.prefix()));
        own.filter_map(|channel| self.axis(channel)).collect()
    }

    fn axis(self, channel: &SavedChannel) -> Option<AxisNoise<'_>> {
        let to_si = self.to_si(&channel.unit)?;
        let [white, bias_instability, walk] = KINDS.map(|kind| coefficient(channel, kind, to_si));
        Some(AxisNoise { channel, to_si, white, bias_instability, walk })
    }

    pub(super) fn three_axes(self, report: &SavedReport) -> Result<[AxisNoise<'_>; 3], ExportError> {
        let axes = self.axes(report);
        let axis = |letter: &str| {
            let name = format!("{}{letter}", self.prefix());
            let found = axes.iter().find(|axis| axis.channel.name == name);
            found.cloned().ok_or(ExportError::NoAxis { channel: name })
        };
        Ok([axis("x")?, axis("y")?, axis("z")?])
    }
}

/// `None` if the upper bound is zero.
fn coefficient(channel: &SavedChannel, kind: &str, to_si: f64) -> Option<Coefficient> {
    let Parameter { value, low, high, .. } = channel.coefficient(kind)?;
    let is_bound = is_upper_bound(value, low) && high.is_finite();
    let shown = if is_bound { high } else { value };
    let is_number = shown > 0.0 && shown.is_finite();
    is_number.then_some(Coefficient { value: shown * to_si, is_bound, estimate: value * to_si })
}

pub(super) fn combine(values: impl Iterator<Item = f64> + Clone, choice: AxisChoice) -> Option<f64> {
    let count = values.clone().count();
    (count > 0).then(|| match choice {
        AxisChoice::Rms => (values.map(|value| value * value).sum::<f64>() / count as f64).sqrt(),
        AxisChoice::Worst => values.fold(0.0, f64::max),
    })
}

/// The Gauss-Markov process, in SI units, for all slow noise in the models of `axes`.
pub(super) fn gauss_markov(axes: &[AxisNoise<'_>], report: &SavedReport) -> Option<GaussMarkovFit> {
    let period = 1.0 / report.sample_rate_hz;
    let slow: Vec<SlowNoise> = axes.iter().map(|axis| slow_noise(axis, period)).collect();
    gauss_markov::fit(&slow, period)
}

/// B, K and the Markov process of an axis, unless it replaces white noise, and the whole model.
fn slow_noise(axis: &AxisNoise<'_>, period: f64) -> SlowNoise {
    let AxisNoise { channel, to_si, bias_instability, walk, .. } = axis;
    let mut terms = Vec::new();
    for (kind, of) in [(NoiseTerm::BiasInstability, bias_instability), (NoiseTerm::RateRandomWalk, walk)] {
        terms.extend(of.map(|of| FittedTerm::exact(kind, of.estimate)));
    }
    let is_slow = |term: &&SavedTerm| term.kind == "markov" && !term.is_in_place_of_white_noise();
    for term in channel.refitted.terms.iter().filter(is_slow) {
        if let (Some(deviation), Some(time)) = (term.parameters.get("deviation"), term.parameters.get("time_constant"))
        {
            let kind = NoiseTerm::Markov(Markov { time_constant: time.value });
            terms.push(FittedTerm::exact(kind, deviation.value * to_si));
        }
    }
    let model = Model::new(period, terms);
    let octave = |(point, adev): (&CurvePoint, &f64)| {
        let slow = model.avar(point.n);
        SlowOctave { n: point.n, model: f64::max(adev * adev * to_si * to_si, slow), slow, edf: point.edf }
    };
    SlowNoise { octaves: channel.curve.iter().zip(&channel.refitted.adev).map(octave).collect() }
}
