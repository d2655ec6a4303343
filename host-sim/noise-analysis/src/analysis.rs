//! From a recording to a report: the estimator, the declared model, what it lacks, and its error on data that it has
//! not seen.
//!
//! Effects are named on the whole record. The errors before and after come from the first half alone: what it shows
//! to be missing is added, and judged on the second half.

mod common;
mod compensation;
mod filter;
mod lines;
mod naming;
mod parts;
mod repairs;
mod spectral;
mod study;
mod walk;

use crate::detectors::block_means::NoiseGrids;
use crate::detectors::{bias, random_telegraph};
use crate::findings::Detection;
use crate::practice::Practice;
use crate::report::{
    ChannelReport, CurvePoint, Effect, ModelError, ModelReport, ReadOff, ReadOffValue, Report, SCHEMA, Term,
};
use crate::series::Series;
use crate::uniform_series::UniformSeries;
use crate::{OCTAVES, OVERLAP};
use allan_core::term::{CoefficientUnit, Markov, MovingAverageFilter, NoiseTerm};
use allan_core::{Cascade, Curve, Model, slope_method, telegraph};
use common::Common;
use compensation::compensated;
use lines::Line;
use measurement::{ChannelProfile, Measurement, Quantity, SensorProfile};
use parts::{Part, Parts};
use repairs::{Repairs, in_parallel};
use std::borrow::Cow;
use std::collections::BTreeMap;
use study::{Following, Study};

/// Behind a filter neighbouring samples are alike, and the noise shows at a few samples only.
const DITHERED_OCTAVES: usize = 7;

/// Levels that are as near to each other as this, in counts, may be two neighbouring counts.
const TWO_COUNTS: f64 = 1.5;
/// Lengths of a filter after which its rounded output is that of white noise again.
const SETTLED: f64 = 20.0;
/// Slowest filter, in samples to its time constant, that is told from a process of its own.
const LOW_PASS: f64 = 64.0;
/// Variance of rounding, in squares of its step.
const ROUNDING: f64 = 1.0 / 12.0;

/// The target's own.
type Estimator = Cascade<OCTAVES, OVERLAP>;

/// Analyses every channel of a measurement. What a model lacks is traced in the inertial channels.
#[must_use]
pub fn analyze(measurement: &Measurement) -> Report {
    Report {
        schema: SCHEMA,
        sample_rate_hz: measurement.sample_rate_hz,
        samples: measurement.len() as u64,
        dropped: by_cause(&measurement.dropped),
        flagged: by_cause(&measurement.flagged),
        channels: analyze_channels(measurement),
    }
}

fn by_cause(counts: &BTreeMap<&'static str, u64>) -> BTreeMap<String, u64> {
    counts.iter().map(|(&cause, &count)| (cause.to_owned(), count)).collect()
}

fn analyze_channels(measurement: &Measurement) -> Vec<ChannelReport> {
    let of = |quantities: [Quantity; 2]| {
        quantities.into_iter().flat_map(|quantity| measurement.of_quantity(quantity)).collect::<Vec<_>>()
    };
    let traced = of([Quantity::AngularRate, Quantity::SpecificForce]);
    let coupled = [traced.clone(), of([Quantity::Temperature, Quantity::SupplyVoltage])].concat();
    let profile = &measurement.profile;
    let noises = NoiseGrids::default();
    let repairs = Repairs::find(measurement, &traced, &noises);
    let recorded: Vec<ChannelProfile> = measurement.profiles().collect();
    let parts = Parts::of(measurement, &coupled, &repairs);
    let repaired = in_parallel(&coupled, |&channel| repairs.series(measurement, channel));
    let studies = in_parallel(&recorded, |&channel| {
        let traced = traced.iter().position(|of| *of == channel).map(|position| &repaired[position]);
        let studies = Studies::of(&parts, channel, traced, &repairs, &noises, &repaired, &profile.filters);
        let own = traced.map_or_else(|| Cow::Owned(Series::of(measurement, &channel)), Cow::Borrowed);
        // What the channel follows is no noise, and is in the series: there the declared model has to do.
        let trace = &studies.first.trace;
        let model = if studies.first.following.followed.is_empty() { &trace.after } else { &trace.before };
        let practice = Practice::of(&own, model);
        (studies, practice)
    });
    let (studies, practices): (Vec<Studies>, Vec<Practice>) = studies.into_iter().unzip();
    let mut studies: Vec<(ChannelProfile, Studies)> = recorded.into_iter().zip(studies).collect();
    let inertial = studies.iter_mut().filter(|(channel, _)| traced.contains(channel)).map(|(channel, own)| {
        let study = &mut own.both;
        filter::Channel { dithered: reaches(profile, study, parts.both.step_of(*channel), DITHERED_OCTAVES), study }
    });
    filter::agree(&mut inertial.collect::<Vec<_>>());
    let commons = commons(&studies);
    let report = |(((channel, own), measured), practice): ((&(ChannelProfile, Studies), &Curve<OCTAVES>), Practice)| {
        let unit = channel.unit;
        let mut effects: Vec<Effect> = Vec::new();
        if traced.contains(channel) {
            effects.extend(repairs.effects(*channel));
            let ramps = repairs.ramps(*channel);
            let common = commons.iter().find(|common| common.channels.contains(channel));
            let named = named(profile, &parts.both, *channel, own, common);
            effects.extend(named.into_iter().filter(|effect| !ramps || effect.kind != NoiseTerm::RateRamp.name()));
        }
        let whole = measured.clone().with_confidence(|point| own.first.trace.before.variance_fractions(point.n));
        ChannelReport {
            name: channel.name.to_owned(),
            unit: unit.to_owned(),
            samples: measurement.len() as u64,
            curve: curve_points(&whole),
            read_off: read_off(&whole, unit),
            before: own.before(&parts, *channel, unit, &whole),
            after: own.after(&parts, *channel, unit, &whole),
            effects,
            practice,
        }
    };
    studies.iter().zip(&parts.measured).zip(practices).map(report).collect()
}

/// A channel learnt from the first half, which predicts, and from both, which name.
struct Studies {
    first: Study,
    both: Study,
    /// Of the whole record.
    lines: Vec<Line>,
    /// Two levels between which the whole record jumps.
    two_levels: Option<Detection>,
    /// The samples less what they follow, where effects are traced.
    rest: Option<UniformSeries>,
}

impl Studies {
    /// `own` are the samples of a channel that is traced, `repaired` those of all that the parts hold.
    fn of(
        parts: &Parts,
        channel: ChannelProfile,
        own: Option<&Series>,
        repairs: &Repairs,
        noises: &NoiseGrids,
        repaired: &[Series],
        filters: &[MovingAverageFilter],
    ) -> Self {
        let position = parts.both.position(channel).unwrap_or_default();
        let Some(own) = own else {
            let [first, both] = [&parts.first, &parts.both].map(|part| Following::of(part, position, false, |_| None));
            let (first, both) = (Study::declared(first), Study::declared(both));
            return Self { first, both, lines: Vec::new(), two_levels: None, rest: None };
        };
        let own_half = own.first_half();
        let causes = parts.both.channels.iter().copied().zip(repaired).filter(|(cause, _)| repairs::is_slow(*cause));
        let (slow, courses): (Vec<ChannelProfile>, Vec<Series>) =
            causes.map(|(cause, series)| (cause, series.first_half())).unzip();
        let level = bias::find(&own_half, &courses.iter().collect::<Vec<_>>(), noises);
        let in_half = |cause: ChannelProfile| {
            let of = |(number, _): &&(usize, bias::BiasSensitivity)| slow[*number] == cause;
            level.sensitivities.iter().find(of).map(|(_, followed)| *followed)
        };
        let ramps = repairs.ramps(channel);
        let first = Following::of(&parts.first, position, ramps, in_half);
        let both = Following::of(&parts.both, position, ramps, |cause| repairs.followed(channel, cause));
        let without = |following: &Following| compensated(own, following, repaired);
        let half = without(&first).map(|rest| rest.first_half());
        let whole = without(&both);
        let (first, _) = spectral::study(first, &own_half, half.as_ref(), filters);
        let (both, lines) = spectral::study(both, own, whole.as_ref(), filters);
        let correlated: Vec<f64> = both.correlation_times().collect();
        let rest = UniformSeries::from_series(whole.as_ref().unwrap_or(own));
        let two_levels = random_telegraph::find(&rest, channel.unit, &correlated);
        Self { first, both, lines, two_levels, rest: Some(rest) }
    }

    fn before(&self, parts: &Parts, channel: ChannelProfile, unit: &str, whole: &Curve<OCTAVES>) -> ModelReport {
        let position = parts.first.position(channel).unwrap_or_default();
        let model = &self.first.trace.before;
        ModelReport {
            terms: terms(model, unit),
            adev: whole.points().iter().map(|point| model.avar(point.n).sqrt()).collect(),
            fitted: model_error(model, &parts.first.curve(position)),
            unseen: model_error(model, &parts.second.curve(position)),
        }
    }

    fn after(&self, parts: &Parts, channel: ChannelProfile, unit: &str, whole: &Curve<OCTAVES>) -> ModelReport {
        let position = parts.first.position(channel).unwrap_or_default();
        let model = &self.first.trace.after;
        // What the channel follows is in the measured curve, not in the model of the rest.
        let raw = parts.both.curve(position);
        let rest = self.first.following.compensated(&parts.both, position);
        let followed = |n: u64| {
            let of = |curve: &Curve<OCTAVES>| curve.points().iter().find(|point| point.n == n).map(|point| point.avar);
            of(&raw).zip(of(&rest)).map_or(0.0, |(raw, rest)| (raw - rest).max(0.0))
        };
        ModelReport {
            terms: terms(model, unit),
            adev: whole.points().iter().map(|point| (model.avar(point.n) + followed(point.n)).sqrt()).collect(),
            fitted: model_error(model, &self.first.following.curve),
            unseen: model_error(model, &self.first.following.compensated(&parts.second, position)),
        }
    }
}

/// Everything that the whole record shows in a channel beyond the declared model.
fn named(
    profile: &SensorProfile,
    part: &Part,
    channel: ChannelProfile,
    own: &Studies,
    common: Option<&Common>,
) -> Vec<Effect> {
    let internal_rate_hz = profile.internal_rate_hz;
    let period_s = own.both.trace.after.sample_period();
    let (study, unit) = (&own.both, channel.unit);
    let causes: Vec<_> = study.causes().map(|(cause, followed)| (part.channels[cause], *followed)).collect();
    let mut effects = naming::followed_effects(&causes, unit);
    // Where the noise does not reach from one count to the next, rounding is no noise, and the curve shows its steps.
    let step = part.step_of(channel);
    let dithered = reaches(profile, study, step, DITHERED_OCTAVES);
    // So much apart are two counts between which the noise decides.
    let steps_only = |found: &&Detection| {
        !reaches(profile, study, step, 1) && found.effect.parameters["amplitude"].value < TWO_COUNTS * step
    };
    let two_levels = own.two_levels.as_ref().filter(|found| !steps_only(found));
    // Behind a filter, what rounding adds is alike over as many samples as the noise is.
    let settled_s =
        if reaches(profile, study, step, 1) { 0.0 } else { SETTLED * spectral::filter_s(&study.trace.after) };
    for found in &study.trace.added {
        let term = &study.trace.after.terms()[found.term];
        match term.kind {
            NoiseTerm::Filtered(filter) => {
                effects.push(naming::filter_effect((term, &filter), found, unit, period_s, internal_rate_hz))
            }
            _ if !dithered => {}
            NoiseTerm::Markov(Markov { time_constant }) if time_constant < settled_s => {}
            NoiseTerm::Quantization if settled_s > 0.0 => {}
            // The spectrum tells them better.
            NoiseTerm::Sinusoid(_) | NoiseTerm::Resonance(_) => {}
            // As it shows in the curve.
            NoiseTerm::Markov(_) | NoiseTerm::RateRamp if two_levels.is_some() => {}
            // What is shared needs no second name.
            NoiseTerm::Markov(_) | NoiseTerm::RateRamp if common.is_some() => {}
            NoiseTerm::Markov(markov) if is_low_pass(&study.trace.after, markov, step) => {
                effects.push(naming::low_pass_effect(term, markov, found, period_s));
            }
            NoiseTerm::Markov(markov) => {
                match telegraph::kurtosis_ratio(&study.following.curve, &study.trace.after, markov) {
                    Some(verdict) if verdict.is_telegraph() => {
                        effects.push(naming::telegraph_effect(term, found, &verdict, unit, period_s));
                    }
                    _ => effects.push(naming::term_effect(term, found, unit, period_s)),
                }
            }
            _ => effects.push(naming::term_effect(term, found, unit, period_s)),
        }
    }
    let is_slow = |effect: &Effect| ["markov", "telegraph", "rate_ramp"].contains(&effect.kind.as_str());
    if common.is_none() && two_levels.is_none() && !effects.iter().any(is_slow) {
        let unbounded = walk::unbounded(&study.following.curve, &study.trace, channel);
        effects.extend(unbounded.map(|found| naming::unbounded_effect(&found, unit)));
    }
    effects.extend(two_levels.iter().map(|found| found.effect.clone()));
    effects.extend(common.map(|common| naming::common_effect(common, channel, unit)));
    effects.extend(own.lines.iter().map(|line| naming::line_effect(line, unit)));
    effects
}

/// Whether the noise of a channel reaches from one count, `step`, to the next within the first `octaves`.
fn reaches(profile: &SensorProfile, study: &Study, step: f64, octaves: usize) -> bool {
    let shortest = study.following.curve.points().iter().take(octaves).map(|point| point.avar);
    shortest.fold(0.0, f64::max) > profile.dithered_avar_counts2 * step * step
}

/// Whether a Markov term is what a first-order low-pass filter makes of white noise: it forgets within some samples, and
/// nothing is left that is white, or white before the part's own filter, but the rounding to steps.
fn is_low_pass(model: &Model, markov: Markov, step: f64) -> bool {
    let period_s = model.sample_period();
    let rounding = ROUNDING * step * step * period_s;
    let is_white = |kind: &NoiseTerm| matches!(kind, NoiseTerm::AngleRandomWalk | NoiseTerm::Filtered(_));
    let white = model.terms().iter().filter(|term| is_white(&term.kind));
    let left: f64 = white.map(|term| term.low * term.low).sum();
    markov.time_constant < LOW_PASS * period_s && left <= rounding
}

/// What channels of each sort share.
fn commons(studies: &[(ChannelProfile, Studies)]) -> Vec<Common> {
    let common = |quantity: &Quantity| {
        let members = studies.iter().filter(|(channel, _)| channel.quantity == *quantity);
        let (channels, rests): (Vec<ChannelProfile>, Vec<UniformSeries>) =
            members.filter_map(|(channel, own)| Some((*channel, own.rest.clone()?))).unzip();
        common::find(&channels, &rests)
    };
    in_parallel(&[Quantity::AngularRate, Quantity::SpecificForce], common).into_iter().flatten().collect()
}

fn curve_points(curve: &Curve<OCTAVES>) -> Vec<CurvePoint> {
    curve.points().iter().map(|point| CurvePoint::of(point, curve.samples())).collect()
}

fn terms(model: &Model, unit: &str) -> Vec<Term> {
    let term = |term: &allan_core::model::FittedTerm| Term {
        kind: term.kind.name().to_owned(),
        parameters: naming::parameters(term, unit),
    };
    model.terms().iter().map(term).collect()
}

fn model_error(model: &Model, curve: &Curve<OCTAVES>) -> ModelError {
    let error = allan_core::model::Discrepancy::between(model, curve);
    let finite = |value: f64| value.is_finite().then_some(value);
    ModelError {
        deviance_per_point: error.and_then(|error| finite(error.deviance_per_point)),
        rms_percent: error.and_then(|error| finite(error.rms_percent)),
    }
}

fn read_off(curve: &Curve<OCTAVES>, unit: &str) -> ReadOff {
    let value = |coefficient: Option<slope_method::SlopeEstimate>, kind: NoiseTerm| {
        coefficient.map(|coefficient| ReadOffValue {
            value: coefficient.value,
            unit: coefficient_unit(&kind, unit),
            from_s: *coefficient.interval.start(),
            to_s: *coefficient.interval.end(),
        })
    };
    ReadOff {
        angle_random_walk: value(slope_method::angle_random_walk(curve), NoiseTerm::AngleRandomWalk),
        bias_instability: value(slope_method::bias_instability(curve), NoiseTerm::BiasInstability),
        rate_random_walk: value(slope_method::rate_random_walk(curve), NoiseTerm::RateRandomWalk),
    }
}

/// The unit of a coefficient of a channel in `unit`.
fn coefficient_unit(kind: &NoiseTerm, unit: &str) -> String {
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
