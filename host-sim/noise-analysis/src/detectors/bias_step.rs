//! A step in the bias, which has to be likelier by a margin than random walk, flicker noise, ramps and temperature.

use super::block_means::BlockMeans;
use super::gls_regression::{GlsRegression, RegressionEstimate, Sizes};
use super::noise_grid::NoiseGrid;
use crate::bounds::BoundedEstimate;
use crate::distributions::{NORMAL_975, quantile};
use crate::effects::LevelStep;
use crate::effects::findings::{Correction, Detection};
use crate::samples::series::Series;
use nalgebra::DVector;

/// Highest p-value of a step. Measured recordings without a visible step reach 3e-5.
pub(super) const SIGNIFICANCE: f64 = 1e-5;
/// Advantage in −2 ln likelihood that a step must have over any other cause.
pub(super) const ADVANTAGE: f64 = 12.0;
/// Largest square of a second step's size over the first one's; above it the bias jumps repeatedly.
const SECOND: f64 = 0.2;
const POSITION_95: f64 = 11.0;
const POSSIBLE: f64 = 7.0;
/// Blocks at either end without a search: filters settle there, and too few blocks follow.
const ENDS: usize = 3;
/// Blocks on either side that are averaged for the bias before and after a step.
const SIDE: usize = 4;

pub(super) struct BiasStep {
    pub position: StepPosition,
    pub regressor: DVector<f64>,
    pub deviance: f64,
    /// Probability of such a step anywhere in the record by chance.
    pub p_value: f64,
}

pub(super) struct StepPosition {
    sample: usize,
    low: f64,
    high: f64,
}

/// The likeliest step beside the `known` regressors; `None` if insignificant, or if another step is as large.
pub(super) fn find(
    series: &Series,
    blocks: &BlockMeans,
    grid: &NoiseGrid,
    known: &[DVector<f64>],
    regression: &GlsRegression<'_>,
) -> Option<BiasStep> {
    let steps = regression.steps();
    if !regression.any_may_be_below(SIGNIFICANCE, &steps) {
        return None;
    }
    let scan = StepScan::new(regression, &steps)?;
    let p_value = scan.p_value_anywhere();
    if p_value >= SIGNIFICANCE {
        return None;
    }
    let (sample, error) = locate(series, blocks, scan.at)?;
    let regressor = blocks.step_at(series.slots[sample]);
    let with_step: Vec<DVector<f64>> = known.iter().cloned().chain([regressor.clone()]).collect();
    let with_step = GlsRegression::new(blocks, grid, &with_step);
    // Sizes, not gains: beside a step that no model has, the noise is larger.
    let again = StepScan::new(&with_step, &with_step.steps()).filter(|second| {
        with_step.deviance() - second.deviance > 2.0 * ADVANTAGE && second.size.powi(2) > SECOND * scan.size.powi(2)
    });
    if again.is_some() {
        return None;
    }
    let at = series.slots[sample] as f64;
    let (earliest, latest) = scan.possible(blocks);
    let low = (at - error).min(if scan.is_unique() { at } else { earliest }).max(0.0);
    let high = (at + error).max(if scan.is_unique() { at } else { latest });
    Some(BiasStep { position: StepPosition { sample, low, high }, regressor, deviance: scan.deviance, p_value })
}

pub(super) fn detection(
    series: &Series,
    position: &StepPosition,
    estimate: &RegressionEstimate,
    p_value: f64,
) -> Detection {
    let time = |slot: f64| slot * series.period_s;
    let at = series.slots[position.sample] as f64;
    let (size, half) = (estimate.size, NORMAL_975 * estimate.error);
    let step = LevelStep {
        time_s: BoundedEstimate::new(time(at), time(position.low), time(position.high)),
        size: BoundedEstimate::new(size, size - half, size + half).in_unit(series.unit),
        p_value,
    };
    Detection {
        effect: step.into(),
        correction: Some(Correction::Offset { from: series.slots[position.sample], size }),
    }
}

struct StepScan {
    /// −2 ln likelihood with the step at each block.
    deviances: Vec<f64>,
    deviance: f64,
    at: usize,
    /// Its size, and its p-value for a known position.
    size: f64,
    p_value: f64,
    /// Effective number of independent tests.
    independent: f64,
}

impl StepScan {
    fn new(regression: &GlsRegression<'_>, steps: &[Option<Sizes>]) -> Option<Self> {
        let sought = ENDS..steps.len().saturating_sub(ENDS) + 1;
        let tried = |(at, step): (usize, &Option<Sizes>)| {
            step.as_ref().filter(|_| sought.contains(&at)).and_then(|step| regression.deviance_with(step))
        };
        let tried: Vec<Option<f64>> = steps.iter().enumerate().map(tried).collect();
        let without = regression.deviance();
        let deviances: Vec<f64> = tried.iter().map(|deviance| deviance.unwrap_or(without)).collect();
        let of_steps = tried.iter().enumerate().filter_map(|(at, deviance)| Some((at, (*deviance)?)));
        let (at, deviance) = of_steps.min_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let best = regression.average(steps[at].as_ref()?)?;
        let independent = regression.independent_steps();
        Some(Self { deviances, deviance, at, size: best.size, p_value: best.p_value, independent })
    }

    /// p-value for an unknown position: adds Rice's expected number of level crossings of a smooth process.
    fn p_value_anywhere(&self) -> f64 {
        let level = quantile(0.5 * self.p_value);
        (self.p_value + self.independent * (-0.5 * level * level).exp()).min(1.0)
    }

    fn is_unique(&self) -> bool {
        self.deviances.iter().filter(|deviance| **deviance < self.deviance + POSSIBLE).count() <= 1
    }

    fn possible(&self, blocks: &BlockMeans) -> (f64, f64) {
        let possible = |at: &usize| self.deviances[*at] < self.deviance + POSSIBLE;
        let earliest = (1..=self.at).rev().take_while(possible).last().unwrap_or(self.at);
        let latest = (self.at..self.deviances.len()).take_while(possible).last().unwrap_or(self.at);
        let slot = |number: usize| number as f64 * blocks.width as f64;
        (slot(blocks.numbers[earliest - 1]), slot(blocks.numbers[latest] + 1))
    }
}

/// The first sample after a step near the beginning of block `at`, and half of its 95 % interval in samples.
fn locate(series: &Series, blocks: &BlockMeans, at: usize) -> Option<(usize, f64)> {
    let slot = |number: usize| number as u64 * blocks.width;
    let position = |slot: u64| series.slots.partition_point(|&other| other < slot);
    let (from, to) = (blocks.numbers[at - 1], blocks.numbers[at]);
    let means = blocks.means.as_slice();
    let average = |means: &[f64]| means.iter().sum::<f64>() / means.len() as f64;
    // The blocks beside the step may contain a part of it.
    let before = average(&means[(at - 1).saturating_sub(SIDE)..(at - 1).max(1)]);
    let after = average(&means[(at + 1).min(means.len() - 1)..(at + 1 + SIDE).min(means.len())]);
    let (middle, size) = (0.5 * (before + after), after - before);
    let range = position(slot(from))..position(slot(to + 1));
    let values = &series.values[range.clone()];
    let (mut sum, mut highest, mut best) = (0.0, f64::NEG_INFINITY, range.start);
    for (offset, value) in values.iter().enumerate().rev() {
        sum += size * (value - middle);
        if sum > highest {
            (highest, best) = (sum, range.start + offset);
        }
    }
    let differences = values.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>();
    let variance = differences / (2 * values.len().saturating_sub(1).max(1)) as f64;
    let error = POSITION_95 * variance / (size * size);
    error.is_finite().then_some((best, error.ceil()))
}
