//! What a channel may follow.

use crate::fit::fit;
use crate::{Curve, Kind};
use heapless::Vec;

/// A share of a covariate's variance that is its own noise above which an octave says nothing about the sensitivity.
const NOISE_SHARE: f64 = 0.5;

/// What a measurement adds of its own.
const NOISE: [Kind; 2] = [Kind::Quantization, Kind::AngleRandomWalk];

/// A measured quantity that a channel may follow, at up to `POINTS` averaging factors.
#[derive(Debug, Clone, PartialEq)]
pub struct Covariate<const POINTS: usize> {
    sample_period: f64,
    /// Coefficients of [`NOISE`].
    noise: [f64; NOISE.len()],
    /// Variance of one step of its converter where no noise dithers it; 0 where it does.
    step: f64,
    /// Averaging factors and Allan variances.
    points: Vec<(u64, f64), POINTS>,
}

impl<const POINTS: usize> Covariate<POINTS> {
    /// A covariate with its curve in a physical unit, in which its converter has steps of `lsb`: what is known from
    /// averaging factor `from` on, as far as there is room.
    #[must_use]
    #[inline(never)] // so that its stack is not everybody's
    pub fn new<const MEASURED: usize>(curve: &Curve<MEASURED>, lsb: f64, from: u64) -> Self {
        let [quantization, white] = NOISE;
        let model = fit(curve, &[quantization, white, Kind::BiasInstability, Kind::RateRandomWalk, Kind::RateRamp]);
        let mut noise = [0.0; NOISE.len()];
        noise.iter_mut().zip(model.terms()).for_each(|(noise, term)| *noise = term.value);
        let dithered = curve.points().first().is_some_and(|point| point.avar > 0.2 * lsb * lsb);
        Self { noise, step: if dithered { 0.0 } else { lsb * lsb / 12.0 }, ..Self::as_measured(curve, from) }
    }

    /// A covariate that is to be subtracted as it is measured, noise and all.
    #[must_use]
    pub fn as_measured<const MEASURED: usize>(curve: &Curve<MEASURED>, from: u64) -> Self {
        let points = curve.points().iter().filter(|point| point.n >= from);
        Self {
            sample_period: curve.sample_period(),
            noise: [0.0; NOISE.len()],
            step: 0.0,
            points: points.map(|point| (point.n, point.avar)).take(POINTS).collect(),
        }
    }

    /// Another stretch of the same covariate, whose noise is known from this one.
    #[must_use]
    pub fn continued<const MEASURED: usize>(&self, curve: &Curve<MEASURED>, from: u64) -> Self {
        Self { noise: self.noise, step: self.step, ..Self::as_measured(curve, from) }
    }

    /// Measured Allan variance, if the averaging factor is known.
    pub(super) fn avar(&self, n: u64) -> Option<f64> {
        self.points.iter().find(|point| point.0 == n).map(|&(_, avar)| avar)
    }

    /// Allan variance of what was really there to be followed, and of all that was measured.
    pub(super) fn signal(&self, n: u64) -> Option<(f64, f64)> {
        let measured = self.avar(n)?;
        let of = |(kind, value): (&Kind, f64)| value * value * kind.avar(n, self.sample_period);
        let noise: f64 = NOISE.iter().zip(self.noise).map(of).sum();
        let told = measured > 0.0 && noise < NOISE_SHARE * measured && measured > 4.0 * self.step;
        told.then_some((measured - noise, measured))
    }
}
