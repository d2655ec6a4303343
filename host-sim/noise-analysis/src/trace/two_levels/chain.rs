//! A hidden chain of two states, each with a level, in white noise.

use super::NUDGE;
use std::f64::consts::PI;

/// Rounds of the fit; those after a change of less than `SETTLED` in ln likelihood are left out.
const ROUNDS: usize = 60;
const SETTLED: f64 = 1e-3;
/// Probability of a jump with which the fit begins.
const FIRST_JUMP: f64 = 0.05;

/// A chain that was fitted to numbers one step apart.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    levels: [f64; 2],
    /// Around the level.
    variance: f64,
    /// Probability of leaving each level in a step.
    leave: [f64; 2],
    pub(super) log_likelihood: f64,
    /// Expected number of jumps.
    pub(super) jumps: f64,
    /// Standard deviations of the logarithms of correlation time and distance of the levels.
    pub(super) error_of_time: f64,
    pub(super) error_of_apart: f64,
}

/// What the numbers say of the states: sums over all of them, for each state.
#[derive(Default)]
struct Told {
    log_likelihood: f64,
    /// Number, sum and sum of squares of the numbers in a state.
    moments: [[f64; 3]; 2],
    /// Steps that begin in a state, and those that leave it.
    steps: [f64; 2],
    left: [f64; 2],
}

impl Chain {
    /// The likeliest chain, from a start at the means of the lower and of the upper half; `None` of too few numbers. One
    /// that is `NaN` is missing.
    pub(super) fn fit(values: &[f64]) -> Option<Self> {
        let mut present: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        let half = present.len() / 2;
        if half < 8 {
            return None;
        }
        present.select_nth_unstable_by(half, f64::total_cmp);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let levels = [mean(&present[..half]), mean(&present[half..])];
        let around = |(value, level): (&f64, f64)| (value - level).powi(2);
        let lower = present[..half].iter().map(|value| around((value, levels[0])));
        let upper = present[half..].iter().map(|value| around((value, levels[1])));
        let variance = lower.chain(upper).sum::<f64>() / present.len() as f64;
        let mut chain = Self {
            levels,
            variance,
            leave: [FIRST_JUMP; 2],
            log_likelihood: f64::NEG_INFINITY,
            jumps: 0.0,
            error_of_time: 0.0,
            error_of_apart: 0.0,
        };
        for _ in 0..ROUNDS {
            if chain.variance <= 0.0 {
                return None;
            }
            let told = chain.told(values);
            let gained = told.log_likelihood - chain.log_likelihood;
            chain.improve(&told);
            if gained < SETTLED {
                break;
            }
        }
        Some(chain)
    }

    /// The likeliest parameters if the states are as probable as `told`.
    fn improve(&mut self, told: &Told) {
        let [lower, upper] = told.moments;
        let squares = |[count, sum, squares]: [f64; 3]| squares - sum * sum / count.max(f64::MIN_POSITIVE);
        self.levels = [lower, upper].map(|[count, sum, _]| sum / count.max(f64::MIN_POSITIVE));
        self.variance = (squares(lower) + squares(upper)) / (lower[0] + upper[0]);
        for state in 0..2 {
            self.leave[state] = (told.left[state] / told.steps[state].max(f64::MIN_POSITIVE)).clamp(1e-9, 0.5);
        }
        self.jumps = told.left[0] + told.left[1];
        self.log_likelihood = told.log_likelihood;
    }

    /// Steps to the correlation time: the covariance of such a chain decays by 1 − p₀₁ − p₁₀ a step.
    pub(super) fn correlation_time(&self) -> f64 {
        -1.0 / (-(self.leave[0] + self.leave[1])).ln_1p()
    }

    /// Distance of the levels.
    pub(super) fn apart(&self) -> f64 {
        (self.levels[1] - self.levels[0]).abs()
    }

    /// Part of the time at each level.
    pub(super) fn held(&self) -> [f64; 2] {
        let both = self.leave[0] + self.leave[1];
        [self.leave[1] / both, self.leave[0] / both]
    }

    /// Distance of each number from the level that is nearer.
    pub(super) fn residuals(&self, values: &[f64]) -> Vec<f64> {
        let nearer = |value: &f64| {
            let [a, b] = self.levels.map(|level| value - level);
            if a.abs() < b.abs() { a } else { b }
        };
        values.iter().map(nearer).collect()
    }

    /// With standard deviations by the curvature of the likelihood.
    pub(super) fn with_errors(self, values: &[f64]) -> Self {
        let nudged = |time: f64, apart: f64| {
            let middle = 0.5 * (self.levels[0] + self.levels[1]);
            let chain = Self {
                levels: self.levels.map(|level| middle + apart.exp() * (level - middle)),
                leave: self.leave.map(|leave| leave * (-time).exp()),
                ..self.clone()
            };
            chain.told(values).log_likelihood
        };
        let here = nudged(0.0, 0.0);
        let error = |up: f64, down: f64| {
            let curvature = (2.0 * here - up - down) / (NUDGE * NUDGE);
            if curvature > 0.0 { curvature.sqrt().recip() } else { 1.0 }
        };
        let error_of_time = error(nudged(NUDGE, 0.0), nudged(-NUDGE, 0.0));
        let error_of_apart = error(nudged(0.0, NUDGE), nudged(0.0, -NUDGE));
        Self { error_of_time, error_of_apart, ..self }
    }

    /// Forward over the numbers and back again.
    fn told(&self, values: &[f64]) -> Told {
        let [up, down] = self.leave;
        let scale = 0.5 * (2.0 * PI * self.variance).ln();
        // Over that of the nearer level, and the logarithm of the latter: far from both, exponentials vanish.
        let density = |value: f64| {
            if value.is_nan() {
                return ([1.0; 2], 0.0);
            }
            let squares = self.levels.map(|level| 0.5 * (value - level).powi(2) / self.variance);
            let least = squares[0].min(squares[1]);
            (squares.map(|square| (least - square).exp()), -least - scale)
        };
        let mut told = Told::default();
        let mut forward: Vec<[f64; 2]> = Vec::with_capacity(values.len());
        let mut belief = [down / (up + down), up / (up + down)];
        for &value in values {
            let ([a, b], nearer) = density(value);
            let (a, b) = (belief[0] * a, belief[1] * b);
            let sum = a + b;
            told.log_likelihood += sum.ln() + nearer;
            let now = [a / sum, b / sum];
            forward.push(now);
            belief = [now[0] * (1.0 - up) + now[1] * down, now[0] * up + now[1] * (1.0 - down)];
        }
        // Probability of the later numbers in each state, up to a factor.
        let mut later = [1.0; 2];
        for (at, &value) in values.iter().enumerate().rev() {
            let now = forward[at];
            let weights = [now[0] * later[0], now[1] * later[1]];
            let sum = weights[0] + weights[1];
            for (moments, weight) in told.moments.iter_mut().zip(weights).filter(|_| value.is_finite()) {
                for (moment, power) in moments.iter_mut().zip([1.0, value, value * value]) {
                    *moment += weight / sum * power;
                }
            }
            let Some(before) = at.checked_sub(1) else { break };
            let ([a, b], _) = density(value);
            let (a, b) = (a * later[0], b * later[1]);
            let from = forward[before];
            let joint = [from[0] * (1.0 - up) * a, from[0] * up * b, from[1] * (1.0 - down) * b, from[1] * down * a];
            let sum: f64 = joint.iter().sum();
            told.steps[0] += (joint[0] + joint[1]) / sum;
            told.left[0] += joint[1] / sum;
            told.steps[1] += (joint[2] + joint[3]) / sum;
            told.left[1] += joint[3] / sum;
            let back = [(1.0 - up) * a + up * b, down * a + (1.0 - down) * b];
            let scale = back[0] + back[1];
            later = back.map(|value| value / scale);
        }
        told
    }
}
