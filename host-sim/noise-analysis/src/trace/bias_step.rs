//! A step in bias: the level changes at once and stays.
//!
//! A random walk, flicker noise, a drift and a temperature move the level too, so a step has to explain more than any of
//! these.

use super::block::Blocks;
use super::evidence::{Estimate, Evidence};
use super::level::Claim;
use super::noises::Noises;
use crate::distributions::{NORMAL_975, quantile};
use crate::findings::{Effect, Finding, Parameter, Repair};
use crate::series::Series;
use nalgebra::DVector;

/// Highest probability of a step that is none. The level of a real part at rest moves less evenly than any mixture of
/// noises: in the measured recordings, where no step is in sight, 3e-5 was reached.
pub(super) const SIGNIFICANCE: f64 = 1e-5;
/// By how much a step must explain the data better than any other cause, in −2 ln likelihood.
pub(super) const AHEAD: f64 = 12.0;
/// Part of a step's evidence that a second one may have; else the level jumps to and fro.
const SECOND: f64 = 0.2;
/// 95 % of the errors in the place of a step of size s in white noise are within this times (σ/s)² samples (Yao 1987).
const PLACE_975: f64 = 11.0;
/// Places of a step that explain the data worse by no more than this, in −2 ln likelihood, are possible.
const POSSIBLE: f64 = 7.0;
/// Blocks at either end in which no step is sought: a filter settles, and nothing tells a step from a spike.
const ENDS: usize = 3;
/// Blocks on either side that tell the level before and after.
const LEVEL: usize = 4;

/// The step that explains the data best.
pub(super) struct Step {
    pub place: Place,
    /// Means of blocks of a step of 1.
    pub shape: DVector<f64>,
    /// −2 ln likelihood of its best size.
    pub deviance: f64,
    /// Of as much by chance, anywhere.
    pub p_value: f64,
}

/// Where a step is, to the sample.
pub(super) struct Place {
    position: usize,
    /// Slots that bound the place with 95 %.
    low: f64,
    high: f64,
}

/// The likeliest step beside `known` shapes, which `evidence` has; `None` if the level jumps more than once.
pub(super) fn find(
    series: &Series,
    blocks: &Blocks,
    noises: &Noises,
    known: &[DVector<f64>],
    evidence: &Evidence<'_>,
) -> Option<Step> {
    let scan = Scan::of(evidence)?;
    let inside = Inside::of(series, blocks, scan.at)?;
    let shape = blocks.step_at(series.slots[inside.position]);
    let beside: Vec<DVector<f64>> = known.iter().cloned().chain([shape.clone()]).collect();
    let beside = Evidence::of(blocks, noises, &beside);
    let gain = evidence.deviance() - scan.deviance;
    let second = Scan::of(&beside).map_or(0.0, |second| beside.deviance() - second.deviance);
    if second > (SECOND * gain).max(2.0 * AHEAD) {
        return None;
    }
    let at = series.slots[inside.position] as f64;
    let (earliest, latest) = scan.possible(blocks);
    let low = (at - inside.error).min(if scan.is_unique() { at } else { earliest }).max(0.0);
    let high = (at + inside.error).max(if scan.is_unique() { at } else { latest });
    Some(Step {
        place: Place { position: inside.position, low, high },
        shape,
        deviance: scan.deviance,
        p_value: scan.probability(),
    })
}

/// A step as it is reported.
pub(super) fn finding(series: &Series, place: &Place, estimate: &Estimate, claim: &Claim) -> Finding {
    let time = |slot: f64| slot * series.period_s;
    let at = series.slots[place.position] as f64;
    let (size, half) = (estimate.size, NORMAL_975 * estimate.error);
    let evidence = format!(
        "the level changes by {size:.3e} {} at {:.1} s and stays, by chance anywhere {:.0e} in white, flicker and walking \
         noise of any mixture; a mechanical or thermal shock, or a fault that begins",
        series.unit,
        time(at),
        claim.p_value,
    );
    Finding {
        effect: Effect::new(
            "bias_step",
            [
                ("time", Parameter::new(time(at), time(place.low), time(place.high), "s")),
                ("size", Parameter::new(size, size - half, size + half, series.unit)),
            ],
            evidence,
        ),
        repair: Some(Repair::Level { from: place.position, size }),
    }
}

/// A step tried at the beginning of every block.
struct Scan {
    /// −2 ln likelihood with the step at each block.
    deviances: Vec<f64>,
    /// With the best one.
    deviance: f64,
    /// The block at which the best one is.
    at: usize,
    /// Of the best one, at its place.
    p_value: f64,
    /// How many independent looks the tries are.
    looks: f64,
}

impl Scan {
    fn of(evidence: &Evidence<'_>) -> Option<Self> {
        let steps = evidence.steps();
        let sought = ENDS..steps.len().saturating_sub(ENDS) + 1;
        // A step that is known already leaves nothing of itself.
        let tried = |(at, step): (usize, &Option<Estimate>)| step.filter(|_| sought.contains(&at));
        let tried: Vec<Option<Estimate>> = steps.iter().enumerate().map(tried).collect();
        let plain = evidence.deviance();
        let deviances: Vec<f64> = tried.iter().map(|step| step.map_or(plain, |step| step.deviance)).collect();
        let (at, best) = tried
            .iter()
            .enumerate()
            .filter_map(|(at, step)| Some((at, (*step)?)))
            .min_by(|(_, a), (_, b)| a.deviance.total_cmp(&b.deviance))?;
        Some(Self { deviances, deviance: best.deviance, at, p_value: best.p_value, looks: evidence.looks() })
    }

    /// Probability of such an excess anywhere: Rice's count of crossings of a level by a smooth process.
    fn probability(&self) -> f64 {
        let level = quantile(0.5 * self.p_value);
        (self.p_value + self.looks * (-0.5 * level * level).exp()).min(1.0)
    }

    fn is_unique(&self) -> bool {
        self.deviances.iter().filter(|deviance| **deviance < self.deviance + POSSIBLE).count() <= 1
    }

    /// First and last slot at which the step may be.
    fn possible(&self, blocks: &Blocks) -> (f64, f64) {
        let possible = |at: &usize| self.deviances[*at] < self.deviance + POSSIBLE;
        let earliest = (1..=self.at).rev().take_while(possible).last().unwrap_or(self.at);
        let latest = (self.at..self.deviances.len()).take_while(possible).last().unwrap_or(self.at);
        let slot = |number: usize| number as f64 * blocks.width as f64;
        (slot(blocks.numbers[earliest - 1]), slot(blocks.numbers[latest] + 1))
    }
}

/// Where in a block, to the sample.
struct Inside {
    position: usize,
    /// Half of the 95 % interval, samples.
    error: f64,
}

impl Inside {
    /// The sample from which on the new level explains the data best, white noise being dominant from one sample to the
    /// next.
    fn of(series: &Series, blocks: &Blocks, at: usize) -> Option<Self> {
        let slot = |number: usize| number as u64 * blocks.width;
        let position = |slot: u64| series.slots.partition_point(|&other| other < slot);
        let (from, to) = (blocks.numbers[at - 1], blocks.numbers[at]);
        let means = blocks.means.as_slice();
        let level = |numbers: &[f64]| numbers.iter().sum::<f64>() / numbers.len() as f64;
        // The blocks next to the step may hold a part of it.
        let before = level(&means[(at - 1).saturating_sub(LEVEL)..(at - 1).max(1)]);
        let after = level(&means[(at + 1).min(means.len() - 1)..(at + 1 + LEVEL).min(means.len())]);
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
