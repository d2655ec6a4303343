//! A step in bias: the level changes at once and stays.
//!
//! A random walk, flicker noise, a drift and a temperature move the level too. So the step is judged on means of
//! stretches of the record by the likelihood ratio under noise whose mixture of white, flicker and random walk is free
//! with the step and without, and it has to explain more than a ramp or any other cause that is offered.

use super::block::{BLOCKS, Blocks, Whitening, dot, residual, size, without};
use super::normal::{NORMAL_975, upper_tail};
use super::{Finding, Repair, SIGNIFICANCE, Series, effect, parameter};
use std::f64::consts::PI;

/// By how much a step must explain the data better than any other cause, in −2 ln likelihood.
const AHEAD: f64 = 12.0;
/// Part of a step's evidence that a second one may have; else the level jumps to and fro.
const SECOND: f64 = 0.2;
/// 95 % of the errors in the place of a step of size s in white noise are within this times (σ/s)² samples (Yao 1987).
const PLACE_975: f64 = 11.0;
/// Places of a step that explain the data worse by no more than this, in −2 ln likelihood, are possible.
const POSSIBLE: f64 = 7.0;
/// What the free mixture of the noise may gain from a step that is none, in −2 ln likelihood: of 1,800 simulated channels
/// without a step the best reached 28, where Rice's count alone allows one in 2,000 to reach 24.
const NOISE_GAIN: f64 = 8.0;
/// Blocks at either end in which no step is sought: a filter settles, and nothing tells a step from a spike.
const ENDS: usize = 3;
/// Blocks on either side that tell the level before and after.
const LEVEL: usize = 4;

/// Looks for a step in one channel. `causes` are other channels, of the same samples, that may move this one.
#[must_use]
pub fn find(series: &Series, causes: &[&Series]) -> Option<Finding> {
    let blocks = Blocks::of(series)?;
    if blocks.numbers.len() < BLOCKS / 4 || blocks.means.iter().all(|mean| *mean == blocks.means[0]) {
        return None;
    }
    let mut shapes: Vec<Vec<f64>> = vec![blocks.numbers.iter().map(|&number| number as f64).collect()];
    for cause in causes.iter().filter(|cause| cause.slots == series.slots) {
        shapes.extend(Blocks::of(cause).map(|blocks| blocks.means));
    }
    let noises = blocks.noises();
    let plain =
        noises.iter().map(|noise| noise.deviance(residual(noise, &blocks.means, &[]))).fold(f64::INFINITY, f64::min);
    let other = |shape: &Vec<f64>| {
        let of = |noise: &Whitening| noise.deviance(residual(noise, &blocks.means, std::slice::from_ref(shape)));
        plain - noises.iter().map(of).fold(f64::INFINITY, f64::min)
    };
    let scans: Vec<Scan> = noises.iter().map(|noise| Scan::of(noise, &blocks, &[])).collect();
    let best = scans.iter().min_by(|a, b| a.deviance.total_cmp(&b.deviance))?;
    let deviance = plain - best.deviance;
    let p_value = best.probability(deviance);
    if p_value > SIGNIFICANCE || shapes.iter().map(other).fold(0.0, f64::max) > deviance - AHEAD {
        return None;
    }
    let place = Place::of(series, &blocks, best.at)?;
    let step = blocks.step_at(series.slots[place.position]);
    let (size, error) = size(&noises, &blocks.means, &step, &[]);
    let left = best.noise.deviance(residual(best.noise, &blocks.means, std::slice::from_ref(&step)));
    let second = left - Scan::of(best.noise, &blocks, std::slice::from_ref(&step)).deviance;
    if second > (SECOND * deviance).max(2.0 * AHEAD) {
        return None;
    }
    let time = |slot: f64| slot * series.period_s;
    let at = series.slots[place.position] as f64;
    let (earliest, latest) = best.possible(&blocks);
    let low = (at - place.error).min(if best.is_unique() { at } else { earliest }).max(0.0);
    let high = (at + place.error).max(if best.is_unique() { at } else { latest });
    let half = NORMAL_975 * error;
    let evidence = format!(
        "the level changes by {size:.3e} {} at {:.1} s and stays, {:.1} σ beyond what white, flicker and walking noise do; \
         a mechanical or thermal shock, or a fault that begins",
        series.unit,
        time(at),
        deviance.sqrt(),
    );
    Some(Finding {
        effect: effect(
            "bias_step",
            [
                ("time", parameter(time(at), time(low), time(high), "s")),
                ("size", parameter(size, size - half, size + half, series.unit)),
            ],
            evidence,
        ),
        deviance,
        p_value,
        repair: Repair::Level { from: place.position, size },
    })
}

/// By how much the best step explains the data better than none at all, of deviance `plain`, in −2 ln likelihood.
pub(super) fn gain(blocks: &Blocks, noises: &[Whitening], plain: f64) -> f64 {
    let best = noises.iter().map(|noise| Scan::of(noise, blocks, &[]).deviance).fold(f64::INFINITY, f64::min);
    plain - best
}

/// A step tried at the beginning of every block.
struct Scan<'a> {
    noise: &'a Whitening,
    /// −2 ln likelihood with the step at each block but the first.
    deviances: Vec<f64>,
    /// With the best one.
    deviance: f64,
    /// The block at which the best one is.
    at: usize,
    /// Σ acos of the correlation of neighbouring tries, over π: how many independent looks they are.
    looks: f64,
}

impl<'a> Scan<'a> {
    fn of(noise: &'a Whitening, blocks: &Blocks, known: &[Vec<f64>]) -> Self {
        let count = blocks.means.len();
        let known: Vec<Vec<f64>> = known.iter().map(|shape| noise.free(shape)).collect();
        let free = |values: &[f64]| known.iter().fold(noise.free(values), |rest, shape| without(rest, shape));
        let data = free(&blocks.means);
        let squares = dot(&data, &data);
        let (mut deviances, mut looks) = (Vec::with_capacity(count), 0.0);
        let mut previous: Option<Vec<f64>> = None;
        let mut step = vec![1.0; count];
        for at in 1..count {
            step[at - 1] = 0.0;
            let shape = free(&step);
            let norm = dot(&shape, &shape);
            // A step that is known already leaves nothing of itself.
            let sought = (ENDS..=count - ENDS).contains(&at);
            let gain = if sought && norm > 1e-9 { dot(&data, &shape).powi(2) / norm } else { 0.0 };
            deviances.push(noise.deviance((squares - gain).max(1e-12 * squares)));
            if let Some(previous) = &previous {
                let correlation = dot(previous, &shape) / (norm * dot(previous, previous)).sqrt();
                looks += if correlation.is_finite() { correlation.clamp(-1.0, 1.0).acos() / PI } else { 0.0 };
            }
            previous = Some(shape);
        }
        let (best, deviance) =
            deviances.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, f64::INFINITY));
        Self { noise, deviance, at: best + 1, looks, deviances }
    }

    /// Probability of such an excess anywhere: Rice's count of crossings of a level by a smooth process.
    fn probability(&self, deviance: f64) -> f64 {
        let level = (deviance - NOISE_GAIN).max(0.0).sqrt();
        (2.0 * upper_tail(level) + self.looks * (-0.5 * level * level).exp()).min(1.0)
    }

    fn is_unique(&self) -> bool {
        self.deviances.iter().filter(|deviance| **deviance < self.deviance + POSSIBLE).count() <= 1
    }

    /// First and last slot at which the step may be.
    fn possible(&self, blocks: &Blocks) -> (f64, f64) {
        let possible = |at: &usize| self.deviances[*at - 1] < self.deviance + POSSIBLE;
        let earliest = (1..=self.at).rev().take_while(possible).last().unwrap_or(self.at);
        let latest = (self.at..=self.deviances.len()).take_while(possible).last().unwrap_or(self.at);
        let slot = |number: usize| number as f64 * blocks.width as f64;
        (slot(blocks.numbers[earliest - 1]), slot(blocks.numbers[latest] + 1))
    }
}

/// Where in a block, to the sample.
struct Place {
    position: usize,
    /// Half of the 95 % interval, samples.
    error: f64,
}

impl Place {
    /// The sample from which on the new level explains the data best, white noise being dominant from one sample to the
    /// next.
    fn of(series: &Series, blocks: &Blocks, at: usize) -> Option<Self> {
        let slot = |number: usize| number as u64 * blocks.width;
        let position = |slot: u64| series.slots.partition_point(|&other| other < slot);
        let (from, to) = (blocks.numbers[at - 1], blocks.numbers[at]);
        let level = |numbers: &[f64]| numbers.iter().sum::<f64>() / numbers.len() as f64;
        // The blocks next to the step may hold a part of it.
        let before = level(&blocks.means[(at - 1).saturating_sub(LEVEL)..(at - 1).max(1)]);
        let after =
            level(&blocks.means[(at + 1).min(blocks.means.len() - 1)..(at + 1 + LEVEL).min(blocks.means.len())]);
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
        let error = PLACE_975 * variance / (size * size);
        error.is_finite().then_some(Self { position: best, error: error.ceil() })
    }
}
