//! Welch's estimate of a power spectral density.

use super::smooth_shape::{Filters, SpectralShape};
use super::whittle::SpectralBand;
use crate::samples::uniform_series::UniformSeries;
use fourier::Complex;
use fourier::RealToComplex;
use std::f64::consts::PI;
use std::sync::Arc;

/// Largest missing fraction of a segment.
const MOST_MISSING: f64 = 0.5;
/// Points in a row worth one under a Hann window: correlations of 2/3 and 1/6.
const NEIGHBOURS: f64 = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);

/// One-sided power spectral density, averaged over half-overlapping segments with their mean removed, under a Hann
/// window (P. Welch, IEEE Trans. Audio Electroacoust. 15, 1967).
///
/// Short gaps are interpolated ([`UniformSeries::interpolated`]), other missing samples are the segment's mean; neither
/// counts for the window's power. Exact for white noise; too high by the missing share for predictable noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Welch {
    sample_period: f64,
    length: usize,
    segments: usize,
    density: Vec<f64>,
}

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

    /// Adds a segment, unless more than half is missing; `filled` has short gaps interpolated.
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
        if self.transform.process(&mut self.input, &mut self.output).is_err() {
            return;
        }
        let scale = 2.0 * self.sample_period / power;
        for (sum, bin) in self.density.iter_mut().zip(&self.output) {
            *sum += scale * bin.norm_sqr();
        }
        self.segments += 1;
    }

    /// `None` without segments.
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

    /// The mean over estimates with one segment length; `None` without any.
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

    /// Independent ordinates per point: half its degrees of freedom. `n` half-overlapping segments (`ρ = 1/6`) count as
    /// `n/(1 + 2ρ²)`.
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

    /// Averages over bands of up to an eighth of their frequency, without the ends and the frequencies (Hz) of lines.
    pub(crate) fn bands(&self, is_line: impl Fn(f64) -> bool) -> Vec<SpectralBand> {
        self.band_points(2, is_line).iter().map(|band| self.average(band)).collect()
    }

    /// The points of those bands from `lowest` on.
    pub(crate) fn band_points(&self, lowest: usize, is_line: impl Fn(f64) -> bool) -> Vec<Vec<usize>> {
        let count = self.density.len();
        // Narrow enough for a filter's nulls.
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

    pub(crate) fn average(&self, points: &[usize]) -> SpectralBand {
        let count = points.len() as f64;
        let middle = points.first().zip(points.last()).map_or(0.0, |(first, last)| (first + last) as f64 / 2.0);
        SpectralBand {
            frequency: middle * self.resolution(),
            density: points.iter().map(|&point| self.density[point]).sum::<f64>() / count,
            ordinates: self.ordinates() * (count / NEIGHBOURS).max(1.0),
        }
    }

    /// The smooth shape without lines, and its bands.
    #[must_use]
    pub fn shape(&self, is_line: impl Fn(f64) -> bool) -> (SpectralShape, Vec<SpectralBand>) {
        let bands = self.bands(is_line);
        (SpectralShape::fit(&bands, self.sample_period, Filters::ReadEvery(1)), bands)
    }
}
