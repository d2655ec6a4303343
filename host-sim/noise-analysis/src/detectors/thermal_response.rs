//! The bias by a temperature behind a first-order lag or with a curvature.

use super::bias_response::{BiasResponse, Course, FRACTIONS, interval};
use super::block_means::{BLOCKS, BlockMeans};
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

/// The temperature as it is without lag in the regression: its rounding errors are smoothed over `time_constant` s. No sample
/// before the sample period `middle` depends on a later one.
pub(crate) fn smoothed(temperature: &Series, time_constant: f64, middle: u64) -> Series {
    let mut smoothed = temperature.clone();
    let values = smoothed.values_mut().iter_mut();
    let in_part = |part: Series| {
        let course = TemperatureCourse::new(&part, part.slots.last()? / BLOCKS as u64)?.smoothed(time_constant);
        Some(part.slots.iter().map(|slot| course.at(*slot)).collect::<Vec<f64>>())
    };
    let parts = [temperature.before(middle), temperature.from(middle)].into_iter().filter_map(in_part);
    values.zip(parts.flatten()).for_each(|(value, smoothed)| *value = smoothed);
    smoothed
}

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
        // A missing temperature is the last one that was measured.
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
    fn smoothed(&self, time_constant: f64) -> Course {
        let Course { width, ref values } = self.measured;
        let reversed = values.iter().rev().copied().collect();
        let reversed = Self { measured: Course { width, values: reversed }, ..*self };
        let ahead = reversed.lagged(time_constant).values.into_iter().rev();
        let values = self.lagged(time_constant).values.into_iter().zip(ahead);
        Course { width, values: values.map(|(behind, ahead)| 0.5 * (behind + ahead)).collect() }
    }

    pub(super) fn smoothed_regressor(&self, time_constant: f64, blocks: &BlockMeans) -> DVector<f64> {
        self.smoothed(time_constant).in_blocks(blocks)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::bias::{self, BiasChanges};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    const SAMPLES: usize = 120_000;

    fn series(values: Vec<f64>, unit: &'static str) -> Series {
        let slots = 0..SAMPLES as u64;
        Series {
            slots: slots.clone().collect(),
            values: values.into(),
            span: slots,
            period_s: 0.01,
            resolution: 1e-3,
            unit,
        }
    }

    /// Noise and rounding of the thermometer, √(0.2² + 0.14²/12) = 0.204 °C, are 1.02 deg/s by a sensitivity of 5 deg/s/°C: beside the
    /// bias's white noise of 0.4 deg/s, the variance of what is left would be 1 + 1.02²/0.4² = 7.5 times as large.
    #[test]
    fn the_noise_of_the_thermometer_is_not_added_to_the_bias() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        // Level at the ends and in the middle.
        let course = |at: usize| 1.0 - (TAU * at as f64 / 60_000.0).cos();
        let measured = |at: usize| ((25.0 + course(at) + 0.2 * normal()) / 0.14).round() * 0.14;
        let temperature = series((0..SAMPLES).map(measured).collect(), "degC");
        let bias = series((0..SAMPLES).map(|at| 5.0 * course(at) + 0.4 * normal()).collect(), "deg/s");
        let BiasChanges { sensitivities, .. } = bias::find(&bias, &[&temperature], &[], &|| 0.0);
        let [(0, of)] = sensitivities[..] else { panic!("{sensitivities:?}") };
        let ratio = |temperature: &Series| {
            let rest = bias
                .values
                .iter()
                .zip(temperature.values.iter())
                .map(|(bias, of_time)| bias - of.sensitivity * of_time);
            let rest: Vec<f64> = rest.collect();
            let mean = rest.iter().sum::<f64>() / SAMPLES as f64;
            rest.iter().map(|of| (of - mean).powi(2)).sum::<f64>() / SAMPLES as f64 / 0.4_f64.powi(2)
        };
        assert!(ratio(&temperature) > 7.0, "{}", ratio(&temperature));
        // √(2/120,000) = 0.4 % of the variance is chance, and 0.2 % the smoothed noise.
        let smooth = smoothed(&temperature, of.smoothed_over_s, 60_000);
        assert!(of.smoothed_over_s > 0.0 && (ratio(&smooth) - 1.0).abs() < 0.03, "{of:?}: {}", ratio(&smooth));
        // Nothing of the second half is in the first.
        let mut other = temperature.clone();
        other.values_mut()[60_000..].iter_mut().for_each(|value| *value += 1.0);
        assert_eq!(smoothed(&other, of.smoothed_over_s, 60_000).values[..60_000], smooth.values[..60_000]);
    }
}
