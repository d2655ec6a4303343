//! Telegraph signal or Markov process: a hidden chain of two states against a Kalman filter.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Steps in a correlation time; the level is taken to be constant in a step.
const STEPS: f64 = 20.0;
/// Steps of the simulated path; the ratio grows in proportion to the length.
const PATH: usize = 20_000;

/// Expected log likelihood ratio of a telegraph signal, of levels `amplitude` apart, against a Markov process of the
/// same covariance, in white noise of two-sided density `density`, over `seconds`.
pub(crate) fn telegraph_from_markov(
    amplitude: f64,
    time_constant_s: f64,
    density: f64,
    period_s: f64,
    seconds: f64,
    seed: u64,
) -> f64 {
    let step_s = (time_constant_s / STEPS).max(period_s);
    let noise = density / step_s;
    let (half, decay) = (0.5 * amplitude, (-step_s / time_constant_s).exp());
    let variance = half * half;
    let stay = 0.5 * (1.0 + decay);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut up, mut belief) = (true, 0.5);
    let (mut estimate, mut uncertainty) = (0.0, variance);
    let mut ratio = 0.0;
    for _ in 0..PATH {
        up ^= !random.random_bool(stay);
        let white: f64 = random.sample(StandardNormal);
        let value = if up { half } else { -half } + noise.sqrt() * white;

        let [above, below] = [half, -half].map(|level| -0.5 * (value - level).powi(2) / noise);
        let nearer = above.max(below);
        let (above, below) = (belief * (above - nearer).exp(), (1.0 - belief) * (below - nearer).exp());
        let total = (above + below).max(f64::MIN_POSITIVE);
        ratio += total.ln() + nearer - 0.5 * noise.ln();
        belief = stay * above / total + (1.0 - stay) * below / total;

        let spread = uncertainty + noise;
        let error: f64 = value - estimate;
        ratio += 0.5 * (error * error / spread + spread.ln());
        let gain = uncertainty / spread;
        estimate = decay * (estimate + gain * error);
        uncertainty = decay * decay * uncertainty * (1.0 - gain) + (1.0 - decay * decay) * variance;
    }
    ratio * seconds / step_s / PATH as f64
}
