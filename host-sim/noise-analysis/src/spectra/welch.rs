//! Welch's estimate of a power spectral density: the average of the periodograms of overlapping windowed segments.

use super::smooth_shape::{Filters, SpectralShape};
use super::whittle::SpectralBand;
use crate::samples::uniform_series::UniformSeries;
use fourier::Complex;
use fourier::RealToComplex;
use std::f64::consts::PI;
use std::sync::Arc;

/// A segment with more than this fraction of its samples missing is left out.
const MOST_MISSING: f64 = 0.5;
/// So many points in a row are worth one: neighbouring points under a Hann window correlate by 2/3 at distance 1 and by 1/6
/// at distance 2, and their squares add.
const NEIGHBOURS: f64 = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);

/// One-sided power spectral density, averaged over segments of one length that overlap by half, each with its mean removed
/// and under a Hann window (P. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Trans.
/// Audio Electroacoust. 15, 1967).
///
/// Samples of short gaps are interpolated ([`UniformSeries::interpolated`]), others replaced by the segment's mean, and all
/// are left out of the window's power. For white noise that is exact; where noise is predictable from sample to sample, as
/// behind a filter, the density is too high by the share of the missing samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Welch {
    sample_period: f64,
    length: usize,
    segments: usize,
    density: Vec<f64>,
}

/// Sums the spectra of segments.
pub(super) struct WelchSum {
    sample_period: f64,
    window: Vec<f64>,
    transform: Arc<dyn RealToComplex<f64>>,
    input: Vec<f64>,
    output: Vec<Complex<f64>>,
    density: Vec<f64>,
    segments: usize,
}

impl WelchSum {
    /// For segments of `length` samples.
    pub(super) fn new(sample_period: f64, length: usize) -> Self {
        let transform = fourier::forward(length);
        let (input, output) = (transform.make_input_vec(), transform.make_output_vec());
        Self {
            sample_period,
            window: (0..length).map(|at| (PI * (at as f64 + 0.5) / length as f64).sin().powi(2)).collect(),
            transform,
            density: vec![0.0; output.len()],
            input,
            output,
            segments: 0,
        }
    }

    /// Adds a segment, unless more than half of its samples are missing; `filled` are the same samples with short gaps interpolated.
    pub(super) fn add(&mut self, segment: &[f64], filled: &[f64]) {
        let present = || segment.iter().zip(&self.window).filter(|(value, _)| value.is_finite());
        let count = present().count();
        if ((segment.len() - count) as f64) > MOST_MISSING * segment.len() as f64 {
            return;
        }
        let mean = present().map(|(value, _)| value).sum::<f64>() / count as f64;
        let power: f64 = present().map(|(_, weight)| weight * weight).sum();
        for ((slot, value), weight) in self.input.iter_mut().zip(filled).zip(&self.window) {
            *slot = if value.is_finite() { (value - mean) * weight } else { 0.0 };
        }
        // An error means buffers of the wrong length; these are the planner's own.
        if self.transform.process(&mut self.input, &mut self.output).is_err() {
            return;
        }
        let scale = 2.0 * self.sample_period / power;
        for (sum, bin) in self.density.iter_mut().zip(&self.output) {
            *sum += scale * bin.norm_sqr();
        }
        self.segments += 1;
    }

    /// The mean over the segments; `None` without any.
    pub(super) fn mean(self) -> Option<Welch> {
        let Self { sample_period, window, mut density, segments, .. } = self;
        density.iter_mut().for_each(|sum| *sum /= segments as f64);
        (segments > 0).then_some(Welch { sample_period, length: window.len(), segments, density })
    }
}

impl Welch {
    /// Estimates the density from segments of `length` samples, at least 8; `None` if the series has no such segment.
    #[must_use]
    pub fn estimate(series: &UniformSeries, length: usize) -> Option<Self> {
        if length < 8 {
            return None;
        }
        let mut sum = WelchSum::new(series.sample_period(), length);
        let (filled, _) = series.interpolated();
        let filled = filled.values().windows(length).step_by(length / 2);
        for (segment, filled) in series.values().windows(length).step_by(length / 2).zip(filled) {
            sum.add(segment, filled);
        }
        sum.mean()
    }

    /// The mean over the segments of several estimates with segments of one length; `None` of no estimate.
    pub(crate) fn joined<'a>(estimates: impl IntoIterator<Item = &'a Self>) -> Option<Self> {
        estimates.into_iter().cloned().reduce(|mut joined, other| {
            let segments = joined.segments + other.segments;
            let weight = other.segments as f64 / segments as f64;
            joined.density.iter_mut().zip(&other.density).for_each(|(mean, of)| *mean += weight * (of - *mean));
            Self { segments, ..joined }
        })
    }

    /// Number of segments that were averaged.
    #[must_use]
    pub fn segments(&self) -> usize {
        self.segments
    }

    /// Frequency in Hz and density in unit²/Hz, from 0 Hz to half the sample rate.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let spacing = self.resolution();
        self.density.iter().enumerate().map(move |(bin, &density)| (bin as f64 * spacing, density))
    }

    /// Number of independent ordinates that each point is worth: half its degrees of freedom.
    ///
    /// Segments under a Hann window that overlap by half are correlated with `ρ = 1/6`, so that `n` of them count as
    /// `n/(1 + 2ρ²)` for large `n`.
    #[must_use]
    pub fn ordinates(&self) -> f64 {
        let count = self.segments as f64;
        count / (1.0 + 2.0 * (1.0 - 1.0 / count) / 36.0)
    }

    /// Distance of two points of the spectrum, Hz.
    #[must_use]
    pub fn resolution(&self) -> f64 {
        1.0 / (self.length as f64 * self.sample_period)
    }

    /// Seconds between samples.
    #[must_use]
    pub fn sample_period(&self) -> f64 {
        self.sample_period
    }

    /// Averages over bands of up to an eighth of their frequency, without the frequencies in Hz for which `is_line` holds.
    ///
    /// The first two points are left out, because the window spreads drift over them, and the last one, which has half
    /// the degrees of freedom.
    pub(crate) fn bands(&self, is_line: impl Fn(f64) -> bool) -> Vec<SpectralBand> {
        self.band_points(2, is_line).iter().map(|band| self.average(band)).collect()
    }

    /// The points of the spectrum from `lowest` on, by bands of up to an eighth of their frequency, without those at whose
    /// frequency in Hz `is_line` holds, and without the last one.
    pub(crate) fn band_points(&self, lowest: usize, is_line: impl Fn(f64) -> bool) -> Vec<Vec<usize>> {
        let count = self.density.len();
        // Narrow enough to resolve the nulls of a filter.
        let widest = (count / 256).max(1);
        let mut bands = Vec::new();
        let mut start = lowest;
        while start + 1 < count {
            let end = (start + (start / 8).clamp(1, widest)).min(count - 1);
            let kept: Vec<usize> = (start..end).filter(|&bin| !is_line(bin as f64 * self.resolution())).collect();
            if !kept.is_empty() {
                bands.push(kept);
            }
            start = end;
        }
        bands
    }

    /// The average over neighbouring points.
    pub(crate) fn average(&self, points: &[usize]) -> SpectralBand {
        let count = points.len() as f64;
        let middle = points.first().zip(points.last()).map_or(0.0, |(first, last)| (first + last) as f64 / 2.0);
        SpectralBand {
            frequency: middle * self.resolution(),
            density: points.iter().map(|&point| self.density[point]).sum::<f64>() / count,
            ordinates: self.ordinates() * (count / NEIGHBOURS).max(1.0),
        }
    }

    /// The smooth shape of the spectrum without its lines, and the bands that it was fitted to.
    #[must_use]
    pub fn shape(&self, is_line: impl Fn(f64) -> bool) -> (SpectralShape, Vec<SpectralBand>) {
        let bands = self.bands(is_line);
        (SpectralShape::fit(&bands, self.sample_period, Filters::ReadEvery(1)), bands)
    }
}
