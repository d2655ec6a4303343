//! The search for missing terms.

use crate::curve::{allan_curve, curve};
use crate::model::{allan_model, allan_term};
use crate::status::allan_status::{self, *};
use crate::status::status;
use crate::storage::{check, elements, store};
use allan_core::term::MovingAverageFilter;
use allan_core::trace::{LineCandidates, MAX_ADDED, Trace, trace_while};
use core::ffi::c_void;

/// Largest number of terms that a trace adds.
pub const ALLAN_MAX_ADDED: usize = 5;
/// Largest number of filters that a trace tries.
pub const ALLAN_MAX_FILTERS: usize = 64;
const _: () = assert!(ALLAN_MAX_ADDED == MAX_ADDED);

/// A term that the baseline model lacked.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct allan_added {
    /// Index of the term in the final model.
    pub term: usize,
    /// Decrease of the deviance in units of its scatter: a squared significance.
    pub score: f64,
    /// Averaging factor of the largest residual before the term was added.
    pub n: u64,
    /// That residual in standard deviations.
    pub sigmas: f64,
}

/// The result of `allan_trace`.
#[repr(C)]
pub struct allan_trace_result {
    /// N, B and K.
    pub before: allan_model,
    /// The model with the added terms.
    pub after: allan_model,
    /// Number of added terms.
    pub count: usize,
    /// The added terms, of which the first `count` are set.
    pub added: [allan_added; 5],
}

/// Fits N, B and K to `curve` and adds the terms that are missing, the most significant first.
///
/// `filters` are `count` terms of the kind ALLAN_FILTERED that the sensor may have, at most ALLAN_MAX_FILTERS. `keep_on` is
/// called with `context` between the fits and may do other work; if it returns false, the search ends with
/// ALLAN_CANCELLED. It may be null. It must return: neither longjmp nor an exception may leave it.
///
/// # Safety
/// `curve` and `filters` are null or point to a curve and to `count` terms, which no other code writes during the call; `result` is
/// null or points to memory of its type that the caller may write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_trace(
    curve: *const allan_curve,
    filters: *const allan_term,
    count: usize,
    keep_on: Option<unsafe extern "C" fn(context: *mut c_void) -> bool>,
    context: *mut c_void,
    result: *mut allan_trace_result,
) -> allan_status {
    status(|| {
        // SAFETY: as the caller promises.
        let (curve, given) = unsafe { (self::curve(curve)?, elements(filters, count)?) };
        check(result)?;
        let mut filters = [MovingAverageFilter::bartlett(1); ALLAN_MAX_FILTERS];
        let filters = filters.get_mut(..given.len()).ok_or(ALLAN_ERROR_RANGE)?;
        for (filter, term) in filters.iter_mut().zip(given) {
            *filter = term.filter()?;
        }
        let mut trace = Trace::empty();
        trace.fit_baseline(curve);
        // SAFETY: a function of the caller with its own context.
        let mut keep_on = || keep_on.is_none_or(|keep_on| unsafe { keep_on(context) });
        let completed = trace_while(&mut trace, curve, LineCandidates::Curve, filters, &mut keep_on);
        let mut added = [allan_added { term: 0, score: 0.0, n: 0, sigmas: 0.0 }; ALLAN_MAX_ADDED];
        for (copy, found) in added.iter_mut().zip(&trace.added) {
            let (term, score) = (found.term, found.score);
            *copy = allan_added { term, score, n: found.residual.n, sigmas: found.residual.sigmas };
        }
        let before = allan_model::new(&trace.before, trace.before_goodness.p_value);
        let after = allan_model::new(&trace.after, trace.after_goodness.p_value);
        // SAFETY: as the caller promises.
        unsafe { store(result, allan_trace_result { before, after, count: trace.added.len(), added })? };
        if completed { Ok(()) } else { Err(ALLAN_CANCELLED) }
    })
}
