//! The part in which a sensor was steady: the longest run of blocks of rows whose noise is that of the quietest ones.

use crate::inspection::column_facts::ColumnFacts;
use crate::inspection::sensor_guess::SensorGuess;
use crate::rows::quantizer::{MEDIAN_OF_NORMAL, noise_at_lag};
use std::ops::Range;

/// Rows of a block whose noise is independent, and most times as many where a filter makes neighbours alike.
const BLOCK: usize = 128;
const MOST_ALIKE: usize = 16;
/// How many times the noise at half of a lag that at the lag is where the noise is still alike.
const GROWS: f64 = 1.1;
/// How many times the standard deviation of the quietest eighth of the blocks a steady block has at most. That of 128 independent samples
/// scatters by 10 %.
const MOST_NOISE: f64 = 3.0;
/// How far deviation and mean of a block may differ from those of a sensor at rest, deg/s and g: noise and vibration of a table are below,
/// a hand is above.
const REST_DEG_S: f64 = 2.0;
const REST_G: f64 = 0.05;

/// The longest part of a recording in which the sensor was steady.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SteadyPart {
    /// Rows from 0, the end excluded.
    pub rows: Range<usize>,
    /// True if the units tell that the sensor was at rest; without units its values are steady, and nothing else is known.
    pub is_rest: bool,
}

impl SteadyPart {
    /// `None` where no column is one of an inertial sensor.
    pub(crate) fn find(columns: &[ColumnFacts], sensors: &[SensorGuess]) -> Option<Self> {
        let inertial: Vec<(usize, Option<f64>)> = sensors.iter().flat_map(SensorGuess::inertial).collect();
        let rows = columns[inertial.first()?.0].values.len();
        let alike = inertial.iter().map(|(at, _)| rows_alike(columns[*at].values)).max().unwrap_or(1);
        let block = BLOCK * alike;
        let blocks = rows.div_ceil(block);
        let mut is_steady = vec![true; blocks];
        // The means of the blocks of each force, which change where the sensor was turned, and by how much they may.
        let mut forces: Vec<(Vec<f64>, f64)> = Vec::new();
        for &(at, factor) in &inertial {
            let ColumnFacts { values, step, .. } = &columns[at];
            let is_force = sensors.iter().any(|sensor| sensor.is_force(at));
            let limit = factor.map(|factor| if is_force { REST_G } else { REST_DEG_S } / factor);
            let moments: Vec<(f64, f64)> = values.chunks(block).map(moments).collect();
            let sorted = |part: fn(&(f64, f64)) -> f64| {
                let mut all: Vec<f64> = moments.iter().map(part).filter(|value| value.is_finite()).collect();
                all.sort_by(f64::total_cmp);
                all
            };
            let (means, deviations) = (sorted(|of| of.0), sorted(|of| of.1));
            let usual = means.get(means.len() / 2).copied().unwrap_or(0.0);
            let quiet = deviations.get(deviations.len() / 8).copied().unwrap_or(0.0).max(step.unwrap_or(0.0));
            for (steady, (mean, deviation)) in is_steady.iter_mut().zip(&moments) {
                let is_quiet = *deviation <= MOST_NOISE * quiet;
                let is_usual = |limit: f64| is_force || (mean - usual).abs() < limit;
                let is_rest = limit.is_none_or(|limit| is_usual(limit) && *deviation < limit);
                // A block without a value says nothing.
                *steady &= mean.is_nan() || is_quiet && is_rest;
            }
            if let Some(limit) = limit.filter(|_| is_force) {
                forces.push((moments.iter().map(|of| of.0).collect(), limit));
            }
        }
        let is_turned =
            |first: usize, at: usize| forces.iter().any(|(means, limit)| (means[at] - means[first]).abs() >= *limit);
        // A movement may begin or end in the blocks beside those that it moves.
        let mut longest = longest_run(&is_steady, is_turned);
        if longest.start > 0 && longest.len() > 2 {
            longest.start += 1;
        }
        if longest.end < blocks && longest.len() > 2 {
            longest.end -= 1;
        }
        let rows = longest.start * block..(longest.end * block).min(rows);
        Some(Self { rows, is_rest: inertial.iter().all(|(_, factor)| factor.is_some()) })
    }
}

/// Rows until the noise is as good as independent: those at which the differences stop to grow.
fn rows_alike(values: &[f64]) -> usize {
    let grows = |lag: &usize| noise_at_lag(values, 2 * lag) > GROWS * noise_at_lag(values, *lag);
    let mut lag = 1;
    while lag < MOST_ALIKE && grows(&lag) {
        lag *= 2;
    }
    lag
}

/// The longest run of true, which ends where `is_other` of its first place and the next one too.
fn longest_run(flags: &[bool], is_other: impl Fn(usize, usize) -> bool) -> Range<usize> {
    let mut longest = 0..0;
    let mut first = 0;
    for at in 0..=flags.len() {
        let is_end = at == flags.len() || !flags[at];
        if is_end || is_other(first, at) {
            if at - first > longest.len() {
                longest = first..at;
            }
            first = at + usize::from(is_end);
        }
    }
    longest
}

/// Median and standard deviation of the finite values by the median of their distances from it, which single outliers do not move.
fn moments(values: &[f64]) -> (f64, f64) {
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let mut finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let middle = median(&mut finite);
    let mut distances: Vec<f64> = finite.iter().map(|value| (value - middle).abs()).collect();
    (middle, median(&mut distances) / MEDIAN_OF_NORMAL)
}
