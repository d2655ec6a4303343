//! The processes behind the effects, one value a sample.

use super::super::noise::gauss;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// First-order Gauss-Markov process of standard deviation 1.
#[derive(Clone, Debug)]
pub(super) struct Markov {
    time_constant_s: f64,
    state: Option<f64>,
}

impl Markov {
    pub(super) fn new(time_constant_s: f64) -> Self {
        Self { time_constant_s, state: None }
    }

    pub(super) fn next(&mut self, period_s: f64, random: &mut ChaCha8Rng) -> f64 {
        let periods = period_s / self.time_constant_s;
        let state = match self.state {
            // 1 − decay², without cancellation for long correlation times.
            Some(state) => (-periods).exp() * state + (-(-2.0 * periods).exp_m1()).sqrt() * gauss(random),
            None => gauss(random),
        };
        self.state = Some(state);
        state
    }
}

/// Narrow-band noise of standard deviation 1: two Markov processes in quadrature on a carrier.
#[derive(Clone, Debug)]
pub(super) struct Resonance {
    frequency_hz: f64,
    quadratures: [Markov; 2],
}

impl Resonance {
    pub(super) fn new(frequency_hz: f64, bandwidth_hz: f64) -> Self {
        // exp(−t/T) has a density of half width 1/(2πT).
        let envelope = Markov::new(1.0 / (PI * bandwidth_hz));
        Self { frequency_hz, quadratures: [envelope.clone(), envelope] }
    }

    pub(super) fn next(&mut self, time_s: f64, period_s: f64, random: &mut ChaCha8Rng) -> f64 {
        let (sin, cos) = (2.0 * PI * (self.frequency_hz * time_s).fract()).sin_cos();
        let [in_phase, quadrature] = &mut self.quadratures;
        in_phase.next(period_s, random) * cos + quadrature.next(period_s, random) * sin
    }
}

/// Symmetric random telegraph signal between −½ and ½.
#[derive(Clone, Debug)]
pub(super) struct Telegraph {
    time_constant_s: f64,
    up: Option<bool>,
}

impl Telegraph {
    pub(super) fn new(time_constant_s: f64) -> Self {
        Self { time_constant_s, up: None }
    }

    pub(super) fn next(&mut self, period_s: f64, random: &mut ChaCha8Rng) -> f64 {
        // Probability of an odd number of jumps in a period: covariance exp(−t/T) exactly, however short T.
        let odd = -0.5 * (-period_s / self.time_constant_s).exp_m1();
        let up = match self.up {
            Some(up) => up ^ random.random_bool(odd),
            None => random.random_bool(0.5),
        };
        self.up = Some(up);
        if up { 0.5 } else { -0.5 }
    }
}
