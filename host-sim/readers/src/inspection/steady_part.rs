//! Steady part: longest run of blocks as quiet as the quietest.

use crate::inspection::column_facts::ColumnFacts;
use crate::inspection::sensor_guess::SensorGuess;
use crate::rows::{MEDIAN_OF_NORMAL, noise_at_lag};
use std::ops::Range;

/// Rows of a block, and most correlation lengths.
const BLOCK: usize = 128;
const MOST_ALIKE: usize = 16;
/// Ratio of noise at half a lag where it is still correlated.
const GROWS: f64 = 1.1;
/// Over the quietest eighth; 128 samples scatter by 10 %.
const MOST_NOISE: f64 = 3.0;
/// Deviation and change at rest, deg/s and g: above a table, below a hand.
const REST_DEG_S: f64 = 2.0;
const REST_G: f64 = 0.05;

/// The longest part of a recording in which the sensor was steady.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SteadyPart {
    pub rows: Range<usize>,
    /// Known by units; else only steady.
    pub is_rest: bool,
}

impl SteadyPart {
    /// `None` without inertial columns.
    pub(crate) fn find(columns: &[ColumnFacts], sensors: &[SensorGuess]) -> Option<Self> {
        let inertial: Vec<(usize, Option<f64>)> = sensors.iter().flat_map(SensorGuess::inertial).collect();
        let rows = columns[inertial.first()?.0].values.len();
        let alike = inertial.iter().map(|(at, _)| rows_alike(columns[*at].values)).max().unwrap_or(1);
        let block = BLOCK * alike;
        let blocks = rows.div_ceil(block);
        let mut is_steady = vec![true; blocks];
        // Forces change with attitude.
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
            let step = step.unwrap_or(0.0);
            let noisy = &deviations[deviations.partition_point(|deviation| *deviation <= step)..];
            // A sensor that begins late, or has stopped, holds a value.
            let holds_values = noisy.len() > deviations.len() / 2;
            let quiet = if holds_values { noisy } else { &deviations };
            let quiet = quiet.get(quiet.len() / 8).copied().unwrap_or(0.0).max(step);
            for (steady, (mean, deviation)) in is_steady.iter_mut().zip(&moments) {
                let is_held = holds_values && *deviation <= 0.0 && quiet > MOST_NOISE * step;
                let is_quiet = *deviation <= MOST_NOISE * quiet && !is_held;
                let is_usual = |limit: f64| is_force || (mean - usual).abs() < limit;
                let is_rest = limit.is_none_or(|limit| is_usual(limit) && *deviation < limit);
                // Without a value.
                *steady &= mean.is_nan() || is_quiet && is_rest;
            }
            if let Some(limit) = limit.filter(|_| is_force) {
                forces.push((moments.iter().map(|of| of.0).collect(), limit));
            }
        }
        let is_turned =
            |first: usize, at: usize| forces.iter().any(|(means, limit)| (means[at] - means[first]).abs() >= *limit);
        // Movements may reach into the next block.
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

/// Lag at which differences stop to grow.
fn rows_alike(values: &[f64]) -> usize {
    let grows = |lag: &usize| noise_at_lag(values, 2 * lag) > GROWS * noise_at_lag(values, *lag);
    let mut lag = 1;
    while lag < MOST_ALIKE && grows(&lag) {
        lag *= 2;
    }
    lag
}

/// Ends where `is_other`.
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
