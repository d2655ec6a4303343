//! From a recording to a report: the estimator, the declared model, and its error on data that it has not seen.

use crate::recording::Recording;
use crate::report::{
    ChannelReport, CurvePoint, ModelError, ModelReport, Parameter, ReadOff, ReadOffValue, Report, SCHEMA, Term,
};
use crate::timeline::{Step, Timeline};
use adis16405_driver::Channel;
use allan_core::term::CoefficientUnit;
use allan_core::{Cascade, Curve, Kind, Model, check, fit::fit, read_off};
use firmware::{OCTAVES, OVERLAP};
use std::collections::BTreeMap;

/// The target's own.
type Estimator = Cascade<OCTAVES, OVERLAP>;

/// Analyses every channel of a recording along its timeline.
#[must_use]
pub fn analyze(recording: &Recording, timeline: &Timeline) -> Report {
    let used = timeline.steps.iter().filter(|step| matches!(step, Step::Sample(_))).count();
    Report {
        schema: SCHEMA,
        sample_rate_hz: timeline.sample_rate_hz,
        samples: used as u64,
        dropped: by_cause(&timeline.dropped),
        flagged: by_cause(&timeline.flagged),
        channels: recording
            .channels
            .iter()
            .map(|&channel| analyze_channel(recording, timeline, used, channel))
            .collect(),
    }
}

fn by_cause(counts: &BTreeMap<&'static str, u64>) -> BTreeMap<String, u64> {
    counts.iter().map(|(&cause, &count)| (cause.to_owned(), count)).collect()
}

fn analyze_channel(recording: &Recording, timeline: &Timeline, used: usize, channel: Channel) -> ChannelReport {
    let estimators = Estimators::run(recording, timeline, used / 2, channel);
    let curve =
        |estimator: &Estimator| estimator.curve(1.0 / timeline.sample_rate_hz).scaled(channel.lsb(recording.range));
    let (whole, first, second) = (curve(&estimators.whole), curve(&estimators.first), curve(&estimators.second));
    let model = fit(&first, &Kind::DECLARED);
    let whole = whole.with_confidence(|point| model.shares(point.n));
    let before = model_report(&model, channel.unit(), [&whole, &first, &second]);
    ChannelReport {
        name: channel.name().to_owned(),
        unit: channel.unit().to_owned(),
        samples: estimators.whole.len(),
        curve: curve_points(&whole),
        read_off: read_off(&whole, channel.unit()),
        after: before.clone(),
        before,
        effects: Vec::new(),
    }
}

/// One channel's estimators: over the whole record, over the half that is fitted, over the half that is not.
struct Estimators {
    whole: Estimator,
    first: Estimator,
    second: Estimator,
}

impl Estimators {
    fn run(recording: &Recording, timeline: &Timeline, half: usize, channel: Channel) -> Self {
        let mut estimators = Self { whole: Cascade::new(), first: Cascade::new(), second: Cascade::new() };
        let Self { whole, first, second } = &mut estimators;
        for &step in &timeline.steps {
            let part = if whole.len() < half as u64 { &mut *first } else { &mut *second };
            match step {
                Step::Gap(missing) => {
                    whole.gap(missing);
                    part.gap(missing);
                }
                Step::Sample(index) => {
                    let count = i32::from(recording.samples[index].counts.get(channel));
                    whole.push(count);
                    part.push(count);
                }
            }
        }
        estimators
    }
}

fn curve_points(curve: &Curve<OCTAVES>) -> Vec<CurvePoint> {
    let point = |point: &allan_core::Point| CurvePoint {
        n: point.n,
        tau_s: point.tau,
        adev: point.avar.sqrt(),
        low: point.low.sqrt(),
        high: point.high.sqrt(),
        edf: point.edf,
        accuracy_percent: read_off::percentage_accuracy(curve.samples(), point.n),
    };
    curve.points().iter().map(point).collect()
}

fn model_report(model: &Model, unit: &str, [whole, first, second]: [&Curve<OCTAVES>; 3]) -> ModelReport {
    let term = |term: &allan_core::model::Term| Term {
        kind: term.kind.name().to_owned(),
        parameters: BTreeMap::from([(
            term.kind.coefficient().to_owned(),
            Parameter { value: term.value, low: term.low, high: term.high, unit: coefficient_unit(term.kind, unit) },
        )]),
    };
    ModelReport {
        terms: model.terms().iter().map(term).collect(),
        adev: whole.points().iter().map(|point| model.avar(point.n).sqrt()).collect(),
        fitted: model_error(model, first),
        unseen: model_error(model, second),
    }
}

fn model_error(model: &Model, curve: &Curve<OCTAVES>) -> ModelError {
    let error = check::ModelError::between(model, curve);
    let finite = |value: f64| value.is_finite().then_some(value);
    ModelError {
        deviance_per_point: error.and_then(|error| finite(error.deviance_per_point)),
        rms_percent: error.and_then(|error| finite(error.rms_percent)),
    }
}

fn read_off(curve: &Curve<OCTAVES>, unit: &str) -> ReadOff {
    let value = |coefficient: Option<read_off::Coefficient>, kind| {
        coefficient.map(|coefficient| ReadOffValue {
            value: coefficient.value,
            unit: coefficient_unit(kind, unit),
            from_s: *coefficient.interval.start(),
            to_s: *coefficient.interval.end(),
        })
    };
    ReadOff {
        angle_random_walk: value(read_off::angle_random_walk(curve), Kind::AngleRandomWalk),
        bias_instability: value(read_off::bias_instability(curve), Kind::BiasInstability),
        rate_random_walk: value(read_off::rate_random_walk(curve), Kind::RateRandomWalk),
    }
}

/// The unit of a coefficient of a channel in `unit`.
fn coefficient_unit(kind: Kind, unit: &str) -> String {
    match (kind.unit(), unit.strip_suffix("/s")) {
        (CoefficientUnit::TimesSecond, Some(angle)) => angle.to_owned(),
        (CoefficientUnit::TimesSecond, None) => format!("{unit}*s"),
        (CoefficientUnit::TimesRootSecond, Some(angle)) => format!("{angle}/sqrt(s)"),
        (CoefficientUnit::TimesRootSecond, None) => format!("{unit}/sqrt(Hz)"),
        (CoefficientUnit::Itself, _) => unit.to_owned(),
        (CoefficientUnit::PerRootSecond, _) => format!("{unit}/sqrt(s)"),
        (CoefficientUnit::PerSecond, Some(angle)) => format!("{angle}/s^2"),
        (CoefficientUnit::PerSecond, None) => format!("{unit}/s"),
    }
}
