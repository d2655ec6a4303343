//! Welch's estimate: periodograms of overlapping windowed stretches, averaged.

use super::shape::{Band, Shape};
use crate::grid::Grid;
use realfft::RealFftPlanner;
use std::f64::consts::PI;

/// Stretches may lack this share of their samples.
const MOST_MISSING: f64 = 0.5;

/// One-sided power spectral density by averaging over stretches of one length that overlap by half, each less its mean and
/// under a Hann window (P. Welch, 1967).
///
/// Missing samples count as the stretch's mean and are left out of the window's power, which is exact for white noise; of
/// red noise they spread the missing share over all frequencies.
#[derive(Debug, Clone, PartialEq)]
pub struct Welch {
    sample_period: f64,
    length: usize,
    stretches: usize,
    density: Vec<f64>,
}

impl Welch {
    /// With stretches of `length` samples, at least 8; `None` if the grid has no such stretch.
    #[must_use]
    pub fn of(grid: &Grid, length: usize) -> Option<Self> {
        if length < 8 {
            return None;
        }
        let window: Vec<f64> = (0..length).map(|at| (PI * (at as f64 + 0.5) / length as f64).sin().powi(2)).collect();
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        let (mut input, mut output) = (transform.make_input_vec(), transform.make_output_vec());
        let mut density = vec![0.0; output.len()];
        let mut stretches = 0;
        for stretch in grid.values().windows(length).step_by(length / 2) {
            let present = || stretch.iter().zip(&window).filter(|(value, _)| value.is_finite());
            let count = present().count();
            if ((length - count) as f64) > MOST_MISSING * length as f64 {
                continue;
            }
            let mean = present().map(|(value, _)| value).sum::<f64>() / count as f64;
            let power: f64 = present().map(|(_, weight)| weight * weight).sum();
            for ((slot, value), weight) in input.iter_mut().zip(stretch).zip(&window) {
                *slot = if value.is_finite() { (value - mean) * weight } else { 0.0 };
            }
            // Fails only for buffers of the wrong length, and these are its own.
            transform.process(&mut input, &mut output).ok()?;
            let scale = 2.0 * grid.sample_period() / power;
            for (sum, bin) in density.iter_mut().zip(&output) {
                *sum += scale * bin.norm_sqr();
            }
            stretches += 1;
        }
        for sum in &mut density {
            *sum /= stretches as f64;
        }
        (stretches > 0).then_some(Self { sample_period: grid.sample_period(), length, stretches, density })
    }

    /// Stretches that were averaged.
    #[must_use]
    pub fn stretches(&self) -> usize {
        self.stretches
    }

    /// Frequency in Hz and density in unit²/Hz, from 0 Hz to half the sample rate.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let spacing = 1.0 / (self.length as f64 * self.sample_period);
        self.density.iter().enumerate().map(move |(bin, &density)| (bin as f64 * spacing, density))
    }

    /// Independent ordinates that each point is worth: half its degrees of freedom.
    ///
    /// Stretches under a Hann window that overlap by half are correlated: `1/(1 + 2ρ²)` of them count, with `ρ = 1/6`.
    #[must_use]
    pub fn ordinates(&self) -> f64 {
        let count = self.stretches as f64;
        count / (1.0 + 2.0 * (1.0 - 1.0 / count) / 36.0)
    }

    /// Averages over bands up to an eighth of their frequency wide, without the first two points, which hold what the window
    /// spreads of the drift, and the last, and without those that `line` names.
    pub fn bands(&self, line: impl Fn(f64) -> bool) -> Vec<Band> {
        // Neighbours under a Hann window are correlated: 2/3 and 1/6 of the amplitude, so three points are worth less than two.
        const NEIGHBOURS: f64 = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);
        let points: Vec<(f64, f64)> = self.points().collect();
        // Narrow enough for the nulls of the part's filter.
        let widest = (points.len() / 256).max(1);
        let mut bands = Vec::new();
        let mut start = 2;
        while start + 1 < points.len() {
            let end = (start + (start / 8).clamp(1, widest)).min(points.len() - 1);
            let kept: Vec<f64> =
                points[start..end].iter().filter(|point| !line(point.0)).map(|point| point.1).collect();
            if !kept.is_empty() {
                let count = kept.len() as f64;
                bands.push(Band {
                    frequency: (points[start].0 + points[end - 1].0) / 2.0,
                    density: kept.iter().sum::<f64>() / count,
                    ordinates: self.ordinates() * (count / NEIGHBOURS).max(1.0),
                });
            }
            start = end;
        }
        bands
    }

    /// The smooth shape of the spectrum and the bands that it was fitted to.
    #[must_use]
    pub fn shape(&self, line: impl Fn(f64) -> bool) -> (Shape, Vec<Band>) {
        let bands = self.bands(line);
        (Shape::fit(&bands, self.sample_period), bands)
    }
}
