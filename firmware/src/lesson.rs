//! What an epoch teaches of an inertial channel, and what the next epoch, which was not seen, says to it.

use crate::compensation::{Causes, Followed, compensated, shift};
use crate::couplings::{FIRST, Means};
use crate::epoch::Epoch;
use crate::estimators::CHANNELS;
use crate::summary::{model_error, term_of};
use adis16405_driver::Config;
use allan_core::confidence::NORMAL_975;
use allan_core::fit::fit;
use allan_core::model::{MAX_TERMS, Term};
use allan_core::trace::{Found, Lines, MAX_ADDED, Trace, trace_while};
use allan_core::{Curve, Kind, Model};
use heapless::Vec;
use link::{Bounded, Cause, Checked, Coefficient, Drift, Effect, Learnt, ModelError};

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

/// What an epoch teaches of one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Taught {
    /// N, B and K of the stream itself.
    declared: Option<Declared>,
    /// What is subtracted from now on.
    causes: Causes,
    /// What N, B and K lack in the rest.
    trace: Trace,
}

impl Taught {
    /// Before the [study](Self::study) of a channel that was [found](crate::compensation::learn) to follow such `causes`.
    #[must_use]
    pub fn of(causes: Causes) -> Self {
        Self { declared: None, causes, trace: Trace::empty() }
    }

    /// Learns from an epoch what N, B and K lack in the inertial channel [`CHANNELS`]`[index]` without its causes.
    ///
    /// It takes seconds on a microcontroller. `keep_on` is asked again and again, and may do something else meanwhile;
    /// false, and the study unfinished, if it said no.
    #[must_use]
    pub fn study(&mut self, epoch: &Epoch, index: usize, config: Config, keep_on: &mut dyn FnMut() -> bool) -> bool {
        let done = self.trace(epoch, index, config, keep_on);
        self.declared =
            if self.causes.is_empty() { declared(&self.trace.before) } else { refitted(epoch, index, config) };
        done
    }

    #[inline(never)] // here and below: so that its stack is not everybody's
    fn trace(&mut self, epoch: &Epoch, index: usize, config: Config, keep_on: &mut dyn FnMut() -> bool) -> bool {
        let mut curve = Curve::empty();
        // Without what channels have in common there are no causes.
        let _ = compensated(&mut curve, epoch, index, config, &self.causes);
        self.trace.declare(&curve);
        let enough = self.trace.before_goodness.p_value > ENOUGH;
        enough || trace_while(&mut self.trace, &curve, Lines::InTheCurve, keep_on)
    }

    /// What is to be remembered of it.
    #[must_use]
    pub fn lesson(&self) -> Lesson {
        let traced = self.trace.after.terms().iter().map(|term| (term.kind, term.value)).collect();
        Lesson { declared: self.declared, traced, causes: self.causes.clone() }
    }

    /// What is to be said of it, learnt of [`CHANNELS`]`[index]` in the epoch with this number.
    #[must_use]
    pub fn message(&self, index: usize, epoch: u32) -> Learnt {
        let Self { causes, trace, .. } = self;
        Learnt {
            channel: CHANNELS[index] as u8,
            epoch,
            causes: causes.iter().map(cause).collect(),
            effects: trace.found.iter().map(|found| effect(found, &trace.after)).collect(),
            p_before: trace.before_goodness.p_value,
            p_after: trace.after_goodness.p_value,
        }
    }
}

#[inline(never)]
fn refitted(epoch: &Epoch, index: usize, config: Config) -> Option<Declared> {
    let mut curve = Curve::empty();
    epoch.draw(&mut curve, index, config);
    declared(&fit(&curve, &Kind::DECLARED))
}

/// What an epoch says to a lesson of the one before; `means` are that one's. `None` if there was no lesson, or if the epoch
/// does not know what it would take to compensate.
#[must_use]
pub fn check(lesson: &Lesson, means: Option<&Means>, epoch: &Epoch, index: usize, config: Config) -> Option<Checked> {
    let mut checked = Checked {
        channel: CHANNELS[index] as u8,
        epoch: epoch.number,
        before: before(lesson, epoch, index, config)?,
        after: None,
        shift: means.and_then(|means| shift(epoch, index, config, &lesson.causes, means)),
        drift: Vec::new(),
    };
    after(lesson, epoch, index, config, &mut checked)?;
    Some(checked)
}

/// The error of N, B and K on the stream.
#[inline(never)]
fn before(lesson: &Lesson, epoch: &Epoch, index: usize, config: Config) -> Option<Option<ModelError>> {
    let mut curve = Curve::empty();
    epoch.draw(&mut curve, index, config);
    Some(model_error(&lesson.declared(config)?, &curve))
}

/// The error of the traced model on the compensated stream, and the Allan deviations of both.
#[inline(never)]
fn after(lesson: &Lesson, epoch: &Epoch, index: usize, config: Config, checked: &mut Checked) -> Option<()> {
    let mut curve = Curve::empty();
    epoch.draw(&mut curve, index, config);
    let slow = curve.points().iter().filter(|point| point.n >= 1 << FIRST).take(link::MAX_DRIFTS);
    checked.drift.extend(slow.map(|raw| Drift { n: raw.n, raw: libm::sqrt(raw.avar), compensated: 0.0 }));
    compensated(&mut curve, epoch, index, config, &lesson.causes)?;
    let slow = curve.points().iter().filter(|point| point.n >= 1 << FIRST);
    checked.drift.iter_mut().zip(slow).for_each(|(drift, point)| drift.compensated = libm::sqrt(point.avar));
    checked.after = model_error(&lesson.traced(config)?, &curve);
    Some(())
}

fn cause(followed: &Followed) -> Cause {
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
