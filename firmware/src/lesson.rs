//! What an epoch teaches of an inertial channel, and what the next epoch, which was not seen, says to it.

use crate::compensation::{Causes, compensated, learn, shift};
use crate::couplings::{FIRST, Means};
use crate::epoch::Epoch;
use crate::estimators::CHANNELS;
use crate::summary::{OCTAVES, model_error, term_of};
use adis16405_driver::Config;
use allan_core::confidence::NORMAL_975;
use allan_core::fit::fit;
use allan_core::model::{MAX_TERMS, Term};
use allan_core::trace::{Found, Lines, MAX_ADDED, Trace, trace_while};
use allan_core::{Curve, Kind, Model};
use heapless::Vec;
use link::{Bounded, Cause, Checked, Coefficient, Drift, Effect, Learnt};

/// Probability of the residual under N, B and K above which nothing is sought.
///
/// A term that is believed lowers the deviance by 14 of its scatter or more. A deviance that is met in one of five true models
/// has no room for that: it is below 14 for up to 10 degrees of freedom, as curves of a dozen octaves have them.
const ENOUGH: f64 = 0.2;

const _: () = assert!(MAX_ADDED == link::MAX_EFFECTS);

/// What was learnt of one channel: the coefficients alone, so that six of them take little room.
#[derive(Debug, Clone, PartialEq)]
pub struct Lesson {
    /// N, B and K of the stream itself.
    declared: Option<Declared>,
    /// The traced model of the compensated stream.
    traced: Vec<(Kind, f64), MAX_TERMS>,
    /// What is subtracted.
    pub causes: Causes,
}

type Declared = [f64; Kind::DECLARED.len()];

impl Lesson {
    /// Before anything was learnt.
    pub const NOTHING: Self = Self { declared: None, traced: Vec::new(), causes: Vec::new() };

    /// N, B and K of the stream itself; `None` before anything was learnt.
    #[must_use]
    pub fn declared(&self, config: Config) -> Option<Model> {
        Some(model(Kind::DECLARED.into_iter().zip(self.declared?), config))
    }

    /// Every term of the compensated stream.
    #[must_use]
    pub fn traced(&self, config: Config) -> Option<Model> {
        (!self.traced.is_empty()).then(|| model(self.traced.iter().copied(), config))
    }
}

fn model(terms: impl Iterator<Item = (Kind, f64)>, config: Config) -> Model {
    Model::new(1.0 / config.sample_period().hz(), terms.map(|(kind, value)| Term::exact(kind, value)))
}

/// The coefficients of a model of the declared terms.
fn declared(model: &Model) -> Option<Declared> {
    let mut values = model.terms().iter().map(|term| term.value);
    Some([values.next()?, values.next()?, values.next()?])
}

/// Learns from an epoch what the inertial channel [`CHANNELS`]`[index]` follows, and what N, B and K lack in the rest.
///
/// It takes seconds on a microcontroller. `keep_on` is asked again and again, and may do something else meanwhile; `None`
/// if it said no.
#[must_use]
#[inline(never)] // so that its stack is not everybody's
pub fn study(
    epoch: &Epoch,
    index: usize,
    config: Config,
    keep_on: &mut dyn FnMut() -> bool,
) -> Option<(Lesson, Learnt)> {
    let causes = learn(epoch, index, config, keep_on)?;
    let curve = compensated(epoch, index, config, &causes).unwrap_or_else(|| epoch.curve(index, config));
    let trace = traced(&curve, keep_on)?;
    let declared = if causes.is_empty() { declared(&trace.before) } else { refitted(&epoch.curve(index, config)) };
    let learnt = Learnt {
        channel: CHANNELS[index] as u8,
        epoch: epoch.number,
        causes: causes.iter().map(cause).collect(),
        effects: trace.found.iter().map(|found| effect(found, &trace.after)).collect(),
        p_before: trace.before_goodness.p_value,
        p_after: trace.after_goodness.p_value,
    };
    let traced = trace.after.terms().iter().map(|term| (term.kind, term.value)).collect();
    Some((Lesson { declared, traced, causes }, learnt))
}

#[inline(never)]
fn traced(curve: &Curve<OCTAVES>, keep_on: &mut dyn FnMut() -> bool) -> Option<Trace> {
    let declared = Trace::declared(curve);
    if declared.before_goodness.p_value > ENOUGH {
        return Some(declared);
    }
    trace_while(declared, curve, Lines::InTheCurve, keep_on)
}

#[inline(never)]
fn refitted(curve: &Curve<OCTAVES>) -> Option<Declared> {
    declared(&fit(curve, &Kind::DECLARED))
}

/// What an epoch says to a lesson of the one before; `means` are that one's. `None` if there was no lesson, or if the epoch
/// does not know what it would take to compensate.
#[must_use]
#[inline(never)]
pub fn check(lesson: &Lesson, means: Option<&Means>, epoch: &Epoch, index: usize, config: Config) -> Option<Checked> {
    let (declared, traced) = (lesson.declared(config)?, lesson.traced(config)?);
    let raw = epoch.curve(index, config);
    let compensated = compensated(epoch, index, config, &lesson.causes)?;
    let pairs = raw.points().iter().zip(compensated.points()).filter(|(point, _)| point.n >= 1 << FIRST);
    let drift = pairs.map(|(raw, compensated)| Drift {
        n: raw.n,
        raw: libm::sqrt(raw.avar),
        compensated: libm::sqrt(compensated.avar),
    });
    Some(Checked {
        channel: CHANNELS[index] as u8,
        epoch: epoch.number,
        before: model_error(&declared, &raw),
        after: model_error(&traced, &compensated),
        shift: means.and_then(|means| shift(epoch, index, config, &lesson.causes, means)),
        drift: drift.take(link::MAX_DRIFTS).collect(),
    })
}

fn cause(followed: &crate::compensation::Followed) -> Cause {
    let half_width = NORMAL_975 * followed.error;
    Cause {
        covariate: CHANNELS[followed.cause] as u8,
        value: followed.value,
        low: followed.value - half_width,
        high: followed.value + half_width,
        reference: followed.reference,
    }
}

fn effect(found: &Found, model: &Model) -> Effect {
    let Term { kind, value, low, high, shape } = model.terms()[found.term];
    let named = kind.shape().into_iter().zip(shape).filter(|((name, _), _)| !name.is_empty());
    Effect {
        coefficient: Coefficient { term: term_of(kind), value, low, high },
        shape: named.map(|((_, value), (low, high))| Bounded { value, low, high }).collect(),
        score: found.score,
        n: found.residual.n,
        excess: found.residual.excess,
        sigmas: found.residual.sigmas,
    }
}
