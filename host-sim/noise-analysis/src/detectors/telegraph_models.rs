//! Models for telegraph noise: a hidden Markov chain of two states, and a Gaussian process with exponential
//! autocorrelation, in white noise. Missing values are `NaN`.

use crate::bounds::BoundedEstimate;
use std::f64::consts::PI;

/// Most rounds of the fit; it ends when a round gains less than `SETTLED` in ln likelihood.
const ROUNDS: usize = 60;
const SETTLED: f64 = 1e-3;
/// Bound on the gain of all later rounds, in gains of the last one.
const LATER_GAINS: f64 = 10.0;
const FIRST_JUMP: f64 = 0.05;
/// Step in the logarithm of a parameter for the curvature of the likelihood.
const CURVATURE_STEP: f64 = 0.05;

#[derive(Debug, Clone)]
pub(super) struct TwoStateChain {
    levels: [f64; 2],
    variance: f64,
    leave: [f64; 2],
    pub(super) log_likelihood: f64,
    pub(super) jumps: f64,
    /// Standard deviations of the logarithms of correlation time and distance of the levels.
    pub(super) time_error: f64,
    pub(super) distance_error: f64,
}

#[derive(Default)]
struct StateStatistics {
    log_likelihood: f64,
    /// Expected count, sum and sum of squares of the values in each state.
    moments: [[f64; 3]; 2],
    /// Expected numbers of steps that begin in each state and that leave it.
    steps: [f64; 2],
    left: [f64; 2],
}

impl TwoStateChain {
    /// The likeliest chain by expectation maximisation (L. Baum et al., Ann. Math. Statist. 41, 1970), if it nears `least`.
    pub(super) fn fit(values: &[f64], least: f64) -> Option<Self> {
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
        Self::new(levels, variance, FIRST_JUMP).climbed(values, least)
    }

    /// The likeliest chain from a known standard deviation and correlation time, in steps.
    pub(super) fn fit_near(values: &[f64], deviation: f64, steps: f64) -> Option<Self> {
        let Moments { count, mean, squares } = Moments::of(values);
        let variance = squares / count;
        let deviation = deviation.min((0.5 * variance).sqrt());
        let leave = (0.5 / steps).min(FIRST_JUMP);
        let start = Self::new([mean - deviation, mean + deviation], variance - deviation * deviation, leave);
        start.climbed(values, f64::NEG_INFINITY)
    }

    /// Initial chain with two equally frequent levels.
    fn new(levels: [f64; 2], variance: f64, leave: f64) -> Self {
        Self {
            levels,
            variance,
            leave: [leave; 2],
            log_likelihood: f64::NEG_INFINITY,
            jumps: 0.0,
            time_error: 0.0,
            distance_error: 0.0,
        }
    }

    /// The chain after expectation maximisation; `None` if the ln likelihood does not come near `least`.
    fn climbed(mut self, values: &[f64], least: f64) -> Option<Self> {
        for _ in 0..ROUNDS {
            if self.variance <= 0.0 {
                return None;
            }
            let statistics = self.expectation(values);
            let gained = statistics.log_likelihood - self.log_likelihood;
            self.maximise(&statistics);
            if self.log_likelihood + LATER_GAINS * gained < least {
                return None;
            }
            if gained < SETTLED {
                break;
            }
        }
        (self.log_likelihood >= least).then_some(self)
    }

    fn maximise(&mut self, statistics: &StateStatistics) {
        let [lower, upper] = statistics.moments;
        let squares = |[count, sum, squares]: [f64; 3]| squares - sum * sum / count.max(f64::MIN_POSITIVE);
        self.levels = [lower, upper].map(|[count, sum, _]| sum / count.max(f64::MIN_POSITIVE));
        self.variance = (squares(lower) + squares(upper)) / (lower[0] + upper[0]);
        for state in 0..2 {
            self.leave[state] =
                (statistics.left[state] / statistics.steps[state].max(f64::MIN_POSITIVE)).clamp(1e-9, 0.5);
        }
        self.jumps = statistics.left[0] + statistics.left[1];
        self.log_likelihood = statistics.log_likelihood;
    }

    /// Correlation time in steps: the covariance decays by 1 − p₀₁ − p₁₀ a step.
    pub(super) fn correlation_time(&self) -> f64 {
        -1.0 / (-(self.leave[0] + self.leave[1])).ln_1p()
    }

    pub(super) fn distance(&self) -> f64 {
        (self.levels[1] - self.levels[0]).abs()
    }

    pub(super) fn occupancy(&self) -> [f64; 2] {
        let both = self.leave[0] + self.leave[1];
        [self.leave[1] / both, self.leave[0] / both]
    }

    pub(super) fn is_upper(&self, value: f64) -> bool {
        value > 0.5 * (self.levels[0] + self.levels[1])
    }

    pub(super) fn residuals(&self, values: &[f64]) -> Vec<f64> {
        let nearer = |value: &f64| {
            let [a, b] = self.levels.map(|level| value - level);
            if a.abs() < b.abs() { a } else { b }
        };
        values.iter().map(nearer).collect()
    }

    /// Adds standard deviations of the parameters, by the curvature of the likelihood.
    pub(super) fn with_errors(self, values: &[f64]) -> Self {
        let log_likelihood = |time: f64, distance: f64| {
            let middle = 0.5 * (self.levels[0] + self.levels[1]);
            let chain = Self {
                levels: self.levels.map(|level| middle + distance.exp() * (level - middle)),
                leave: self.leave.map(|leave| leave * (-time).exp()),
                ..self.clone()
            };
            chain.expectation(values).log_likelihood
        };
        let here = log_likelihood(0.0, 0.0);
        let error = |up: f64, down: f64| {
            let curvature = (2.0 * here - up - down) / (CURVATURE_STEP * CURVATURE_STEP);
            if curvature > 0.0 { curvature.sqrt().recip() } else { 1.0 }
        };
        let time_error = error(log_likelihood(CURVATURE_STEP, 0.0), log_likelihood(-CURVATURE_STEP, 0.0));
        let distance_error = error(log_likelihood(0.0, CURVATURE_STEP), log_likelihood(0.0, -CURVATURE_STEP));
        Self { time_error, distance_error, ..self }
    }

    /// By forward and backward recursion.
    fn expectation(&self, values: &[f64]) -> StateStatistics {
        let [up, down] = self.leave;
        let scale = 0.5 * (2.0 * PI * self.variance).ln();
        // Densities relative to the nearer level's: far from both levels the densities themselves underflow.
        let densities_of = |value: f64| {
            if value.is_nan() {
                return ([1.0; 2], 0.0);
            }
            let [lower, upper] = self.levels.map(|level| 0.5 * (value - level).powi(2) / self.variance);
            let farther = (-(upper - lower).abs()).exp();
            (if lower < upper { [1.0, farther] } else { [farther, 1.0] }, -lower.min(upper) - scale)
        };
        let mut statistics = StateStatistics::default();
        let mut densities: Vec<[f64; 2]> = Vec::with_capacity(values.len());
        let mut forward: Vec<[f64; 2]> = Vec::with_capacity(values.len());
        let mut belief = [down / (up + down), up / (up + down)];
        let mut sums = LogOfProduct::default();
        for &value in values {
            let (of_value, nearer) = densities_of(value);
            let (a, b) = (belief[0] * of_value[0], belief[1] * of_value[1]);
            let sum = a + b;
            statistics.log_likelihood += nearer;
            sums.multiply(sum);
            let norm = sum.recip();
            let now = [a * norm, b * norm];
            densities.push(of_value);
            forward.push(now);
            belief = [now[0] * (1.0 - up) + now[1] * down, now[0] * up + now[1] * (1.0 - down)];
        }
        statistics.log_likelihood += sums.value();
        // Likelihood of the later values given each state, up to a factor.
        let mut later = [1.0; 2];
        for (at, &value) in values.iter().enumerate().rev() {
            let now = forward[at];
            let weights = [now[0] * later[0], now[1] * later[1]];
            let norm = (weights[0] + weights[1]).recip();
            for (moments, weight) in statistics.moments.iter_mut().zip(weights).filter(|_| value.is_finite()) {
                let share = weight * norm;
                for (moment, power) in moments.iter_mut().zip([1.0, value, value * value]) {
                    *moment += share * power;
                }
            }
            let Some(before) = at.checked_sub(1) else { break };
            let (a, b) = (densities[at][0] * later[0], densities[at][1] * later[1]);
            let from = forward[before];
            let joint = [from[0] * (1.0 - up) * a, from[0] * up * b, from[1] * (1.0 - down) * b, from[1] * down * a];
            let norm = joint.iter().sum::<f64>().recip();
            statistics.steps[0] += (joint[0] + joint[1]) * norm;
            statistics.left[0] += joint[1] * norm;
            statistics.steps[1] += (joint[2] + joint[3]) * norm;
            statistics.left[1] += joint[3] * norm;
            let back = [(1.0 - up) * a + up * b, down * a + (1.0 - down) * b];
            let norm = (back[0] + back[1]).recip();
            later = back.map(|value| value * norm);
        }
        statistics
    }
}

/// ln of a product, with few calls of `ln`.
struct LogOfProduct {
    product: f64,
    log: f64,
}

impl Default for LogOfProduct {
    fn default() -> Self {
        Self { product: 1.0, log: 0.0 }
    }
}

impl LogOfProduct {
    fn multiply(&mut self, factor: f64) {
        self.product *= factor;
        if !(1e-100..1e100).contains(&self.product) {
            self.log += self.product.ln();
            self.product = 1.0;
        }
    }

    fn value(&self) -> f64 {
        self.log + self.product.ln()
    }
}

/// Grid of correlation times: shortest in steps, longest in records (a random walk).
const SHORTEST: f64 = 0.5;
const LONGEST: f64 = 30.0;
/// Least variance of the grid, relative to the white variance.
const WEAKEST: f64 = 1e-3;
const STRONGEST: f64 = 1e7;
/// Grid points per parameter, and halvings of the step after that.
const TRIED: usize = 9;
const HALVED: usize = 9;

struct Moments {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Moments {
    fn of(values: &[f64]) -> Self {
        let present = values.iter().filter(|value| value.is_finite());
        let (count, sum) = present.clone().fold((0.0, 0.0), |(count, sum), value| (count + 1.0, sum + value));
        let mean = sum / count;
        Self { count, mean, squares: present.map(|value| (value - mean).powi(2)).sum() }
    }
}

/// ln likelihood of white Gaussian noise of any mean and variance.
pub(super) fn white_log_likelihood(values: &[f64]) -> f64 {
    let Moments { count, squares, .. } = Moments::of(values);
    independent_log_likelihood(count, squares)
}

/// ln likelihood of `count` independent Gaussian variables with this sum of squared residuals.
pub(super) fn independent_log_likelihood(count: f64, squares: f64) -> f64 {
    -0.5 * count * ((2.0 * PI * squares / count).ln() + 1.0)
}

/// Highest ln likelihood of a Gaussian process with exponential autocorrelation in white noise.
pub(super) fn gauss_markov_log_likelihood(values: &[f64]) -> f64 {
    let longest = LONGEST * values.len() as f64;
    let (mut step_of_time, mut step_of_ratio) =
        ((longest / SHORTEST).ln() / (TRIED - 1) as f64, (STRONGEST / WEAKEST).ln() / (TRIED - 1) as f64);
    let at = |time: f64, ratio: f64| (Filtered::new(values, time.exp(), ratio.exp()).log_likelihood(), time, ratio);
    let tries = (0..TRIED * TRIED).map(|try_| {
        let (i, j) = ((try_ / TRIED) as f64, (try_ % TRIED) as f64);
        at(SHORTEST.ln() + step_of_time * i, WEAKEST.ln() + step_of_ratio * j)
    });
    let likelier = |a: &(f64, f64, f64), b: &(f64, f64, f64)| a.0.total_cmp(&b.0);
    let mut best = tries.max_by(likelier).unwrap_or((f64::NEG_INFINITY, 0.0, 0.0));
    for _ in 0..HALVED {
        step_of_time *= 0.5;
        step_of_ratio *= 0.5;
        let around = (0..9).map(|try_| (f64::from(try_ / 3 - 1), f64::from(try_ % 3 - 1)));
        let (_, time, ratio) = best;
        let tries = around.map(|(i, j)| at(time + i * step_of_time, ratio + j * step_of_ratio));
        best = tries.max_by(likelier).unwrap_or(best);
    }
    best.0
}

/// Steps of the grid of a posterior distribution per parameter, and the ln likelihood below the highest one that is left out of it.
const STEPS: usize = 32;
const NEGLIGIBLE: f64 = 8.0;

/// Correlation time in steps, at most as long as the `values`, and standard deviation of a Gaussian process with exponential
/// autocorrelation in white noise of any mean: medians and 95 % bounds if all logarithms of its parameters are as probable.
pub(super) fn gauss_markov_posterior(values: &[f64]) -> (BoundedEstimate, BoundedEstimate) {
    let mut bounds = [(SHORTEST.ln(), (values.len() as f64).ln()), (WEAKEST.ln(), STRONGEST.ln())];
    let mut grid = Vec::new();
    // Once over all, and once where the likelihood is high.
    for _ in 0..2 {
        let steps = bounds.map(|(low, high)| (high - low) / (STEPS - 1) as f64);
        let at = |parameter: usize, number: usize| bounds[parameter].0 + steps[parameter] * number as f64;
        let place = |number: usize| {
            let (time, ratio) = (at(0, number / STEPS), at(1, number % STEPS));
            let (log_probability, deviation) = Filtered::new(values, time.exp(), ratio.exp()).of_any_mean(ratio.exp());
            (log_probability, [time, ratio], deviation)
        };
        grid = (0..STEPS * STEPS).map(place).collect::<Vec<(f64, [f64; 2], f64)>>();
        let highest = grid.iter().map(|of| of.0).fold(f64::NEG_INFINITY, f64::max);
        grid.retain(|of| of.0 > highest - NEGLIGIBLE);
        grid.iter_mut().for_each(|of| of.0 = (of.0 - highest).exp());
        bounds = [0, 1].map(|parameter| {
            let of = || grid.iter().map(|(_, place, _)| place[parameter]);
            let reach = |end: f64| end.clamp(bounds[parameter].0, bounds[parameter].1);
            let (low, high) = (of().fold(f64::INFINITY, f64::min), of().fold(f64::NEG_INFINITY, f64::max));
            (reach(low - steps[parameter]), reach(high + steps[parameter]))
        });
    }
    (
        quantiles(grid.iter().map(|(weight, [time, _], _)| (time.exp(), *weight)).collect()),
        quantiles(grid.iter().map(|(weight, _, deviation)| (*deviation, *weight)).collect()),
    )
}

/// Median and 95 % bounds of values with their weights.
fn quantiles(mut values: Vec<(f64, f64)>) -> BoundedEstimate {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = values.iter().map(|(_, weight)| weight).sum();
    let [low, value, high] = [0.025, 0.5, 0.975].map(|part| {
        let mut below = 0.0;
        let is_reached = |(_, weight): &&(f64, f64)| {
            below += weight;
            below >= part * all
        };
        values.iter().find(is_reached).or(values.last()).map_or(0.0, |(value, _)| *value)
    });
    BoundedEstimate::new(value, low, high)
}

/// Errors of the predictions of a Kalman filter for a process in white noise, of the values and of a constant 1, each over its deviation,
/// in units of the white noise's deviation.
struct Filtered {
    count: f64,
    /// Sums of products: values with themselves, with ones, ones with themselves.
    products: [f64; 3],
    /// Sum of the logarithms of the variances of the errors.
    spreads: f64,
}

impl Filtered {
    /// For a correlation time in steps and a variance over that of the white noise.
    fn new(values: &[f64], time: f64, ratio: f64) -> Self {
        let decay = (-1.0 / time).exp();
        // 1 − decay², without cancellation.
        let drive = -(-2.0 / time).exp_m1() * ratio;
        let (mut state, mut state_of_one, mut variance) = (0.0, 0.0, ratio);
        let (mut products, mut spreads, mut count) = ([0.0; 3], LogOfProduct::default(), 0.0);
        for &value in values {
            if value.is_finite() {
                let spread = variance + 1.0;
                let (error, of_one) = (value - state, 1.0 - state_of_one);
                for (sum, product) in products.iter_mut().zip([error * error, error * of_one, of_one * of_one]) {
                    *sum += product / spread;
                }
                spreads.multiply(spread);
                count += 1.0;
                let gain = variance / spread;
                state += gain * error;
                state_of_one += gain * of_one;
                variance *= 1.0 - gain;
            }
            state *= decay;
            state_of_one *= decay;
            variance = decay * decay * variance + drive;
        }
        Self { count, products, spreads: spreads.value() }
    }

    /// The values have a mean of 0; the variance of the white noise is the likeliest one.
    fn log_likelihood(&self) -> f64 {
        independent_log_likelihood(self.count, self.products[0]) - 0.5 * self.spreads
    }

    /// ln probability, of values of any mean and variance, but for a constant; and the standard deviation of the process.
    fn of_any_mean(&self, ratio: f64) -> (f64, f64) {
        let [squares, cross, ones] = self.products;
        let (squares, freedom) = (squares - cross * cross / ones, self.count - 1.0);
        (-0.5 * (freedom * squares.ln() + self.spreads + ones.ln()), (ratio * squares / freedom).sqrt())
    }
}
