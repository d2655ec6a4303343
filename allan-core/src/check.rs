//! How far a model is from a curve.

use crate::{Curve, Model, math};

/// The two numbers that say how wrong a model is, over the octaves with `n ≤ M/8` of a curve of `M` samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelError {
    /// `mean edf·(ln(m/v) + v/m − 1)`; 1 is what a true model scores on the data that it was fitted to.
    pub deviance_per_point: f64,
    /// `100·sqrt(mean (½ ln(v/m))²)`: the rms error of the Allan deviation in percent.
    pub rms_percent: f64,
    /// Octaves that were compared.
    pub points: usize,
}

impl ModelError {
    /// Compares the measured variance `v` with the modelled one `m`; `None` when no octave can be compared.
    ///
    /// The degrees of freedom are those of the model's own mixture of terms. A variance of 0 on either side has no
    /// logarithm: it makes the error infinite.
    #[must_use]
    pub fn between<const OCTAVES: usize>(model: &Model, curve: &Curve<OCTAVES>) -> Option<Self> {
        let (mut deviance, mut square, mut points) = (0.0, 0.0, 0);
        for point in curve.points().iter().filter(|point| point.n <= curve.samples() / 8) {
            let ratio = point.avar / model.avar(point.n);
            let log = math::ln(ratio);
            deviance += model.edf(point) * (ratio - 1.0 - log);
            square += log * log / 4.0;
            points += 1;
        }
        (points > 0).then(|| Self {
            deviance_per_point: deviance / points as f64,
            rms_percent: 100.0 * math::sqrt(square / points as f64),
            points,
        })
    }
}
