//! The time constant of a regressor on block means, by likelihood.

use super::gls_regression::RegressionEstimate;
use crate::bounds::BoundedEstimate;
use crate::distributions::NORMAL_975;

#[derive(Debug, Clone, Copy)]
pub(super) struct TimeConstant {
    pub value: f64,
    /// Standard deviation of its logarithm.
    relative_error: f64,
    pub estimate: RegressionEstimate,
}

impl TimeConstant {
    /// The likeliest of `count` time constants from `shortest` on by the factor `ratio`, refined, with its error.
    pub(super) fn likeliest(
        (shortest, ratio, count): (f64, f64, usize),
        spread: f64,
        coarse: impl Fn(&[f64]) -> Vec<Option<RegressionEstimate>>,
        fine: impl Fn(&[f64]) -> Vec<Option<RegressionEstimate>>,
    ) -> Option<Self> {
        let step = ratio.ln();
        let likelier =
            |a: &(f64, RegressionEstimate), b: &(f64, RegressionEstimate)| a.1.deviance.total_cmp(&b.1.deviance);
        let tried = |places: Vec<f64>, estimates: &dyn Fn(&[f64]) -> Vec<Option<RegressionEstimate>>| {
            let of_places = estimates(&places.iter().map(|place| place.exp()).collect::<Vec<f64>>());
            places.into_iter().zip(of_places).filter_map(|(at, of)| Some((at, of?))).collect::<Vec<_>>()
        };
        let coarse = tried((0..count).map(|number| shortest.ln() + step * number as f64).collect(), &coarse);
        let (rough, _) = coarse.into_iter().min_by(likelier)?;
        let around = (-4..=4).map(|number| rough + step * f64::from(number) / 4.0).collect();
        let (place, estimate) = tried(around, &fine).into_iter().min_by(likelier)?;
        let distance = spread * step;
        let [(_, below), (_, above)] = tried(vec![place - distance, place + distance], &fine)[..] else { return None };
        let curvature = (below.deviance + above.deviance - 2.0 * estimate.deviance) / (distance * distance);
        let relative_error = if curvature > 0.0 { (2.0 / curvature).sqrt() } else { f64::INFINITY };
        Some(Self { value: place.exp(), relative_error, estimate })
    }

    /// With 95 % bounds; `unit` converts from the unit of the search.
    pub(super) fn bounds(&self, unit: f64) -> BoundedEstimate {
        let (value, times) = (unit * self.value, (NORMAL_975 * self.relative_error).exp());
        BoundedEstimate::new(value, value / times, value * times)
    }
}
