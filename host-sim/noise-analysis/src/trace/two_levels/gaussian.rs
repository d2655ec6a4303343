//! The rival: a Gaussian process that forgets exponentially, in white noise, by a Kalman filter.

use std::f64::consts::PI;

/// Correlation times, in steps, that are tried first: up to so many times the record, where it is a random walk.
const SHORTEST: f64 = 0.5;
const LONGEST: f64 = 30.0;
/// Variances of the process, over the white noise's, that are tried first.
const WEAKEST: f64 = 1e-3;
const STRONGEST: f64 = 1e7;
/// Points of each that are tried first, and how often the step is halved after that.
const TRIED: usize = 9;
const HALVED: usize = 9;

/// The highest ln likelihood over all variances and correlation times. A number that is `NaN` is missing.
pub(super) fn log_likelihood(values: &[f64]) -> f64 {
    let longest = LONGEST * values.len() as f64;
    let (mut step_of_time, mut step_of_ratio) =
        ((longest / SHORTEST).ln() / (TRIED - 1) as f64, (STRONGEST / WEAKEST).ln() / (TRIED - 1) as f64);
    let at = |time: f64, ratio: f64| (likelihood(values, time.exp(), ratio.exp()), time, ratio);
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

/// With `ratio` times the variance of the white noise, whose scale is the likeliest.
fn likelihood(values: &[f64], time: f64, ratio: f64) -> f64 {
    let decay = (-1.0 / time).exp();
    // 1 − decay², without cancellation.
    let drive = -(-2.0 / time).exp_m1() * ratio;
    let (mut state, mut variance) = (0.0, ratio);
    let (mut squares, mut logs, mut count) = (0.0, 0.0, 0.0);
    for &value in values {
        if value.is_finite() {
            let spread = variance + 1.0;
            let error: f64 = value - state;
            squares += error * error / spread;
            logs += spread.ln();
            count += 1.0;
            let gain = variance / spread;
            state += gain * error;
            variance *= 1.0 - gain;
        }
        state *= decay;
        variance = decay * decay * variance + drive;
    }
    -0.5 * (count * ((2.0 * PI * squares / count).ln() + 1.0) + logs)
}
