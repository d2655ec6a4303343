//! Random telegraph noise: it has the Allan variance of a Gauss–Markov process, but another kurtosis.

use crate::curve::CurveView;
use crate::math::{ln, sqrt};
use crate::model::Model;
use crate::term::{Markov, NoiseTerm};

/// Excess kurtosis of the second differences of a symmetric telegraph signal at averaging times of 1/20, 1/10 … 3.2
/// correlation times. A Gaussian process has 0 at all of them.
///
/// From a simulation of 10⁸ samples with 20 samples per correlation time.
const KURTOSIS: [f64; 7] = [42.0, 21.0, 8.8, 3.5, 1.1, 0.0, -0.3];
/// Averaging time of the first entry, in correlation times.
const FIRST: f64 = 1.0 / 20.0;

/// Measured kurtosis relative to that of a telegraph signal.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct KurtosisRatio {
    /// Measured kurtosis over that of a symmetric telegraph signal: 0 for a Gaussian process, 1 for two levels with equal
    /// dwell times, more for unequal ones.
    pub ratio: f64,
    /// Standard deviation of the ratio.
    pub error: f64,
}

impl KurtosisRatio {
    /// Whether the ratio is nearer to a telegraph signal than to a Gaussian process, and 3 standard deviations above 0.
    #[must_use]
    pub fn is_telegraph(&self) -> bool {
        self.ratio > 0.5 && self.ratio > 3.0 * self.error
    }
}

/// Estimates the kurtosis ratio of the Markov term of `model`, which was fitted to `curve`.
///
/// `None` if the model does not have this term or the curve has no kurtosis.
#[must_use]
pub fn kurtosis_ratio<'a>(curve: impl Into<CurveView<'a>>, model: &Model, markov: Markov) -> Option<KurtosisRatio> {
    let curve = curve.into();
    let term = model.terms().iter().find(|term| term.kind == NoiseTerm::Markov(markov))?;
    let (mut along, mut weight) = (0.0, 0.0);
    for point in curve.points() {
        let Some(measured) = point.kurtosis else { continue };
        let share = model.part(term, point.n) / model.avar(point.n);
        let expected = share * share * expected(point.tau / markov.time_constant);
        // The variance of the sample kurtosis of so many independent Gaussian values is 24/edf.
        let precision = model.edf(point) / 24.0;
        along += precision * expected * measured;
        weight += precision * expected * expected;
    }
    (weight > 0.0).then(|| KurtosisRatio { ratio: along / weight, error: 1.0 / sqrt(weight) })
}

/// Excess kurtosis of a symmetric telegraph signal at an averaging time in correlation times: linear between the
/// octaves of the table, inversely proportional to the time below it.
fn expected(time: f64) -> f64 {
    let octave = ln(time / FIRST) / core::f64::consts::LN_2;
    if octave < 0.0 {
        return KURTOSIS[0] * FIRST / time;
    }
    let below = octave as usize;
    match (KURTOSIS.get(below), KURTOSIS.get(below + 1)) {
        (Some(a), Some(b)) => a + (b - a) * (octave - below as f64),
        _ => 0.0,
    }
}
