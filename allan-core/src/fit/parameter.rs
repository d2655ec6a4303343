//! The parameters of a model, and what they do to the points.

use super::points::Points;
use super::problem::{MAX_PARAMETERS, Problem};
use crate::math::sqrtf;
use crate::model::MAX_SHAPE;
use heapless::Vec;

/// Relative step of the numerical derivative to a shape's parameter.
const STEP: f64 = 1e-3;
/// Part of a direction beyond the others that rounding could have made.
const ROUNDING: f32 = 1e-4;

/// What a column of derivatives belongs to.
#[derive(Debug, Clone, Copy)]
pub(super) enum Parameter {
    /// The amount of a term.
    Amount(usize),
    /// The logarithm of a parameter of a term's shape.
    Shape(usize, usize),
}

impl<const POINTS: usize> Problem<POINTS> {
    /// Every coefficient, and the shape of every term that is there; sets their columns.
    #[inline(never)]
    pub(super) fn differentiate(&mut self, points: &Points<POINTS>) -> Vec<Parameter, MAX_PARAMETERS> {
        let mut parameters: Vec<_, MAX_PARAMETERS> = (0..self.kinds.len()).map(Parameter::Amount).collect();
        for (term, kind) in self.kinds.iter().enumerate().filter(|(term, _)| self.amounts[*term] > 0.0) {
            let square = self.square(term);
            for index in kind.freedom() {
                let Some(column) = self.columns.get_mut(parameters.len()) else { return parameters };
                for (entry, point) in column.iter_mut().zip(points.all()) {
                    let at = |factor: f64| {
                        let mut shape: [f64; MAX_SHAPE] = kind.shape().map(|(_, value)| value);
                        shape[index] *= factor;
                        kind.with_shape(shape).avar(point.n, points.curve.sample_period())
                    };
                    *entry = (square * (at(1.0 + STEP) - at(1.0 - STEP)) / (2.0 * STEP) / point.avar) as f32;
                }
                // There was a column for it.
                let _ = parameters.push(Parameter::Shape(term, index));
            }
        }
        parameters
    }

    /// The directions in the space of standardised residuals that a fit can follow, made orthonormal: that many columns.
    #[inline(never)]
    pub(super) fn orthonormal(&mut self, points: &Points<POINTS>) -> usize {
        let parameters = self.differentiate(points);
        let mut scale = [0.0; POINTS];
        for (at, (scale, point)) in scale.iter_mut().zip(&points.measured).enumerate() {
            *scale = sqrtf(point.edf / 2.0) / self.modelled(at, &self.amounts);
        }
        let there = |parameter: &Parameter| match *parameter {
            Parameter::Amount(term) | Parameter::Shape(term, _) => self.amounts[term] > 0.0,
        };
        let mut count = 0;
        for column in (0..parameters.len()).filter(|&column| there(&parameters[column])) {
            let (known, rest) = self.columns.split_at_mut(column);
            let Some(direction) = rest.first_mut() else { break };
            direction.iter_mut().zip(&scale).for_each(|(entry, scale)| *entry *= scale);
            // Of length 1 before and after, so that one threshold serves all.
            if !normalise(direction, 0.0) {
                continue;
            }
            for known in known.iter().take(count) {
                take_away(direction, known);
            }
            if normalise(direction, ROUNDING) {
                self.columns.swap(count, column);
                count += 1;
            }
        }
        count
    }
}

/// Makes the length 1 if it is above `least`.
fn normalise(direction: &mut [f32], least: f32) -> bool {
    let length = sqrtf(direction.iter().map(|entry| entry * entry).sum());
    direction.iter_mut().for_each(|entry| *entry /= length);
    length > least
}

/// Takes from a vector what it has along a direction of length 1.
pub(super) fn take_away(vector: &mut [f32], direction: &[f32]) {
    let along: f32 = vector.iter().zip(direction).map(|(a, b)| a * b).sum();
    vector.iter_mut().zip(direction).for_each(|(entry, known)| *entry -= along * known);
}
