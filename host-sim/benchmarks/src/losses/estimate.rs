//! Estimates from a record, complete or with losses.

use super::noise::{RATE_HZ, TestNoise};
use allan_core::{Cascade, Curve, Model, fit::fit};
use std::ops::Range;

/// Number of octaves of the estimator; a record fills those up to half its length.
const OCTAVES: usize = 24;

/// Curve and model of one record.
#[derive(Debug, Clone)]
pub struct EstimatedRecord {
    /// Allan variances in counts².
    pub curve: Curve<OCTAVES>,
    /// The model fitted to the curve, with N, B and K in counts and seconds.
    pub model: Model,
    pub samples: u64,
}

impl EstimatedRecord {
    /// Estimates a record without the samples of `gaps`.
    #[must_use]
    pub fn new(noise: TestNoise, record: &[i32], gaps: &[Range<usize>]) -> Self {
        let mut cascade = Cascade::<OCTAVES, 8>::new();
        let mut next = 0;
        for gap in gaps {
            cascade.push_slice(&record[next..gap.start]);
            cascade.gap(gap.len() as u32);
            next = gap.end;
        }
        cascade.push_slice(&record[next..]);
        let curve = cascade.curve(1.0 / RATE_HZ);
        let mut fitted = curve.clone();
        fitted.retain(|point| point.n >= noise.shortest_fitted());
        Self { model: fit(&fitted, noise.terms()), curve, samples: cascade.len() }
    }
}
