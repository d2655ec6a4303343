//! The bias as a function of the measured temperature that is not proportional to it: behind a first-order lag, because the
//! sensing element warms up later than the thermometer, or with a curvature.

use super::block_means::BlockMeans;
use super::gls_regression::{GlsRegression, RegressionEstimate};
use crate::distributions::NORMAL_975;
use crate::findings::{Effect, Parameter};
use crate::series::Series;
use nalgebra::DVector;

/// Shortest and longest time constant of a lag, s: a package of a few grams, and a housing of a kilogram.
const TIME_CONSTANTS_S: (f64, f64) = (10.0, 600.0);
/// Time constants that are tried first, evenly on a logarithmic scale: a third apart, over which a lag of a slow course
/// changes little.
const TIME_CONSTANTS: usize = 15;
/// A lag beyond this part of the record cannot be told from a drift.
const LONGEST_PART: f64 = 0.25;
/// By how much −2 ln likelihood must fall against the proportional response: χ² of the one degree of freedom that the time
/// constant is, at the p-value of 5·10⁻⁴ of the other candidates.
pub(super) const ADVANTAGE: f64 = 12.1;
/// Averages of the temperature in a block.
const FINE: u64 = 32;

/// The temperature in averages of a fraction of a block.
pub(super) struct TemperatureCourse {
    /// Sample periods of an average.
    width: u64,
    period_s: f64,
    means: Vec<f64>,
}

/// A response that the samples can be corrected for.
#[derive(Debug, Clone, PartialEq)]
pub struct ThermalResponse {
    /// As reported.
    pub effect: Effect,
    width: u64,
    /// The bias in the middle of each stretch of `width` sample periods.
    bias: Vec<f64>,
}

impl ThermalResponse {
    /// The bias in the sample period `slot`, in the channel's unit; 0 in the middle of its range over the record.
    #[must_use]
    pub fn bias(&self, slot: u64) -> f64 {
        let place = (slot as f64 / self.width as f64 - 0.5).clamp(0.0, (self.bias.len() - 1) as f64);
        let before = place.floor() as usize;
        let after = (before + 1).min(self.bias.len() - 1);
        let part = place - before as f64;
        self.bias[before] * (1.0 - part) + self.bias[after] * part
    }
}

impl TemperatureCourse {
    /// Of a channel of temperature, for blocks of `width` sample periods; `None` of any other channel.
    pub(super) fn new(series: &Series, width: u64) -> Option<Self> {
        let width = (width / FINE).max(1);
        let first = *series.values.first().filter(|_| series.unit == "degC")?;
        let count = usize::try_from(series.slots.last()? / width + 1).ok()?;
        let mut sums = vec![(0.0, 0u32); count];
        for (&slot, value) in series.slots.iter().zip(&series.values) {
            let (sum, count) = &mut sums[(slot / width) as usize];
            (*sum, *count) = (*sum + value, *count + 1);
        }
        // Where samples are missing, the temperature is the last one that was measured.
        let mut last = first;
        let mean = |(sum, count): &(f64, u32)| {
            if *count > 0 {
                last = sum / f64::from(*count);
            }
            last
        };
        let means = sums.iter().map(mean).collect();
        Some(Self { width, period_s: series.period_s, means })
    }

    /// The temperature behind a first-order lag, which had the first temperature before the record.
    fn lagged(&self, time_constant: f64) -> Vec<f64> {
        let kept = (-(self.width as f64) * self.period_s / time_constant).exp();
        let mut state = self.means[0];
        let next = |value: &f64| {
            // The state in the middle of the average.
            let before = state;
            state = kept * state + (1.0 - kept) * value;
            0.5 * (before + state)
        };
        self.means.iter().map(next).collect()
    }

    fn mean(&self) -> f64 {
        self.means.iter().sum::<f64>() / self.means.len() as f64
    }

    /// The square of the temperature's distance from its mean.
    fn squared(&self) -> Vec<f64> {
        let mean = self.mean();
        self.means.iter().map(|value| (value - mean).powi(2)).collect()
    }

    /// Averages of a course over the blocks.
    fn in_blocks(&self, course: &[f64], blocks: &BlockMeans) -> DVector<f64> {
        let size = (blocks.width as f64 / self.width as f64).max(1.0);
        let mean = |&number: &usize| {
            let range = |block: usize| ((block as f64 * size).round() as usize).min(course.len());
            let within = &course[range(number).min(course.len() - 1)..range(number + 1)];
            if within.is_empty() { course[course.len() - 1] } else { within.iter().sum::<f64>() / within.len() as f64 }
        };
        DVector::from_iterator(blocks.numbers.len(), blocks.numbers.iter().map(mean))
    }

    /// Block means of the squared course.
    pub(super) fn squared_regressor(&self, blocks: &BlockMeans) -> DVector<f64> {
        self.in_blocks(&self.squared(), blocks)
    }

    /// Block means of the course behind a lag.
    pub(super) fn lagged_regressor(&self, time_constant: f64, blocks: &BlockMeans) -> DVector<f64> {
        self.in_blocks(&self.lagged(time_constant), blocks)
    }

    /// The likeliest lag, and the regression on the course behind it.
    pub(super) fn likeliest_lag(&self, blocks: &BlockMeans, regression: &GlsRegression) -> Option<Lag> {
        let longest =
            TIME_CONSTANTS_S.1.min(LONGEST_PART * self.means.len() as f64 * self.width as f64 * self.period_s);
        if longest <= TIME_CONSTANTS_S.0 {
            return None;
        }
        let step = (longest / TIME_CONSTANTS_S.0).ln() / (TIME_CONSTANTS - 1) as f64;
        let at = |logarithm: f64| {
            let estimate = regression.estimate(&self.lagged_regressor(logarithm.exp(), blocks))?;
            Some((logarithm, estimate))
        };
        let tried = (0..TIME_CONSTANTS).filter_map(|number| at(TIME_CONSTANTS_S.0.ln() + step * number as f64));
        let likelier =
            |a: &(f64, RegressionEstimate), b: &(f64, RegressionEstimate)| a.1.deviance.total_cmp(&b.1.deviance);
        let coarse = tried.min_by(likelier)?;
        let fine = (-4..=4).filter_map(|number| at(coarse.0 + step * f64::from(number) / 4.0)).min_by(likelier)?;
        // The curvature of the likelihood at its maximum gives the error.
        let (below, above) = (at(fine.0 - step)?, at(fine.0 + step)?);
        let curvature = (below.1.deviance + above.1.deviance - 2.0 * fine.1.deviance) / (step * step);
        let error = if curvature > 0.0 { (2.0 / curvature).sqrt() } else { f64::INFINITY };
        Some(Lag { time_constant: fine.0.exp(), relative_error: error, estimate: fine.1 })
    }

    /// The response of a bias behind a lag.
    pub(super) fn lag_response(&self, lag: &Lag, estimate: &RegressionEstimate, unit: &str) -> ThermalResponse {
        let sensitivity = interval(estimate, format!("{unit}/degC"));
        let times = (NORMAL_975 * lag.relative_error).exp();
        let time_constant =
            Parameter::new(lag.time_constant, lag.time_constant / times, lag.time_constant * times, "s");
        let evidence = format!(
            "follows the measured temperature behind a lag of {:.0} s, by chance {:.0e}, and better than without a lag; the \
             sensing element warms up later than the thermometer",
            lag.time_constant, estimate.p_value,
        );
        let parameters = [("sensitivity", sensitivity), ("time_constant", time_constant)];
        self.response(self.lagged(lag.time_constant), estimate.size, Effect::new("thermal_lag", parameters, evidence))
    }

    /// The response of a bias to the squared temperature; `linear` is its sensitivity at the mean temperature.
    pub(super) fn squared_response(
        &self,
        linear: Option<&RegressionEstimate>,
        estimate: &RegressionEstimate,
        unit: &str,
    ) -> ThermalResponse {
        let none = RegressionEstimate { size: 0.0, error: 0.0, ..*estimate };
        let evidence = format!(
            "follows the square of the measured temperature, by chance {:.0e} in white, flicker and walking noise of any \
             mixture; a sensitivity that itself changes with temperature",
            estimate.p_value,
        );
        let mean = self.mean();
        let parameters = [
            ("sensitivity", interval(linear.unwrap_or(&none), format!("{unit}/degC"))),
            ("curvature", interval(estimate, format!("{unit}/degC^2"))),
            ("reference", Parameter::new(mean, mean, mean, "degC")),
        ];
        self.response(self.squared(), estimate.size, Effect::new("temperature_squared", parameters, evidence))
    }

    fn response(&self, course: Vec<f64>, size: f64, effect: Effect) -> ThermalResponse {
        let mean = course.iter().sum::<f64>() / course.len() as f64;
        ThermalResponse { effect, width: self.width, bias: course.iter().map(|value| size * (value - mean)).collect() }
    }
}

/// A lag of the response to the temperature.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lag {
    /// s.
    pub time_constant: f64,
    /// Standard deviation of its logarithm.
    relative_error: f64,
    /// Of the sensitivity.
    pub estimate: RegressionEstimate,
}

fn interval(of: &RegressionEstimate, unit: String) -> Parameter {
    let half = NORMAL_975 * of.error;
    Parameter::new(of.size, of.size - half, of.size + half, unit)
}
