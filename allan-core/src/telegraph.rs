//! Random telegraph noise has the Allan variance of a Markov process; the fourth moments tell the two apart.

use crate::math::{ln, sqrt};
use crate::term::Markov;
use crate::{Curve, Kind, Model};

/// Excess kurtosis of the second differences of a symmetric telegraph signal at averaging times of 1/20, 1/10 … 3.2
/// correlation times, every octave.
///
/// Simulated at 20 samples to a correlation time, 10⁸ samples; a Gaussian process has 0 throughout.
const KURTOSIS: [f64; 7] = [42.0, 21.0, 8.8, 3.5, 1.1, 0.0, -0.3];
const FIRST: f64 = 1.0 / 20.0;

/// How clearly a Markov term of a fitted model is a telegraph signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// The kurtosis that was measured over the one that a symmetric telegraph signal would have: 0 for a Gaussian process,
    /// 1 and more for two levels.
    pub ratio: f64,
    /// Standard deviation of the ratio.
    pub error: f64,
}

impl Verdict {
    /// Whether two levels are more likely than a Gaussian process.
    #[must_use]
    pub fn is_telegraph(&self) -> bool {
        self.ratio > 0.5 && self.ratio > 3.0 * self.error
    }
}

/// Judges the Markov term of `model`, which was fitted to `curve`; `None` if the fourth moments cannot tell.
#[must_use]
pub fn judge<const POINTS: usize>(curve: &Curve<POINTS>, model: &Model, markov: Markov) -> Option<Verdict> {
    let term = model.terms().iter().find(|term| term.kind == Kind::Markov(markov))?;
    let (mut along, mut weight) = (0.0, 0.0);
    for point in curve.points() {
        let Some(measured) = point.kurtosis else { continue };
        let share = term.value * term.value * term.kind.avar(point.n, curve.sample_period()) / model.avar(point.n);
        let expected = share * share * expected(point.tau / markov.time_constant);
        // Of a Gaussian sample of as many independent differences: 24/n.
        let precision = model.edf(point) / 24.0;
        along += precision * expected * measured;
        weight += precision * expected * expected;
    }
    (weight > 0.0).then(|| Verdict { ratio: along / weight, error: 1.0 / sqrt(weight) })
}

/// By octave, linear in between; at shorter times it grows with the inverse.
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
