//! A bias that settles after the start of the record: `e^(−t/τ)` from the first sample on.

use super::bias_response::{BiasResponse, Course, FRACTIONS, interval};
use super::bias_step::SIGNIFICANCE;
use super::block_means::BlockMeans;
use super::gls_regression::{GlsRegression, RegressionEstimate};
use super::time_constant::TimeConstant;
use crate::effects::TurnOnTransient;
use nalgebra::DVector;

/// Shortest time constant, blocks; a shorter transient is one mean.
const SHORTEST_BLOCKS: f64 = 1.0;
/// Longest time constant as a part of the record; a slower one is a drift.
const LONGEST_PART: f64 = 0.25;
/// Time constants of the first grid, a factor of 1.5 apart: a hundredth of the statistic is lost between two.
const TIME_CONSTANTS: usize = 9;

#[derive(Debug, Clone, Copy)]
pub(super) struct Transient(TimeConstant);

impl Transient {
    /// The likeliest transient beside the known regressors; `None` if its p-value is not below [`SIGNIFICANCE`].
    pub(super) fn likeliest(blocks: &BlockMeans, regression: &GlsRegression) -> Option<Self> {
        let longest = LONGEST_PART * (blocks.numbers.last()? + 1) as f64;
        let ratio = (longest / SHORTEST_BLOCKS).powf(1.0 / (TIME_CONSTANTS - 1) as f64);
        let regressors = |time_constants: &[f64]| -> Vec<DVector<f64>> {
            time_constants.iter().map(|of| regressor(*of, blocks)).collect()
        };
        let found = TimeConstant::likeliest(
            (SHORTEST_BLOCKS, ratio, TIME_CONSTANTS),
            0.5,
            |time_constants| regression.estimates_below(SIGNIFICANCE, &regressors(time_constants)),
            |time_constants| regression.estimates(&regressors(time_constants)),
        )?;
        // At the longest time constant it is a drift.
        (found.value < longest * (1.0 - 1e-9)).then_some(Self(found))
    }

    pub(super) fn estimate(&self) -> RegressionEstimate {
        self.0.estimate
    }

    pub(super) fn regressor(&self, blocks: &BlockMeans) -> DVector<f64> {
        regressor(self.0.value, blocks)
    }

    /// The bias of the transient with the size of `estimate`; unit of the channel, sample period in s.
    pub(super) fn response(
        &self,
        blocks: &BlockMeans,
        period_s: f64,
        estimate: &RegressionEstimate,
        unit: &'static str,
    ) -> BiasResponse {
        let course = course(self.0.value, blocks);
        let effect = TurnOnTransient {
            size: interval(estimate, unit),
            time_constant_s: self.0.bounds(blocks.width as f64 * period_s),
            p_value: estimate.p_value,
            response: course.variance(estimate.size, period_s),
        };
        course.response(estimate.size, effect.into())
    }
}

/// Block means of a transient of size 1; time constant in blocks.
fn regressor(time_constant: f64, blocks: &BlockMeans) -> DVector<f64> {
    let mean = |&number: &usize| {
        let start = -(number as f64) / time_constant;
        start.exp() * -(-1.0 / time_constant).exp_m1() * time_constant
    };
    DVector::from_iterator(blocks.numbers.len(), blocks.numbers.iter().map(mean))
}

fn course(time_constant: f64, blocks: &BlockMeans) -> Course {
    let width = (blocks.width / FRACTIONS).max(1);
    let per_block = blocks.width as f64 / width as f64;
    let count = ((blocks.numbers.last().map_or(0, |last| last + 1)) as f64 * per_block).ceil() as usize;
    let value = |at: usize| (-(at as f64 + 0.5) / per_block / time_constant).exp();
    Course { width, values: (0..count.max(1)).map(value).collect() }
}

#[cfg(test)]
mod tests {
    use crate::detectors::bias;
    use crate::effects::{Effect, TurnOnTransient};
    use crate::samples::series::Series;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Effects in 1,280 s at 10 Hz: white noise of deviation 1, a walk of steps `step`, a transient of `size` and 60 s.
    fn found(seed: u64, step: f64, size: f64) -> Vec<Effect> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut walk = 0.0;
        let value = |slot: u64| {
            walk += step * random.sample::<f64, _>(StandardNormal);
            walk + random.sample::<f64, _>(StandardNormal) + size * (-(slot as f64) / 600.0).exp()
        };
        let slots = 0..12_800;
        let values = slots.clone().map(value).collect();
        let series =
            Series { slots: slots.clone().collect(), values, span: slots, period_s: 0.1, resolution: 1e-3, unit: "g" };
        let changes = bias::find(&series, &[], &[], &|| 0.0);
        let detections = changes.step.into_iter().chain(changes.ramp).map(|found| found.effect);
        changes.responses.into_iter().map(|of| of.effect).chain(detections).collect()
    }

    #[test]
    fn a_bias_that_settles_is_measured() {
        let (mut sizes, mut times) = (0, 0);
        for seed in 0..20 {
            // Without the walk the mean of a time constant is known to 0.04.
            let found = found(seed, 0.003, -1.5);
            let [Effect::TurnOnTransient(TurnOnTransient { size, time_constant_s, .. })] = &found[..] else {
                panic!("{seed}: {found:?}")
            };
            sizes += u32::from((size.low..=size.high).contains(&-1.5));
            times += u32::from((time_constant_s.low..=time_constant_s.high).contains(&60.0));
        }
        // 19 of 20 are expected; 15 or fewer have a probability of 3·10⁻³.
        assert!(sizes > 15 && times > 15, "{sizes} {times}");
    }

    #[test]
    fn a_walk_is_no_transient() {
        for seed in 0..100 {
            for step in [0.0, 0.01, 0.1] {
                let found = found(seed, step, 0.0);
                assert!(!found.iter().any(|of| matches!(of, Effect::TurnOnTransient(_))), "{seed} {step}: {found:?}");
            }
        }
    }
}
