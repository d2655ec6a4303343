//! The loop: fit what is declared, look at the residual, name the term that is missing, add it, fit again.
//!
//! Works on curves alone, so it runs wherever the estimator does. What a curve cannot show — where a line stands to a
//! thousandth, when a step came — is for those who have the samples; the lines that they found are candidates here.

mod candidate;

use crate::fit::{Baseline, Free, Goodness, deviance, estimate, goodness, set_bounds};
use crate::model::{MAX_TERMS, Model};
use crate::{Curve, Kind, math};
use candidate::Families;
use heapless::Vec;

/// Terms beyond the declared ones that a trace can add.
pub const MAX_ADDED: usize = MAX_TERMS - Kind::DECLARED.len();

/// What one more parameter has to lower the deviance by, in units of its scatter, to be believed: the square of 3.7
/// standard deviations.
const CONVINCING: f32 = 14.0;
/// What each further parameter has to earn.
const PER_PARAMETER: f32 = 4.0;

/// Part of its cost that a candidate has to gain before its shape is searched for: between the shapes that are tried, the
/// best is rarely twice as good.
const PROMISING: f32 = 0.4;

/// A term that the declared model lacked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Which of the terms of the final model it is.
    pub term: usize,
    /// How much the deviance fell when it was added, in units of its scatter: the square of a number of standard
    /// deviations.
    pub score: f64,
    /// Where the residual was largest in units of its uncertainty before the term was added.
    pub residual: Residual,
}

/// Measured against modelled at one averaging factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Averaging factor, samples.
    pub n: u64,
    /// `σ/σ_model − 1`.
    pub excess: f64,
    /// The same in standard deviations.
    pub sigmas: f64,
}

/// What [`trace`] found.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// The declared model, fitted.
    pub before: Model,
    /// How well it describes the curve.
    pub before_goodness: Goodness,
    /// The model with what was missing.
    pub after: Model,
    /// How well that describes the curve.
    pub after_goodness: Goodness,
    /// What was added, in the order in which it was found. Empty: nothing is missing.
    pub found: Vec<Found, MAX_ADDED>,
}

/// Where lines are looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lines<'a> {
    /// In the curve itself, which sees strong ones.
    InTheCurve,
    /// Nowhere but at these terms, which a spectrum has shown.
    Known(&'a [Kind]),
}

impl Trace {
    /// N, B and K fitted to `curve`, and nothing sought.
    #[must_use]
    pub fn declared<const POINTS: usize>(curve: &Curve<POINTS>) -> Self {
        let mut trace = Self::empty();
        trace.declare(curve);
        trace
    }

    /// Of nothing: to be filled where it stands, as it is too large to be handed about on a small stack.
    #[must_use]
    pub fn empty() -> Self {
        let nothing = Goodness { deviance: 0.0, p_value: 1.0 };
        let (before, after) = (Model::new(0.0, []), Model::new(0.0, []));
        Self { before, before_goodness: nothing, after, after_goodness: nothing, found: Vec::new() }
    }

    /// Makes it that of [`declared`](Self::declared).
    #[inline(never)] // so that its stack is not everybody's
    pub fn declare<const POINTS: usize>(&mut self, curve: &Curve<POINTS>) {
        estimate(curve, &Kind::DECLARED, Free::Nothing, &mut || true, &mut self.before);
        set_bounds(curve, &mut self.before);
        self.before_goodness = goodness(curve, &self.before);
        self.after.clone_from(&self.before);
        self.after_goodness = self.before_goodness;
        self.found.clear();
    }
}

impl<'a> Lines<'a> {
    /// A spectrum tells the frequency of a sinusoid far better than a curve could.
    fn free(self) -> Free<'a> {
        Free::AllBut(match self {
            Self::InTheCurve => &[],
            Self::Known(lines) => lines,
        })
    }
}

/// Fits N, B and K to `curve` and adds what is missing, the most telling term first, until the residual is noise.
#[must_use]
pub fn trace<const POINTS: usize>(curve: &Curve<POINTS>, lines: Lines) -> Trace {
    let mut trace = Trace::declared(curve);
    let _nobody_said_no = trace_while(&mut trace, curve, lines, &mut || true);
    trace
}

/// The same from the curve's [`Trace::declared`] on, asking before every fit of a candidate and every step of a search
/// whether to keep on; false, and the trace unfinished, if the answer was no.
///
/// For a microcontroller that has other things to do as well: `keep_on` can do them.
#[must_use]
pub fn trace_while<const POINTS: usize>(
    trace: &mut Trace,
    curve: &Curve<POINTS>,
    lines: Lines,
    keep_on: &mut dyn FnMut() -> bool,
) -> bool {
    let mut search = Search { families: Families::new(curve, lines), free: lines.free(), keep_on };
    search.complete(curve, trace).is_ok()
}

/// The candidates, and whether to go on.
struct Search<'a> {
    families: Families<'a>,
    free: Free<'a>,
    keep_on: &'a mut dyn FnMut() -> bool,
}

/// Somebody said no.
struct Stopped;

/// The terms that explain most, and how much better they do than those before.
struct Best {
    kinds: Vec<Kind, MAX_TERMS>,
    gain: f32,
    score: f64,
}

impl Search<'_> {
    /// Adds what is missing.
    fn complete<const POINTS: usize>(&mut self, curve: &Curve<POINTS>, trace: &mut Trace) -> Result<(), Stopped> {
        while trace.after.terms().len() < MAX_TERMS && !trace.found.is_full() && self.extend(curve, trace)? {
            if trace.found.len() > 1 {
                self.reconsider(curve, &mut trace.after, &trace.found)?;
            }
        }
        if !trace.found.is_empty() {
            set_bounds(curve, &mut trace.after);
            trace.after_goodness = goodness(curve, &trace.after);
        }
        Ok(())
    }

    /// Adds the term that is most telling; false if there is none.
    #[inline(never)] // here and below: so that stack frames do not add up
    fn extend<const POINTS: usize>(&mut self, curve: &Curve<POINTS>, trace: &mut Trace) -> Result<bool, Stopped> {
        let mut best = Best::NONE;
        self.most_telling(curve, &trace.after, &mut best)?;
        if best.kinds.is_empty() {
            return Ok(false);
        }
        let residual = largest_residual(curve, &trace.after);
        // A filter that is read slowly has taken the place of the white noise.
        let before = trace.after.terms().len();
        let term = if best.kinds.len() == before { 0 } else { before };
        estimate(curve, &best.kinds, self.free, self.keep_on, &mut trace.after);
        self.go_on()?;
        // There is room: nothing is added to a full list.
        let _ = trace.found.push(Found { term, score: best.score, residual });
        Ok(true)
    }

    /// Terms that were found before others were known, put to the test again: each gives way to another that explains
    /// more.
    #[inline(never)]
    fn reconsider<const POINTS: usize>(
        &mut self,
        curve: &Curve<POINTS>,
        model: &mut Model,
        found: &[Found],
    ) -> Result<(), Stopped> {
        let mut other = Model::new(0.0, []);
        for known in found.iter().filter(|known| known.term >= Kind::DECLARED.len()) {
            let mut kinds = model.kinds();
            let old = kinds.remove(known.term);
            estimate(curve, &kinds, Free::Nothing, self.keep_on, &mut other);
            let mut best = Best::NONE;
            self.most_telling(curve, &other, &mut best)?;
            // A slowly read filter would change the order of the terms.
            if best.kinds.len() <= kinds.len() {
                continue;
            }
            let Some(new) = best.kinds.pop().filter(|new| new.name() != old.name()) else { continue };
            // In the place of the old one.
            let _ = best.kinds.insert(known.term.min(kinds.len()), new);
            estimate(curve, &best.kinds, self.free, self.keep_on, &mut other);
            self.go_on()?;
            if deviance(curve, &other) < deviance(curve, model) - CONVINCING {
                core::mem::swap(model, &mut other);
            }
        }
        Ok(())
    }

    /// The candidate that gains most beyond what its parameters cost; none if chance could do as much.
    #[inline(never)]
    fn most_telling<const POINTS: usize>(
        &mut self,
        curve: &Curve<POINTS>,
        model: &Model,
        most: &mut Best,
    ) -> Result<(), Stopped> {
        let mut baseline = Baseline::empty(curve);
        baseline.take(model);
        let families = self.families;
        let mut kinds = model.kinds();
        let known = kinds.len();
        for family in families.all() {
            let mut best: Option<(f32, Kind)> = None;
            for shape in families.shapes(family) {
                let Some(place) = place(&kinds[..known], &shape) else { continue };
                self.go_on()?;
                let fall = put(&mut kinds, place, shape, |kinds| baseline.fall(kinds));
                if best.is_none_or(|(other, _)| fall.total_cmp(&other).is_ge()) {
                    best = Some((fall, shape));
                }
            }
            let cost = CONVINCING + PER_PARAMETER * (family.parameters() - 1) as f32;
            let is_promising = |(fall, _): &(f32, Kind)| family.takes_a_place() || *fall > PROMISING * cost;
            let Some((_, shape)) = best.filter(is_promising) else { continue };
            let Some(place) = place(&kinds[..known], &shape) else { continue };
            self.go_on()?;
            let improvement =
                put(&mut kinds, place, shape, |kinds| baseline.improvement(kinds, self.free, self.keep_on));
            let gain = improvement.gain(cost);
            if gain > 0.0 && gain >= most.gain {
                (most.gain, most.score) = (gain, improvement.score());
                most.kinds.clone_from(baseline.tried());
            }
        }
        Ok(())
    }

    fn go_on(&mut self) -> Result<(), Stopped> {
        if (self.keep_on)() { Ok(()) } else { Err(Stopped) }
    }
}

impl Best {
    const NONE: Self = Self { kinds: Vec::new(), gain: 0.0, score: 0.0 };
}

/// Where a candidate belongs among the terms of a model; `None` if that has one that would be the same.
fn place(kinds: &[Kind], candidate: &Kind) -> Option<usize> {
    let is_filter = |kind: &Kind| matches!(kind, Kind::Filtered(_));
    if kinds.contains(candidate) || (is_filter(candidate) && kinds.iter().any(is_filter)) {
        return None;
    }
    // Read slowly, what is left of a filter cannot be told from a mixture with white noise: it takes its place.
    if matches!(candidate, Kind::Filtered(filter) if filter.decimation != 1.0) {
        return kinds.iter().position(|kind| *kind == Kind::AngleRandomWalk);
    }
    (kinds.len() < MAX_TERMS).then_some(kinds.len())
}

/// What `work` makes of the terms while a candidate is in its place.
fn put<T>(kinds: &mut Vec<Kind, MAX_TERMS>, place: usize, candidate: Kind, work: impl FnOnce(&[Kind]) -> T) -> T {
    let old = kinds.get(place).copied();
    match old {
        Some(_) => kinds[place] = candidate,
        // There is room: it has a place.
        None => _ = kinds.push(candidate),
    }
    let done = work(kinds);
    match old {
        Some(old) => kinds[place] = old,
        None => _ = kinds.pop(),
    }
    done
}

fn largest_residual<const POINTS: usize>(curve: &Curve<POINTS>, model: &Model) -> Residual {
    let of = |point: &crate::Point| {
        let excess = math::sqrt(point.avar / model.avar(point.n)) - 1.0;
        Residual { n: point.n, excess, sigmas: excess * math::sqrt(2.0 * model.edf(point)) }
    };
    let nothing = Residual { n: 1, excess: 0.0, sigmas: 0.0 };
    let residuals = curve.points().iter().filter(|point| point.avar > 0.0).map(of);
    residuals.max_by(|a, b| math::abs(a.sigmas).total_cmp(&math::abs(b.sigmas))).unwrap_or(nothing)
}
