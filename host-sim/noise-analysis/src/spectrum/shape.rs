//! The smooth part of a spectrum: white, flicker and random-walk noise behind the part's filter, over a flat floor.
//!
//! Fitted by Whittle's likelihood: an ordinate of a spectrum is gamma distributed around the density, so `Σ g·(ln S + P/S)`
//! is least, `g` being half the degrees of freedom of an ordinate.

use super::mixture;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;

/// Filters of the part: two averages of `2^M` samples each.
const LARGEST_TAPS_LOG2: u32 = 6;

/// White, 1/f, 1/f² behind the filter; the floor is not filtered.
const TERMS: usize = 4;

/// An average over neighbouring ordinates of a spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// Hz.
    pub frequency: f64,
    /// One-sided, unit²/Hz.
    pub density: f64,
    /// Independent ordinates that were averaged: half the degrees of freedom.
    pub ordinates: f64,
}

/// A sum of power laws behind a filter.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    sample_period: f64,
    /// Taps of each of the two averages of the part's filter, 1 for none.
    pub taps: u32,
    /// Densities at 1 Hz of the filtered white, 1/f and 1/f² noise, and of the floor, unit²/Hz.
    pub densities: [f64; TERMS],
}

impl Shape {
    /// The likeliest shape over all settings of the part's filter.
    #[must_use]
    pub fn fit(bands: &[Band], sample_period: f64) -> Self {
        let candidates = (0..=LARGEST_TAPS_LOG2).map(|log2| Self::fit_behind(bands, sample_period, 1 << log2));
        let likeliest = candidates.min_by(|a, b| a.whittle(bands).total_cmp(&b.whittle(bands)));
        likeliest.unwrap_or(Self { sample_period, taps: 1, densities: [0.0; TERMS] })
    }

    /// Density at `frequency` in Hz, unit²/Hz.
    #[must_use]
    pub fn density(&self, frequency: f64) -> f64 {
        let basis = basis(frequency, self.sample_period, self.taps);
        basis.iter().zip(self.densities).map(|(basis, density)| basis * density).sum()
    }

    /// N in unit·√s, as the density of the white noise before the filter tells it.
    #[must_use]
    pub fn angle_random_walk(&self) -> f64 {
        (self.densities[0] / 2.0).sqrt()
    }

    /// Relative standard deviation of [`angle_random_walk`](Self::angle_random_walk) by the information in `bands`, for
    /// an N among the other terms; `None` where there is no white noise.
    #[must_use]
    pub fn angle_random_walk_error(&self, bands: &[Band]) -> Option<f64> {
        // Fisher information of ln densities, of those terms that are there.
        let there: Vec<usize> = (0..TERMS).filter(|&term| self.densities[term] > 0.0).collect();
        if there.first() != Some(&0) {
            return None;
        }
        let mut information = DMatrix::zeros(there.len(), there.len());
        for band in bands {
            let basis = basis(band.frequency, self.sample_period, self.taps);
            let total = self.density(band.frequency);
            let shares = there.iter().map(|&term| basis[term] * self.densities[term] / total);
            let shares = DVector::from_iterator(there.len(), shares);
            information += band.ordinates * &shares * shares.transpose();
        }
        let variance = information.cholesky()?.inverse()[(0, 0)];
        Some(variance.sqrt() / 2.0)
    }

    fn fit_behind(bands: &[Band], sample_period: f64, taps: u32) -> Self {
        let bases: Vec<[f64; TERMS]> = bands.iter().map(|band| basis(band.frequency, sample_period, taps)).collect();
        let mut shape = Self { sample_period, taps, densities: [0.0; TERMS] };
        mixture::fit(bands, &bases, &mut shape.densities);
        shape
    }

    fn whittle(&self, bands: &[Band]) -> f64 {
        let modelled: Vec<f64> = bands.iter().map(|band| self.density(band.frequency)).collect();
        mixture::objective(bands, &modelled)
    }
}

/// What the terms contribute at a density of 1. Without a filter the floor is white noise too, and left out.
fn basis(frequency: f64, sample_period: f64, taps: u32) -> [f64; TERMS] {
    let gain = filter_gain(frequency, sample_period, taps);
    // A walk that is sampled: 1/f² and its images.
    let walk = PI * sample_period / (PI * frequency * sample_period).sin();
    [gain, gain / frequency, gain * walk * walk, if taps > 1 { 1.0 } else { 0.0 }]
}

/// Power gain of two averages over `taps` samples each.
pub fn filter_gain(frequency: f64, sample_period: f64, taps: u32) -> f64 {
    let phase = PI * frequency * sample_period;
    let taps = f64::from(taps);
    if phase.sin() == 0.0 { 1.0 } else { ((taps * phase).sin() / (taps * phase.sin())).powi(4) }
}
