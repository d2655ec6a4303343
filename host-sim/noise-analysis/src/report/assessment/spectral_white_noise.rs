//! N by the spectrum beside N by the fit: whether the record identifies it, and whether the two agree.

use crate::bounds::{BoundedEstimate, Parameter};
use crate::distributions::ROUNDING;
use crate::fit::noise_terms::is_white;
use crate::spectra::{KnownShapes, Welch, WhiteNoiseFit, fit_white_noise};
use crate::units::coefficient_unit;
use allan_core::{Model, NoiseTerm};

/// Segment length of Welch's estimate, samples: long enough to resolve the nulls of the sensor's filter, short enough for
/// many segments.
pub(super) const WELCH_SAMPLES: usize = 1 << 13;
/// Least variance of the noise of a sample, in counts², at which rounding acts as white noise: then the error's correlation
/// with the noise, `exp(−2π²σ²)`, is 2 %.
const DITHERED_COUNTS2: f64 = 0.2;

/// N by the spectrum, and what the reader has to know of it.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct SpectralWhiteNoise {
    /// In unit·√s; `None` where the record does not identify it.
    pub angle_random_walk: Option<Parameter>,
    /// Why there is no figure, or why it differs from that of the fit.
    pub note: Option<String>,
}

/// N by the spectrum of a record, `welch`, whose values are multiples of `count` and in `unit`; `None` of a record that is too short.
///
/// `fitted` is the model of the whole record, whose N is reported and whose lines and Markov processes the spectrum has as
/// well.
pub(super) fn estimate(welch: Option<&Welch>, fitted: &Model, count: f64, unit: &str) -> SpectralWhiteNoise {
    let without = |reason: String| SpectralWhiteNoise { angle_random_walk: None, note: Some(reason) };
    let Some(welch) = welch else {
        return without(format!("the record has no {WELCH_SAMPLES} samples in a row for a spectrum"));
    };
    let reach_of_slow_reading = fitted.terms().iter().find_map(|term| match term.kind {
        NoiseTerm::Filtered(filter) if filter.decimation != 1.0 => {
            Some((f64::from(filter.stages) * (f64::from(filter.taps) - 1.0) / filter.decimation) as u32)
        }
        _ => None,
    });
    let Some(fit) = fit_white_noise(welch, &KnownShapes { model: fitted, reach_of_slow_reading }) else {
        return without("drift, lines or rounding hide the white noise in the spectrum".to_owned());
    };
    let in_counts = fit.sample_deviation / count;
    if in_counts * in_counts < DITHERED_COUNTS2 + ROUNDING {
        return without(format!(
            "the white noise of a sample is {in_counts:.2} of a count with its rounding: the record shows the rounding, not the noise"
        ));
    }
    let BoundedEstimate { value, low, high } = fit.angle_random_walk;
    let unit = coefficient_unit(&NoiseTerm::AngleRandomWalk, unit);
    SpectralWhiteNoise { note: note(&fit, fitted), angle_random_walk: Some(Parameter::new(value, low, high, unit)) }
}

/// Why `fit` differs from N of the fitted model, if it does by more than the two intervals together allow; else by how much
/// the spectrum contradicts its own fit, if it does.
fn note(fit: &WhiteNoiseFit, fitted: &Model) -> Option<String> {
    let misfit = (fit.widened > 1.0).then(|| {
        format!(
            "the spectrum is no sum of the modelled noise: it scatters {:.1} times as much around it as it should, and the \
             interval is widened by that",
            fit.widened
        )
    });
    let by_fit = white_noise_of(fitted);
    let n = fit.angle_random_walk;
    let (apart, reach) = if n.value > by_fit.value {
        (n.value - by_fit.value, (n.value - n.low).hypot(by_fit.high - by_fit.value))
    } else {
        (by_fit.value - n.value, (n.high - n.value).hypot(by_fit.value - by_fit.low))
    };
    if apart <= reach {
        return misfit;
    }
    if by_fit.value == 0.0 {
        return Some("the fitted model has no white noise: the curve does not tell it from its other terms".to_owned());
    }
    let percent = 100.0 * (n.value / by_fit.value - 1.0);
    let reason = misfit.unwrap_or_else(|| "the fitted model lacks something".to_owned());
    Some(format!("{percent:+.1} % from the fit, more than the two intervals allow: {reason}"))
}

/// The white noise of a model at low frequencies, behind a filter or not.
fn white_noise_of(model: &Model) -> BoundedEstimate {
    let white = || model.terms().iter().filter(|term| is_white(&term.kind));
    BoundedEstimate {
        value: white().map(|term| term.value * term.value).sum::<f64>().sqrt(),
        low: white().map(|term| term.low * term.low).sum::<f64>().sqrt(),
        high: white().map(|term| term.high * term.high).sum::<f64>().sqrt(),
    }
}
