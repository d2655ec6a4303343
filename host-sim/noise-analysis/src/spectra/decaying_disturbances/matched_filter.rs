//! The matched filter for an exponential decay in noise of the record's own spectrum (G. Turin, IRE Trans. IT-6, 1960).

use crate::spectra::periodogram::{smooth_length, taper};
use crate::spectra::slow_background::SlowBackground;
use fourier::Complex;
use std::f64::consts::TAU;

/// Largest part of empty blocks.
const MOST_EMPTY: f64 = 1.0 / 32.0;
/// Lowest order that the filters pass, periods per record.
const LOWEST: usize = 6;
/// Ordinate over the noise of a line (chance: 10⁻⁶), and ordinates on either side that its taper reaches.
const LINE: f64 = 14.0;
const LINE_REACH: usize = 2;
/// Ordinates on either side whose mean above this multiple of the noise is a band (chance: 10⁻⁴).
const BAND_REACH: usize = 8;
const BAND: f64 = 2.0;
/// Time constants, and blocks beyond, in which the filters respond to the record's ends.
const END_TIMES: f64 = 4.0;
const END_BLOCKS: usize = 16;

/// Transform of a record in blocks, and the density of its noise.
pub(super) struct WhitenedRecord {
    length: usize,
    transform: Vec<Complex<f64>>,
    /// 1/density, 0 at lines.
    weights: Vec<f64>,
    /// Phase factor of a delay of one block per order.
    turns: Vec<Complex<f64>>,
}

pub(super) struct FilteredRecord {
    pub output: Vec<f64>,
    /// Autocovariance of the output in noise; also the response to a decay of height 1 at a block's start.
    pub covariance: Vec<f64>,
}

impl WhitenedRecord {
    /// `None` if too many means are missing, or without noise.
    pub(super) fn new(means: &[f64]) -> Option<Self> {
        let mut values = filled(means)?;
        let length = values.len();
        let forward = fourier::forward(length);
        // Continued periodically without a jump.
        let end = length / 256;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let (first, last) = (mean(values.get(..end)?), mean(values.get(length - end..)?));
        let slope = (last - first) / (length - end) as f64;
        values.iter_mut().enumerate().for_each(|(at, value)| *value -= first + slope * at as f64);
        let level = mean(&values);
        values.iter_mut().for_each(|value| *value -= level);
        let mut tapered: Vec<f64> = values.iter().enumerate().map(|(at, value)| taper(at, length) * value).collect();
        let squares: f64 = (0..length).map(|at| taper(at, length).powi(2)).sum();
        let mut transform = forward.make_output_vec();
        forward.process(&mut tapered, &mut transform).ok()?;
        let ordinates: Vec<f64> = transform.iter().map(|bin| bin.norm_sqr() / squares).collect();
        forward.process(&mut values, &mut transform).ok()?;
        let turns = (0..transform.len()).map(|order| Complex::cis(-TAU * order as f64 / length as f64)).collect();
        Some(Self { length, transform, weights: weights(&ordinates)?, turns })
    }

    pub(super) fn filtered(&self, time: f64, is_reversed: bool) -> Option<FilteredRecord> {
        let decays = self.decays(time);
        let of_filter = |order: usize| if is_reversed { decays[order] } else { decays[order].conj() };
        let output = self.inverse(|order| self.weights[order] * self.transform[order] * of_filter(order))?;
        let covariance = self.inverse(|order| (self.weights[order] * decays[order].norm_sqr()).into())?;
        Some(FilteredRecord { output, covariance })
    }

    /// Response of the filter for `time` blocks to a decay with these means in its first two blocks.
    pub(super) fn response(&self, time: f64, [first, second]: [f64; 2]) -> Option<Vec<f64>> {
        let decays = self.decays(time);
        let of_decay = |order: usize| first + second * self.turns[order] * decays[order];
        self.inverse(|order| self.weights[order] * decays[order].conj() * of_decay(order))
    }

    /// The output without the filter's responses to the ends of the record.
    pub(super) fn inner<'a>(&self, output: &'a [f64], time: f64) -> Option<&'a [f64]> {
        let ends = (END_TIMES * time) as usize + END_BLOCKS;
        output.get(ends..self.length.checked_sub(ends)?)
    }

    /// Blocks of four time constants, which contain the responses to a disturbance.
    pub(super) fn stretch(time: f64) -> usize {
        ((END_TIMES * time) as usize).max(END_BLOCKS)
    }

    fn decays(&self, time: f64) -> Vec<Complex<f64>> {
        let kept = (-1.0 / time).exp();
        self.turns.iter().map(|turn| 1.0 / (1.0 - kept * turn)).collect()
    }

    fn inverse(&self, bin: impl Fn(usize) -> Complex<f64>) -> Option<Vec<f64>> {
        let inverse = fourier::inverse(self.length);
        let last = self.transform.len() - 1;
        // The first and the last order of real values are real.
        let real_end = |order: usize| if order == last { bin(order).re.into() } else { bin(order) };
        let mut bins: Vec<Complex<f64>> = (0..=last).map(real_end).collect();
        let mut values = inverse.make_output_vec();
        inverse.process(&mut bins, &mut values).ok()?;
        Some(values)
    }
}

/// The means with their gaps filled; `None` if too many are missing.
fn filled(means: &[f64]) -> Option<Vec<f64>> {
    let present = means.iter().filter(|mean| mean.is_finite()).count();
    if ((means.len() - present) as f64) > MOST_EMPTY * means.len() as f64 {
        return None;
    }
    let mut latest = means.iter().copied().find(|mean| mean.is_finite())?;
    let fill = |mean: &f64| {
        latest = if mean.is_finite() { *mean } else { latest };
        latest
    };
    Some(means.iter().take(smooth_length(means.len())).map(fill).collect())
}

/// 1/density at each order, up to a factor; 0 at lines and if unknown.
fn weights(ordinates: &[f64]) -> Option<Vec<f64>> {
    let last = ordinates.len().checked_sub(1)?;
    let background = SlowBackground::fit(ordinates[..last].iter().copied().enumerate().skip(1))?;
    let noise: Vec<f64> = (0..ordinates.len()).map(|order| background.density(order as f64)).collect();
    let ratios: Vec<f64> = ordinates.iter().zip(&noise).map(|(ordinate, noise)| ordinate / noise).collect();
    let around = |at: usize, reach: usize| &ratios[at.saturating_sub(reach)..(at + reach + 1).min(ratios.len())];
    let weight = |(order, noise): (usize, &f64)| {
        if order < LOWEST || around(order, LINE_REACH).iter().any(|ratio| *ratio > LINE) {
            return 0.0;
        }
        let near = around(order, BAND_REACH);
        let level = near.iter().sum::<f64>() / near.len() as f64;
        1.0 / (noise * if level > BAND { level } else { 1.0 })
    };
    Some(noise.iter().enumerate().map(weight).collect())
}
