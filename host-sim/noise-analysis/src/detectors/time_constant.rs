//! The time constant of a regressor on block means, by likelihood.

use super::gls_regression::RegressionEstimate;
use crate::bounds::BoundedEstimate;
use crate::distributions::NORMAL_975;

/// The likeliest time constant.
#[derive(Debug, Clone, Copy)]
pub(super) struct TimeConstant {
    /// In the unit of the search.
    pub value: f64,
    /// Standard deviation of its logarithm.
    relative_error: f64,
    /// Of the size with it.
    pub estimate: RegressionEstimate,
}

impl TimeConstant {
    /// Of `count` time constants from `shortest` on, each `ratio` times the one before, the likeliest by `coarse`; then the likeliest by
    /// `fine` around it. The curvature of the likelihood over the part `spread` of the ratio gives the error.
    pub(super) fn likeliest(
        (shortest, ratio, count): (f64, f64, usize),
        spread: f64,
        coarse: impl Fn(f64) -> Option<RegressionEstimate>,
        fine: impl Fn(f64) -> Option<RegressionEstimate>,
    ) -> Option<Self> {
        let step = ratio.ln();
        let likelier =
            |a: &(f64, RegressionEstimate), b: &(f64, RegressionEstimate)| a.1.deviance.total_cmp(&b.1.deviance);
        let places = (0..count).map(|number| shortest.ln() + step * number as f64);
        let (rough, _) = places.filter_map(|place| Some((place, coarse(place.exp())?))).min_by(likelier)?;
        let at = |place: f64| Some((place, fine(place.exp())?));
        let around = (-4..=4).filter_map(|number| at(rough + step * f64::from(number) / 4.0));
        let (place, estimate) = around.min_by(likelier)?;
        let distance = spread * step;
        let (below, above) = (at(place - distance)?.1, at(place + distance)?.1);
        let curvature = (below.deviance + above.deviance - 2.0 * estimate.deviance) / (distance * distance);
        let relative_error = if curvature > 0.0 { (2.0 / curvature).sqrt() } else { f64::INFINITY };
        Some(Self { value: place.exp(), relative_error, estimate })
    }

    /// With its 95 % bounds, in a unit of which one of the search has so many.
    pub(super) fn bounds(&self, unit: f64) -> BoundedEstimate {
        let (value, times) = (unit * self.value, (NORMAL_975 * self.relative_error).exp());
        BoundedEstimate::new(value, value / times, value * times)
    }
}
