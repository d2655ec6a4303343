//! The terms that a model may lack, each from where its shape can be searched for.

use super::Lines;
use crate::term::{Filter, Markov, Resonance, Sinusoid};
use crate::{Curve, Kind};
use heapless::Vec;

/// Shapes of one family: what lies between them is reached by the search.
pub(super) const MAX_SHAPES: usize = 64;

/// Terms that differ in their shape alone.
pub(super) struct Family {
    pub(super) shapes: Vec<Kind, MAX_SHAPES>,
    /// Parameters that it adds to the model.
    pub(super) parameters: u32,
}

/// Every family for a curve, the simplest first.
pub(super) fn families<const POINTS: usize>(curve: &Curve<POINTS>, lines: Lines) -> Vec<Family, 8> {
    let period = curve.sample_period();
    let longest = curve.points().last().map_or(period, |point| point.tau);
    let mut families = Vec::new();
    let mut add = |parameters, shapes: Vec<Kind, MAX_SHAPES>| {
        // Eight families have room.
        let _ = families.push(Family { shapes, parameters });
    };
    add(1, [Kind::Quantization].into_iter().collect());
    add(1, [Kind::RateRamp].into_iter().collect());
    // Behind the filter the converter's rounding adds white noise.
    add(2, (1..=6).map(|log2| Kind::Filtered(Filter::bartlett(1 << log2))).collect());
    let sampled_slowly = |decimation| Kind::Filtered(Filter { stages: 2, taps: 8, decimation });
    // It takes the place of the white noise: the rate is all that it adds.
    add(2, [6.1, 8.1, 10.1, 12.1].into_iter().map(sampled_slowly).collect());
    add(2, octaves(2.0 * period, longest, 1.0).map(|time| Kind::Markov(Markov { time_constant: time })).collect());
    match lines {
        Lines::Known(lines) => add(2, lines.iter().copied().take(MAX_SHAPES).collect()),
        Lines::InTheCurve => {
            let frequencies = || octaves(0.4 / longest, 0.45 / period, 3.0);
            add(2, frequencies().map(|frequency| Kind::Sinusoid(Sinusoid { frequency })).collect());
            let broad = |frequency| Kind::Resonance(Resonance { frequency, bandwidth: frequency / 5.0 });
            add(3, frequencies().map(broad).collect());
        }
    }
    families
}

/// Values from `low` to `high`, `density` to an octave, as many as there is room for.
fn octaves(low: f64, high: f64, density: f64) -> impl Iterator<Item = f64> {
    let factor = crate::math::exp(core::f64::consts::LN_2 / density);
    core::iter::successors(Some(low), move |value| Some(value * factor))
        .take_while(move |&v| v <= high)
        .take(MAX_SHAPES)
}
