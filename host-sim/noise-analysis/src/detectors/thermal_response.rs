//! The bias by a temperature behind a first-order lag or with a curvature.

use super::bias_response::{BiasResponse, Course, FRACTIONS, interval};
use super::block_means::BlockMeans;
use super::gls_regression::{GlsRegression, RegressionEstimate};
use super::time_constant::TimeConstant;
use crate::effects::{TemperatureCurvature, ThermalLag};
use crate::samples::series::Series;
use nalgebra::DVector;

/// Shortest and longest lag, s: a package of a few grams, a housing of a kilogram.
const TIME_CONSTANTS_S: (f64, f64) = (10.0, 600.0);
/// Time constants of the first grid, a third apart.
const TIME_CONSTANTS: usize = 15;
/// Longest lag as a part of the record; a longer one is a drift.
const LONGEST_PART: f64 = 0.25;
/// Least fall of −2 ln likelihood for one more parameter: χ² at 2·10⁻⁴.
pub(super) const ADVANTAGE: f64 = 13.8;

/// Averages of the temperature over fractions of a block.
pub(super) struct TemperatureCourse {
    measured: Course,
    period_s: f64,
}

impl TemperatureCourse {
    /// For blocks of `width` sample periods; `None` if the channel is no temperature.
    pub(super) fn new(series: &Series, width: u64) -> Option<Self> {
        let width = (width / FRACTIONS).max(1);
        let first = *series.values.first().filter(|_| series.unit == "degC")?;
        // Where samples are missing, the temperature is the last one that was measured.
        let mut last = first;
        let mean = |(sum, count)| {
            if count > 0 {
                last = sum / count as f64;
            }
            last
        };
        let values = series.sums_of_blocks(0, width).into_iter().map(mean).collect();
        Some(Self { measured: Course { width, values }, period_s: series.period_s })
    }

    /// The temperature behind a first-order lag; before the record it was the first temperature.
    fn lagged(&self, time_constant: f64) -> Course {
        let Course { width, values } = &self.measured;
        let kept = (-(*width as f64) * self.period_s / time_constant).exp();
        let mut state = values[0];
        let next = |value: &f64| {
            // State in the middle of the average.
            let before = state;
            state = kept * state + (1.0 - kept) * value;
            0.5 * (before + state)
        };
        Course { width: *width, values: values.iter().map(next).collect() }
    }

    fn squared(&self) -> Course {
        let mean = self.measured.mean();
        let values = self.measured.values.iter().map(|value| (value - mean).powi(2)).collect();
        Course { width: self.measured.width, values }
    }

    /// Mean of the lagged temperature and its mirror in time: smoothed like it, without delay.
    pub(super) fn smoothed_regressor(&self, time_constant: f64, blocks: &BlockMeans) -> DVector<f64> {
        let Course { width, ref values } = self.measured;
        let reversed = values.iter().rev().copied().collect();
        let reversed = Self { measured: Course { width, values: reversed }, ..*self };
        let ahead = reversed.lagged(time_constant).values.into_iter().rev();
        let values = self.lagged(time_constant).values.into_iter().zip(ahead);
        Course { width, values: values.map(|(behind, ahead)| 0.5 * (behind + ahead)).collect() }.in_blocks(blocks)
    }

    pub(super) fn squared_regressor(&self, blocks: &BlockMeans) -> DVector<f64> {
        self.squared().in_blocks(blocks)
    }

    pub(super) fn lagged_regressor(&self, time_constant: f64, blocks: &BlockMeans) -> DVector<f64> {
        self.lagged(time_constant).in_blocks(blocks)
    }

    pub(super) fn likeliest_lag(&self, blocks: &BlockMeans, regression: &GlsRegression) -> Option<TimeConstant> {
        let longest = TIME_CONSTANTS_S
            .1
            .min(LONGEST_PART * (self.measured.values.len() as u64 * self.measured.width) as f64 * self.period_s);
        if longest <= TIME_CONSTANTS_S.0 {
            return None;
        }
        let ratio = (longest / TIME_CONSTANTS_S.0).powf(1.0 / (TIME_CONSTANTS - 1) as f64);
        let estimate = |time_constants: &[f64]| {
            let regressors = time_constants.iter().map(|of| self.lagged_regressor(*of, blocks));
            regression.estimates(&regressors.collect::<Vec<DVector<f64>>>())
        };
        TimeConstant::likeliest((TIME_CONSTANTS_S.0, ratio, TIME_CONSTANTS), 1.0, estimate, estimate)
    }

    pub(super) fn lag_response(
        &self,
        lag: &TimeConstant,
        estimate: &RegressionEstimate,
        unit: &'static str,
    ) -> BiasResponse {
        let lagged = self.lagged(lag.value);
        let effect = ThermalLag {
            sensitivity: interval(estimate, unit),
            time_constant_s: lag.bounds(1.0),
            p_value: estimate.p_value,
            response: lagged.variance(estimate.size, self.period_s),
        };
        lagged.response(estimate.size, effect.into())
    }

    /// The response of a bias to the squared temperature; `linear` is its sensitivity at the mean temperature.
    pub(super) fn squared_response(
        &self,
        linear: Option<&RegressionEstimate>,
        estimate: &RegressionEstimate,
        unit: &'static str,
    ) -> BiasResponse {
        let none = RegressionEstimate { size: 0.0, error: 0.0, ..*estimate };
        let squared = self.squared();
        let effect = TemperatureCurvature {
            sensitivity: interval(linear.unwrap_or(&none), unit),
            curvature: interval(estimate, unit),
            reference_degc: self.measured.mean(),
            p_value: estimate.p_value,
            response: squared.variance(estimate.size, self.period_s),
        };
        squared.response(estimate.size, effect.into())
    }
}
