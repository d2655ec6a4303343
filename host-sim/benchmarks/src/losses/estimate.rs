//! Estimates from a record, complete or with losses.

use super::noise::{RATE_HZ, TestNoise};
use allan_core::{Cascade, fit::fit};
use serde::Serialize;
use std::ops::Range;

/// Number of octaves of the estimator; a record fills those up to half its length.
const OCTAVES: usize = 24;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EstimatedRecord {
    pub samples: u64,
    pub octaves: Vec<EstimatedOctave>,
    /// N, B and K that the noise has, as the fit finds them. Behind the filter the fit begins at four filter lengths.
    pub coefficients: Vec<EstimatedCoefficient>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EstimatedOctave {
    pub n: u64,
    /// Allan variance, counts².
    pub avar: f64,
    /// Variance that was subtracted for interpolated samples, counts².
    pub interpolation: f64,
    pub edf: f64,
}

/// A coefficient over its truth, with 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EstimatedCoefficient {
    pub symbol: &'static str,
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

impl EstimatedRecord {
    /// Estimates a record without the samples of `gaps`.
    pub fn new(noise: TestNoise, record: &[i32], gaps: &[Range<usize>]) -> Self {
        let mut cascade = Cascade::<OCTAVES, 8>::new();
        let mut next = 0;
        for gap in gaps {
            cascade.push_slice(&record[next..gap.start]);
            cascade.gap(gap.len() as u32);
            next = gap.end;
        }
        cascade.push_slice(&record[next..]);
        let mut curve = cascade.curve(1.0 / RATE_HZ);
        let octaves = curve.points().iter().map(|point| EstimatedOctave {
            n: point.n,
            avar: point.avar,
            interpolation: point.interpolation,
            edf: point.edf,
        });
        let octaves = octaves.collect();
        curve.retain(|point| point.n >= noise.shortest_fitted());
        let model = fit(&curve, &noise.terms());
        let coefficients = noise.truth().into_iter().zip(model.terms()).map(|((symbol, truth), term)| {
            let [value, low, high] = [term.value, term.low, term.high].map(|of| of / truth);
            EstimatedCoefficient { symbol, value, low, high }
        });
        Self { samples: cascade.len(), octaves, coefficients: coefficients.collect() }
    }
}
