//! Angle quantization: an angle kept in whole steps, of which the rate is the difference.

/// Turns a rate into the rate that a counter of angle steps shows.
#[derive(Clone, Debug)]
pub(super) struct AngleQuantizer {
    step: f64,
    /// The angle less the steps that were counted, in steps; −½ to ½.
    rest: f64,
}

impl AngleQuantizer {
    /// `coefficient` is Q: the error of the angle is uniform over a step of √12·Q.
    pub(super) fn new(coefficient: f64) -> Self {
        Self { step: 12f64.sqrt() * coefficient, rest: 0.0 }
    }

    /// The rate over one sample period of `period_s`.
    pub(super) fn quantize(&mut self, rate: f64, period_s: f64) -> f64 {
        // Only the rest is kept, so that a long record loses no digits.
        let angle = self.rest + rate * period_s / self.step;
        let counted = angle.round();
        self.rest = angle - counted;
        counted * self.step / period_s
    }
}
