//! Noise models: kinds by their numbers, and the fit.

use crate::curve::{allan_curve, curve};
use crate::status::allan_status::{self, *};
use crate::status::{contained, status};
use crate::storage::{elements, object_ref, store};
use allan_core::fit::{fit, fit_power_laws, fit_shapes, goodness};
use allan_core::model::{FittedTerm, MAX_TERMS};
use allan_core::term::{LowPass, Markov, MovingAverageFilter, Resonance, Sinusoid};
use allan_core::{Model, NoiseTerm};

/// Largest number of terms of a model.
pub const ALLAN_MAX_TERMS: usize = 8;
const _: () = assert!(ALLAN_MAX_TERMS == MAX_TERMS);

/// Kinds of terms, with the unit of their coefficient in terms of the unit of the samples.
#[repr(C)]
pub enum allan_kind {
    /** Q: 3*Q^2/tau^2; unit*s. */
    ALLAN_QUANTIZATION = 0,
    /** N: N^2/tau; unit*sqrt(s). */
    ALLAN_ANGLE_RANDOM_WALK = 1,
    /** B: 2*ln(2)/pi*B^2; unit. */
    ALLAN_BIAS_INSTABILITY = 2,
    /** K: K^2*tau/3; unit/sqrt(s). */
    ALLAN_RATE_RANDOM_WALK = 3,
    /** R: R^2*tau^2/2; unit/s. */
    ALLAN_RATE_RAMP = 4,
    /** N after moving averages; shape: number of values that each averages, values per sample that is read. */
    ALLAN_FILTERED = 5,
    /** Standard deviation of exponentially correlated noise; shape: correlation time in s. */
    ALLAN_MARKOV = 6,
    /** Standard deviation of a damped oscillation; shape: frequency and bandwidth in Hz. */
    ALLAN_RESONANCE = 7,
    /** Amplitude of a sinusoid; shape: frequency in Hz. */
    ALLAN_SINUSOID = 8,
    /** N after a low-pass filter of the second order; shape: natural frequency in Hz, damping below 1. */
    ALLAN_LOW_PASS = 9,
}

/// A term: `kind`, `stages` and `shape` are set before a fit, the rest is its result.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct allan_term {
    /// An `allan_kind`.
    pub kind: i32,
    /// Of ALLAN_FILTERED: number of cascaded moving averages, 1 or 2.
    pub stages: u32,
    /// Coefficient; 0 if the data does not show the term.
    pub value: f64,
    /// Lower 95 % bound.
    pub low: f64,
    /// Upper 95 % bound.
    pub high: f64,
    /// Shape parameters; see `allan_kind`.
    pub shape: [f64; 2],
    /// Their lower 95 % bounds.
    pub shape_low: [f64; 2],
    /// Their upper 95 % bounds.
    pub shape_high: [f64; 2],
}

/// A fitted model.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct allan_model {
    /// Seconds between samples.
    pub sample_period: f64,
    /// Probability of a deviance at least as large if the model is true.
    pub p_value: f64,
    /// Number of terms.
    pub count: usize,
    /// The terms, of which the first `count` are set.
    pub terms: [allan_term; 8],
}

impl allan_term {
    const NONE: Self = Self {
        kind: 0,
        stages: 0,
        value: 0.0,
        low: 0.0,
        high: 0.0,
        shape: [0.0; 2],
        shape_low: [0.0; 2],
        shape_high: [0.0; 2],
    };

    fn new(term: &FittedTerm) -> Self {
        use allan_kind::*;
        let (kind, stages) = match term.kind {
            NoiseTerm::Quantization => (ALLAN_QUANTIZATION, 0),
            NoiseTerm::AngleRandomWalk => (ALLAN_ANGLE_RANDOM_WALK, 0),
            NoiseTerm::BiasInstability => (ALLAN_BIAS_INSTABILITY, 0),
            NoiseTerm::RateRandomWalk => (ALLAN_RATE_RANDOM_WALK, 0),
            NoiseTerm::RateRamp => (ALLAN_RATE_RAMP, 0),
            NoiseTerm::Filtered(filter) => (ALLAN_FILTERED, u32::from(filter.stages)),
            NoiseTerm::LowPass(_) => (ALLAN_LOW_PASS, 0),
            NoiseTerm::Markov(_) => (ALLAN_MARKOV, 0),
            NoiseTerm::Resonance(_) => (ALLAN_RESONANCE, 0),
            NoiseTerm::Sinusoid(_) => (ALLAN_SINUSOID, 0),
        };
        let (mut shape, mut shape_low, mut shape_high) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        for (index, (_, value, (low, high))) in term.shape_parameters().take(2).enumerate() {
            (shape[index], shape_low[index], shape_high[index]) = (value, low, high);
        }
        Self {
            kind: kind as i32,
            stages,
            value: term.value,
            low: term.low,
            high: term.high,
            shape,
            shape_low,
            shape_high,
        }
    }

    /// The kind with its shape.
    fn term(&self) -> Result<NoiseTerm, allan_status> {
        let positive = |value: f64| if value > 0.0 && value.is_finite() { Ok(value) } else { Err(ALLAN_ERROR_RANGE) };
        let [first, second] = self.shape;
        Ok(match self.kind {
            kind if kind == allan_kind::ALLAN_QUANTIZATION as i32 => NoiseTerm::Quantization,
            kind if kind == allan_kind::ALLAN_ANGLE_RANDOM_WALK as i32 => NoiseTerm::AngleRandomWalk,
            kind if kind == allan_kind::ALLAN_BIAS_INSTABILITY as i32 => NoiseTerm::BiasInstability,
            kind if kind == allan_kind::ALLAN_RATE_RANDOM_WALK as i32 => NoiseTerm::RateRandomWalk,
            kind if kind == allan_kind::ALLAN_RATE_RAMP as i32 => NoiseTerm::RateRamp,
            kind if kind == allan_kind::ALLAN_FILTERED as i32 => NoiseTerm::Filtered(self.filter()?),
            kind if kind == allan_kind::ALLAN_LOW_PASS as i32 => {
                let damping = positive(second).ok().filter(|damping| *damping < 1.0).ok_or(ALLAN_ERROR_RANGE)?;
                NoiseTerm::LowPass(LowPass { frequency: positive(first)?, damping })
            }
            kind if kind == allan_kind::ALLAN_MARKOV as i32 => {
                NoiseTerm::Markov(Markov { time_constant: positive(first)? })
            }
            kind if kind == allan_kind::ALLAN_RESONANCE as i32 => {
                NoiseTerm::Resonance(Resonance { frequency: positive(first)?, bandwidth: positive(second)? })
            }
            kind if kind == allan_kind::ALLAN_SINUSOID as i32 => {
                NoiseTerm::Sinusoid(Sinusoid { frequency: positive(first)? })
            }
            _ => return Err(ALLAN_ERROR_KIND),
        })
    }

    /// The filter of an ALLAN_FILTERED.
    pub(crate) fn filter(&self) -> Result<MovingAverageFilter, allan_status> {
        let [taps, decimation] = self.shape;
        if self.kind != allan_kind::ALLAN_FILTERED as i32 {
            return Err(ALLAN_ERROR_KIND);
        }
        let is_whole = (1.0..=128.0).contains(&taps) && f64::from(taps as u16) == taps;
        if !(is_whole && matches!(self.stages, 1 | 2) && decimation >= 1.0 && decimation.is_finite()) {
            return Err(ALLAN_ERROR_RANGE);
        }
        Ok(MovingAverageFilter { stages: self.stages as u8, taps: taps as u16, decimation })
    }
}

impl allan_model {
    pub(crate) fn new(model: &Model, p_value: f64) -> Self {
        let mut terms = [allan_term::NONE; ALLAN_MAX_TERMS];
        terms.iter_mut().zip(model.terms()).for_each(|(copy, term)| *copy = allan_term::new(term));
        Self { sample_period: model.sample_period(), p_value, count: model.terms().len(), terms }
    }

    fn model(&self) -> Result<Model, allan_status> {
        let terms = self.terms.get(..self.count).ok_or(ALLAN_ERROR_KIND)?;
        let mut kinds = [FittedTerm::exact(NoiseTerm::AngleRandomWalk, 0.0); ALLAN_MAX_TERMS];
        for (fitted, term) in kinds.iter_mut().zip(terms) {
            *fitted = FittedTerm::exact(term.term()?, term.value);
        }
        Ok(Model::new(self.sample_period, kinds.into_iter().take(self.count)))
    }
}

/// The kinds of 1 to [`ALLAN_MAX_TERMS`] different terms, in the first places.
fn kinds_of(terms: &[allan_term]) -> Result<[NoiseTerm; ALLAN_MAX_TERMS], allan_status> {
    if terms.is_empty() || terms.len() > ALLAN_MAX_TERMS {
        return Err(ALLAN_ERROR_KIND);
    }
    let mut kinds = [NoiseTerm::AngleRandomWalk; ALLAN_MAX_TERMS];
    for (at, term) in terms.iter().enumerate() {
        let term = term.term()?;
        if kinds[..at].contains(&term) {
            return Err(ALLAN_ERROR_KIND);
        }
        kinds[at] = term;
    }
    Ok(kinds)
}

/// Fits the coefficients of `count` terms to `curve`, and their shapes too if `shapes` is true. Of each term, `kind` and
/// where it has one the shape are read.
///
/// # Safety
/// `curve` and `terms` are null or point to a curve and to `count` terms, which no other code writes during the call; `model` is
/// null or points to memory of its type that the caller may write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_fit(
    curve: *const allan_curve,
    terms: *const allan_term,
    count: usize,
    shapes: bool,
    model: *mut allan_model,
) -> allan_status {
    status(|| {
        // SAFETY: as the caller promises.
        let (curve, terms) = unsafe { (self::curve(curve)?, elements(terms, count)?) };
        let kinds = kinds_of(terms)?;
        let kinds = &kinds[..terms.len()];
        let fitted = if shapes { fit_shapes(curve, kinds) } else { fit(curve, kinds) };
        // SAFETY: as the caller promises.
        unsafe { store(model, allan_model::new(&fitted, goodness(curve, &fitted).p_value)) }
    })
}

/// Fits the coefficients of `count` power laws, ALLAN_QUANTIZATION to ALLAN_RATE_RAMP, in single precision, with bounds
/// that need none of the curve's. The `p_value` of the model is NaN. A program that calls no other fit links half of the
/// code.
///
/// # Safety
/// As `allan_fit`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_fit_power_laws(
    curve: *const allan_curve,
    terms: *const allan_term,
    count: usize,
    model: *mut allan_model,
) -> allan_status {
    status(|| {
        // SAFETY: as the caller promises.
        let (curve, terms) = unsafe { (self::curve(curve)?, elements(terms, count)?) };
        if terms.iter().any(|term| term.kind > allan_kind::ALLAN_RATE_RAMP as i32) {
            return Err(ALLAN_ERROR_KIND);
        }
        let fitted = fit_power_laws(curve, &kinds_of(terms)?[..terms.len()]);
        // SAFETY: as the caller promises.
        unsafe { store(model, allan_model::new(&fitted, f64::NAN)) }
    })
}

/// Modelled Allan variance at averaging factor `n`; NaN if `model` is not a model or `n` is 0.
///
/// # Safety
/// `model` is null or points to a model, which no other code writes during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_model_avar(model: *const allan_model, n: u64) -> f64 {
    let avar = || {
        // SAFETY: as the caller promises.
        let model = unsafe { object_ref(model)? }.model()?;
        if n == 0 { Err(ALLAN_ERROR_RANGE) } else { Ok(model.avar(n)) }
    };
    contained(|| avar().unwrap_or(f64::NAN), f64::NAN)
}
