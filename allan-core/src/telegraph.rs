//! Random telegraph noise: it has the Allan variance of a Gauss–Markov process, but another kurtosis.

use crate::curve::CurveView;
use crate::math::{ln, sqrt};
use crate::model::Model;
use crate::term::{Markov, NoiseTerm};

/// Excess kurtosis of the second differences of a symmetric telegraph signal at 1/20, 1/10 … 3.2 correlation times.
const KURTOSIS: [f64; 7] = [38.01, 18.25, 7.61, 2.86, 0.66, -0.28, -0.52];
/// Averaging time of the first entry, in correlation times.
const FIRST: f64 = 1.0 / 20.0;

/// Measured kurtosis relative to that of a telegraph signal.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct KurtosisRatio {
    /// Measured over telegraph kurtosis: 0 for a Gaussian process, 1 for two levels with equal dwell times, more for
    /// unequal ones.
    pub ratio: f64,
    /// Standard deviation of the ratio.
    pub error: f64,
}

impl KurtosisRatio {
    /// True if the ratio is nearer to a telegraph signal than to a Gaussian process, and 3 standard deviations above 0.
    #[must_use]
    pub fn is_telegraph(&self) -> bool {
        self.ratio > 0.5 && self.ratio > 3.0 * self.error
    }
}

/// Estimates the kurtosis ratio of the Markov term of `model`, which was fitted to `curve`. Behind a
/// [filter](Model::filter) of L values the averaging factor counts as `√(n² + L²)`.
///
/// `None` if the model does not have this term or the curve has no kurtosis.
#[must_use]
pub fn kurtosis_ratio<'a>(curve: impl Into<CurveView<'a>>, model: &Model, markov: Markov) -> Option<KurtosisRatio> {
    let curve = curve.into();
    let term = model.terms().iter().find(|term| term.kind == NoiseTerm::Markov(markov))?;
    let smoothed = model.filter().map_or(0.0, |filter| filter.smoothing(model.sample_period()));
    let (mut along, mut weight) = (0.0, 0.0);
    for point in curve.points() {
        let Some(measured) = point.kurtosis else { continue };
        let share = model.part(term, point.n) / model.avar(point.n);
        let tau = sqrt(point.tau * point.tau + smoothed * smoothed);
        let expected = share * share * expected(tau / markov.time_constant);
        // The sample kurtosis of `edf` independent Gaussian values has the variance 24/edf.
        let precision = model.edf(point) / 24.0;
        along += precision * expected * measured;
        weight += precision * expected * expected;
    }
    (weight > 0.0).then(|| KurtosisRatio { ratio: along / weight, error: 1.0 / sqrt(weight) })
}

/// Excess kurtosis of a telegraph signal at a time in correlation times, linear in its product with the time.
fn expected(time: f64) -> f64 {
    let octave = ln(time / FIRST) / core::f64::consts::LN_2;
    if octave < 0.0 {
        return 2.0 / time - 2.0;
    }
    let below = octave as usize;
    match (KURTOSIS.get(below), KURTOSIS.get(below + 1)) {
        (Some(a), Some(b)) => {
            let part = octave - below as f64;
            let product = a + (2.0 * b - a) * part;
            product * FIRST * (1_u32 << below) as f64 / time
        }
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::expected;

    /// E Sᵏ with the state, k = 0 … 4, of the second difference S of a symmetric chain of two states ±1.
    fn kurtosis(n: usize, correlation_time: f64) -> f64 {
        let jump = 0.5 * (1.0 - (-1.0 / correlation_time).exp());
        let mut moments = [[0.5, 0.0, 0.0, 0.0, 0.0]; 2];
        for at in 0..2 * n {
            let weight = if at < n { -1.0 } else { 1.0 };
            if at > 0 {
                let [up, down] = moments;
                let stay =
                    |own: [f64; 5], other: [f64; 5]| core::array::from_fn(|k| (1.0 - jump) * own[k] + jump * other[k]);
                moments = [stay(up, down), stay(down, up)];
            }
            for (moments, step) in moments.iter_mut().zip([weight, -weight]) {
                let [m0, m1, m2, m3, m4] = *moments;
                *moments = [
                    m0,
                    m1 + step * m0,
                    m2 + 2.0 * step * m1 + m0,
                    m3 + 3.0 * step * m2 + 3.0 * m1 + step * m0,
                    m4 + 4.0 * step * m3 + 6.0 * m2 + 4.0 * step * m1 + m0,
                ];
            }
        }
        let [square, fourth] = [2, 4].map(|k| moments[0][k] + moments[1][k]);
        fourth / (square * square) - 3.0
    }

    #[test]
    fn the_kurtosis_is_that_of_a_chain_of_two_states() {
        for n in [1, 2, 3, 5, 8, 11, 16, 32, 45, 60] {
            let exact = kurtosis(n, 20.0);
            let found = expected(n as f64 / 20.0);
            assert!((found - exact).abs() < 0.04 + 0.02 * exact.abs(), "{n}: {found} {exact}");
        }
        let exact = kurtosis(1, 50.0);
        assert!((expected(0.02) - exact).abs() < 0.02, "{exact}");
    }
}
