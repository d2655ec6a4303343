//! What moves the level of a channel over the record: a ramp, a step, a slow cause such as the temperature, or several.
//!
//! In the differences of the Allan variance what takes the whole record to move has a few degrees of freedom, and any
//! other slow noise hides it. Here every course is judged on means of stretches of the record, against noise of any
//! mixture, and against the other courses: the one that explains most is taken, then the next beside it.

use super::block::Blocks;
use super::evidence::{Estimate, Evidence};
use super::noises::{NoiseTable, Noises};
use super::{Finding, Series, bias_step, rate_ramp};
use nalgebra::DVector;

/// Highest probability of a course that is none. Three or four courses are tried in each of six channels: one recording
/// in a hundred has a false one.
pub const SIGNIFICANCE: f64 = 5e-4;
/// Courses that are taken.
const MOST: usize = 4;

/// How a channel follows a cause.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// In the channel's unit over the cause's.
    pub sensitivity: f64,
    /// Standard deviation of the sensitivity.
    pub error: f64,
}

/// What moves the level of one channel.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Level {
    /// A jump.
    pub step: Option<Finding>,
    /// A constant pace.
    pub ramp: Option<Finding>,
    /// Causes by their number, with the sensitivity to each.
    pub followed: Vec<(usize, Followed)>,
}

/// A course that was taken.
enum Course {
    Ramp,
    Cause(usize),
    Step(bias_step::Place),
}

/// Looks for what moves the level of `series`; `causes` are other channels that may. One with other samples is none.
#[must_use]
pub fn find(series: &Series, causes: &[&Series], noises: &NoiseTable) -> Level {
    let Some(blocks) = Blocks::of(series) else { return Level::default() };
    let noises = noises.of(&blocks);
    let shapes: Vec<(usize, DVector<f64>)> = causes
        .iter()
        .enumerate()
        .filter(|(_, cause)| cause.slots == series.slots)
        .filter_map(|(number, cause)| Some((number, Blocks::of(cause)?.means)).filter(|(_, means)| moves(means, cause)))
        .collect();
    let mut taken: Vec<(Course, DVector<f64>, Claim)> = Vec::new();
    while taken.len() < MOST {
        let known: Vec<DVector<f64>> = taken.iter().map(|(_, shape, _)| shape.clone()).collect();
        match most_telling(series, &blocks, &noises, &shapes, &known, &taken) {
            Some(course) => taken.push(course),
            None => break,
        }
    }
    let mut level = Level::default();
    for (at, (course, shape, claim)) in taken.iter().enumerate() {
        let others: Vec<DVector<f64>> = taken
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != at)
            .map(|(_, (_, shape, _))| shape.clone())
            .collect();
        let Some(estimate) = Evidence::of(&blocks, &noises, &others).shape(shape) else { continue };
        match course {
            Course::Ramp => level.ramp = Some(rate_ramp::finding(series, &blocks, &estimate, claim)),
            Course::Step(place) => level.step = Some(bias_step::finding(series, place, &estimate, claim)),
            Course::Cause(number) => {
                let Estimate { size: sensitivity, error, .. } = estimate;
                level.followed.push((*number, Followed { sensitivity, error }));
            }
        }
    }
    level
}

/// Whether a cause has moved by a count at all: within one, its means tell how its rounding came out, not where it went.
fn moves(means: &DVector<f64>, cause: &Series) -> bool {
    means.max() - means.min() >= cause.resolution
}

/// Why a course was taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Claim {
    /// By how much it explains the data better than those before it, in −2 ln likelihood.
    pub gain: f64,
    /// Probability of as much by chance.
    pub p_value: f64,
}

/// Of the courses that chance does not explain, the one that explains the data best beside the `known` ones.
fn most_telling(
    series: &Series,
    blocks: &Blocks,
    noises: &Noises,
    causes: &[(usize, DVector<f64>)],
    known: &[DVector<f64>],
    taken: &[(Course, DVector<f64>, Claim)],
) -> Option<(Course, DVector<f64>, Claim)> {
    let evidence = Evidence::of(blocks, noises, known);
    let plain = evidence.deviance();
    let claim =
        |estimate: &Estimate, price: f64| (estimate.deviance + price, estimate.p_value, plain - estimate.deviance);
    let ramp = blocks.ramp();
    let mut rivals: Vec<(f64, Course, DVector<f64>, Claim)> = Vec::new();
    let mut add = |course: Course, shape: &DVector<f64>, (deviance, p_value, gain): (f64, f64, f64)| {
        let highest = if matches!(course, Course::Step(_)) { bias_step::SIGNIFICANCE } else { SIGNIFICANCE };
        if p_value < highest {
            rivals.push((deviance, course, shape.clone(), Claim { gain, p_value }));
        }
    };
    if let Some(estimate) = evidence.shape(&ramp) {
        add(Course::Ramp, &ramp, claim(&estimate, 0.0));
    }
    for (number, shape) in causes {
        if let Some(estimate) = evidence.shape(shape) {
            add(Course::Cause(*number), shape, claim(&estimate, 0.0));
        }
    }
    let stepped = taken.iter().any(|(course, ..)| matches!(course, Course::Step(_)));
    let step = if stepped { None } else { bias_step::find(series, blocks, noises, known, &evidence) };
    if let Some(step) = step {
        let gain = plain - step.deviance;
        add(Course::Step(step.place), &step.shape, (step.deviance + bias_step::AHEAD, step.p_value, gain));
    }
    let (_, course, shape, claim) = rivals.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((course, shape, claim))
}
