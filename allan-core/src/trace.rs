//! The trace: fits the baseline model (N, B, K) to a curve and adds the term that explains the residual best, until the
//! residual is within its uncertainty.
//!
//! It needs the curve alone; effects that only the samples show, such as lines of a spectrum, can be passed as
//! [candidates](LineCandidates).

mod candidates;

pub use candidates::LineCandidates;

use crate::curve::{AllanPoint, CurveView};
use crate::fit::{Baseline, FreeShapes, Goodness, deviance, estimate, goodness, set_bounds};
use crate::list::List;
use crate::math;
use crate::model::{MAX_TERMS, Model};
use crate::term::{AllTerms, MovingAverageFilter, NoiseTerm};
use candidates::Families;
use heapless::Vec;

/// Largest number of terms that a trace can add to the baseline model.
pub const MAX_ADDED: usize = MAX_TERMS - NoiseTerm::BASELINE.len();

/// Decrease of the deviance, in units of its scatter, that accepts an added parameter: 3.7 standard deviations squared.
const SIGNIFICANT: f32 = 14.0;
/// Additional decrease required for each further parameter.
const PER_PARAMETER: f32 = 4.0;

/// Fraction of the required decrease that the best starting shape must reach for its shape to be searched.
const PROMISING: f32 = 0.4;

/// A term that was missing in the baseline model.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct AddedTerm {
    /// Index of the term in the final model.
    pub term: usize,
    /// Decrease of the deviance when it was added, in units of its scatter: a squared significance.
    pub score: f64,
    /// The largest residual, in units of its uncertainty, before the term was added.
    pub residual: Residual,
}

/// Residual of the Allan deviation at one averaging factor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Residual {
    /// Averaging factor, samples.
    pub n: u64,
    /// `σ/σ_model − 1`.
    pub excess: f64,
    /// The residual in standard deviations.
    pub sigmas: f64,
}

/// The result of a [`trace`].
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Trace {
    /// The fitted baseline model.
    pub before: Model,
    /// Goodness of the baseline model.
    pub before_goodness: Goodness,
    /// The fitted model with the added terms.
    pub after: Model,
    /// Goodness of that model.
    pub after_goodness: Goodness,
    /// The added terms, in the order in which they were found; empty if the baseline model is complete.
    pub added: List<AddedTerm, MAX_ADDED>,
}

impl Trace {
    /// The baseline model (N, B, K) fitted to `curve`, without added terms.
    #[must_use]
    pub fn baseline<'a>(curve: impl Into<CurveView<'a>>) -> Self {
        let mut trace = Self::empty();
        trace.fit_baseline(curve);
        trace
    }

    /// A trace of no curve, to be filled in place by [`fit_baseline`](Self::fit_baseline).
    #[must_use]
    pub fn empty() -> Self {
        let nothing = Goodness { deviance: 0.0, p_value: 1.0 };
        let (before, after) = (Model::new(0.0, []), Model::new(0.0, []));
        Self { before, before_goodness: nothing, after, after_goodness: nothing, added: List::new() }
    }

    /// Replaces the trace by the [`baseline`](Self::baseline) of `curve`.
    pub fn fit_baseline<'a>(&mut self, curve: impl Into<CurveView<'a>>) {
        self.fit_baseline_in(curve.into());
    }

    #[inline(never)] // its stack frame would otherwise be part of every caller's
    fn fit_baseline_in(&mut self, curve: CurveView) {
        estimate::<AllTerms>(curve, &NoiseTerm::BASELINE, FreeShapes::None, &mut || true, &mut self.before);
        set_bounds(curve, &mut self.before);
        self.before_goodness = goodness(curve, &self.before);
        self.after.clone_from(&self.before);
        self.after_goodness = self.before_goodness;
        self.added.clear();
    }
}

/// Fits N, B and K to `curve` and adds the missing terms, the most significant first, until no candidate is
/// significant: a term must reduce the deviance by 14 times its scatter, and by 4 more for each further parameter.
///
/// The candidates are quantization, a rate ramp, Markov processes, the `lines`, and digital low-pass filters with the
/// starting shapes `filters`, with a decimation of 1 where every value is read. The first 64 of each are used.
///
/// # Cost
/// | `trace::trace` | Cortex-M4F | Cortex-M0+ |
/// |---|---|---|
/// | instructions | 138 million | — |
/// | instructions that add two terms | 2,760 million | — |
/// | stack, bytes | 9,740 | — |
/// | flash, bytes | 53,900 | — |
///
/// See [`guide::costs`](crate::guide::costs) for how they are counted.
#[must_use]
pub fn trace<'a>(curve: impl Into<CurveView<'a>>, lines: LineCandidates, filters: &[MovingAverageFilter]) -> Trace {
    let curve = curve.into();
    let mut trace = Trace::baseline(curve);
    let _completed = trace_while(&mut trace, curve, lines, filters, &mut || true);
    trace
}

/// Runs [`trace`] on a `trace` that holds the curve's [`Trace::baseline`]. `keep_on` is called before every fit of a
/// candidate. If it returns false, the trace is left unfinished and the result is false.
#[must_use]
pub fn trace_while<'a>(
    trace: &mut Trace,
    curve: impl Into<CurveView<'a>>,
    lines: LineCandidates,
    filters: &[MovingAverageFilter],
    keep_on: &mut dyn FnMut() -> bool,
) -> bool {
    let curve = curve.into();
    let mut search = Search { families: Families::new(curve, lines, filters), free: lines.free(), keep_on };
    search.complete(curve, trace).is_ok()
}

/// The candidates of a trace and the function that may cancel it.
struct Search<'a> {
    families: Families<'a>,
    free: FreeShapes<'a>,
    keep_on: &'a mut dyn FnMut() -> bool,
}

struct Cancelled;

/// The best extended set of terms: its decrease of the deviance beyond the required one, and its score.
struct Best {
    kinds: Vec<NoiseTerm, MAX_TERMS>,
    gain: f32,
    score: f64,
}

impl Search<'_> {
    fn complete(&mut self, curve: CurveView, trace: &mut Trace) -> Result<(), Cancelled> {
        while trace.after.terms().len() < MAX_TERMS && !trace.added.is_full() && self.extend(curve, trace)? {
            if trace.added.len() > 1 {
                self.reconsider(curve, &mut trace.after, &trace.added)?;
            }
        }
        if !trace.added.is_empty() {
            set_bounds(curve, &mut trace.after);
            trace.after_goodness = goodness(curve, &trace.after);
        }
        Ok(())
    }

    /// Adds the most significant term; false if there is none.
    #[inline(never)] // here and below: so that stack frames do not add up in the caller
    fn extend(&mut self, curve: CurveView, trace: &mut Trace) -> Result<bool, Cancelled> {
        let mut best = Best::NONE;
        self.most_significant(curve, &trace.after, &mut best)?;
        if best.kinds.is_empty() {
            return Ok(false);
        }
        let residual = largest_residual(curve, &trace.after);
        // A decimated filter replaces the white noise, which is the first term.
        let before = trace.after.terms().len();
        let term = if best.kinds.len() == before { 0 } else { before };
        estimate::<AllTerms>(curve, &best.kinds, self.free, self.keep_on, &mut trace.after);
        self.check_cancelled()?;
        // There is room: the caller adds nothing to a full list.
        let _ = trace.added.push(AddedTerm { term, score: best.score, residual });
        Ok(true)
    }

    /// Replaces each earlier added term by another candidate that fits significantly better.
    #[inline(never)]
    fn reconsider(&mut self, curve: CurveView, model: &mut Model, added: &[AddedTerm]) -> Result<(), Cancelled> {
        let mut other = Model::new(0.0, []);
        for known in added.iter().filter(|known| known.term >= NoiseTerm::BASELINE.len()) {
            let mut kinds = model.kinds();
            let old = kinds.remove(known.term);
            estimate::<AllTerms>(curve, &kinds, FreeShapes::None, self.keep_on, &mut other);
            let mut best = Best::NONE;
            self.most_significant(curve, &other, &mut best)?;
            // A decimated filter would change the order of the terms.
            if best.kinds.len() <= kinds.len() {
                continue;
            }
            let Some(new) = best.kinds.pop().filter(|new| new.name() != old.name()) else { continue };
            let _ = best.kinds.insert(known.term.min(kinds.len()), new);
            estimate::<AllTerms>(curve, &best.kinds, self.free, self.keep_on, &mut other);
            self.check_cancelled()?;
            if deviance(curve, &other) < deviance(curve, model) - SIGNIFICANT {
                core::mem::swap(model, &mut other);
            }
        }
        Ok(())
    }

    /// Sets `most` to the model extended by the most significant candidate; leaves it if none is.
    #[inline(never)]
    fn most_significant(&mut self, curve: CurveView, model: &Model, most: &mut Best) -> Result<(), Cancelled> {
        let mut baseline = Baseline::empty(curve);
        baseline.fill(model);
        let families = self.families;
        let mut kinds = model.kinds();
        let known = kinds.len();
        // A model with as many terms as points fits every curve. A point does not count if half of its samples were
        // replaced.
        let is_measured = |point: &&AllanPoint| point.avar > 0.0 && point.replaced < 0.5;
        if curve.points().iter().filter(is_measured).count() <= known {
            return Ok(());
        }
        for family in families.all() {
            let mut best: Option<(f32, NoiseTerm)> = None;
            for shape in families.shapes(family) {
                let Some(at) = insertion_index(&kinds[..known], &shape) else { continue };
                self.check_cancelled()?;
                let fall = with_candidate(&mut kinds, at, shape, |kinds| baseline.fall(kinds));
                if best.is_none_or(|(other, _)| fall.total_cmp(&other).is_ge()) {
                    best = Some((fall, shape));
                }
            }
            let cost = SIGNIFICANT + PER_PARAMETER * (family.parameters() - 1) as f32;
            let is_promising = |(fall, _): &(f32, NoiseTerm)| family.replaces_a_term() || *fall > PROMISING * cost;
            let Some((_, shape)) = best.filter(is_promising) else { continue };
            let Some(at) = insertion_index(&kinds[..known], &shape) else { continue };
            self.check_cancelled()?;
            let improvement =
                with_candidate(&mut kinds, at, shape, |kinds| baseline.improvement(kinds, self.free, self.keep_on));
            let gain = improvement.gain(cost);
            if gain > 0.0 && gain >= most.gain {
                (most.gain, most.score) = (gain, improvement.score());
                most.kinds.clone_from(baseline.tried());
            }
        }
        Ok(())
    }

    fn check_cancelled(&mut self) -> Result<(), Cancelled> {
        if (self.keep_on)() { Ok(()) } else { Err(Cancelled) }
    }
}

impl Best {
    const NONE: Self = Self { kinds: Vec::new(), gain: 0.0, score: 0.0 };
}

/// The index at which a candidate enters the terms, at the end or in place of one; `None` if it does not fit in.
fn insertion_index(kinds: &[NoiseTerm], candidate: &NoiseTerm) -> Option<usize> {
    let is_filter = |kind: &NoiseTerm| matches!(kind, NoiseTerm::Filtered(_));
    if kinds.contains(candidate) || (is_filter(candidate) && kinds.iter().any(is_filter)) {
        return None;
    }
    // A decimated filter cannot be told from its mixture with white noise, which it replaces.
    if matches!(candidate, NoiseTerm::Filtered(filter) if filter.decimation != 1.0) {
        return kinds.iter().position(|kind| *kind == NoiseTerm::AngleRandomWalk);
    }
    (kinds.len() < MAX_TERMS).then_some(kinds.len())
}

/// The result of `work` with a candidate among the terms, which are then restored.
fn with_candidate<T>(
    kinds: &mut Vec<NoiseTerm, MAX_TERMS>,
    at: usize,
    candidate: NoiseTerm,
    work: impl FnOnce(&[NoiseTerm]) -> T,
) -> T {
    let old = kinds.get(at).copied();
    match old {
        Some(_) => kinds[at] = candidate,
        // There is room: insertion_index returns none for a full model.
        None => _ = kinds.push(candidate),
    }
    let done = work(kinds);
    match old {
        Some(old) => kinds[at] = old,
        None => _ = kinds.pop(),
    }
    done
}

fn largest_residual(curve: CurveView, model: &Model) -> Residual {
    let residual = |point: &AllanPoint| {
        let excess = math::sqrt(point.avar / model.avar(point.n)) - 1.0;
        Residual { n: point.n, excess, sigmas: excess * math::sqrt(2.0 * model.edf(point)) }
    };
    let nothing = Residual { n: 1, excess: 0.0, sigmas: 0.0 };
    let residuals = curve.points().iter().filter(|point| point.avar > 0.0).map(residual);
    residuals.max_by(|a, b| math::abs(a.sigmas).total_cmp(&math::abs(b.sigmas))).unwrap_or(nothing)
}
