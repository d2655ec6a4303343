//! The whole record along a frequency that runs evenly, as one coherent sum.
//!
//! Turned back by its phase, a line is a constant: the matched filter, more powerful than sums of segments (P. Brady
//! and T. Creighton, Phys. Rev. D 61, 2000).

use crate::samples::uniform_series::UniformSeries;
use fourier::Complex;
use std::f64::consts::{PI, TAU};

/// Blocks per segment: half their rate is twice its resolution.
const BLOCKS_OF_SEGMENT: usize = 2;
/// Largest error of the first frequency and of the run, in resolutions of a segment.
const FREQUENCY_OFF: f64 = 0.625;
const RUN_OFF: f64 = 0.75;
/// Step of the run, in resolutions of the record; 2 % of the power is lost between two.
const RUN_STEP: f64 = 2.0;
const PADDING: usize = 2;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CoherentTrack {
    /// At the beginning and at the end of the record, Hz.
    pub frequencies: [f64; 2],
    /// Squared sum over that of the noise around: exponential of mean 1 without a line.
    pub power: f64,
    /// Frequencies and runs of a complete search.
    pub trials: f64,
}

impl CoherentTrack {
    /// The largest sum near a line between two `frequencies`, Hz, that the spectra of `segments` have shown.
    pub(super) fn near(series: &UniformSeries, frequencies: [f64; 2], segments: usize) -> Option<Self> {
        let count = BLOCKS_OF_SEGMENT * segments;
        let size = series.values().len() / count;
        let length = size * count;
        let duration_s = length as f64 * series.sample_period();
        let [first, last] = frequencies.map(|frequency| frequency * duration_s);
        let blocks = turned_back(&series.values()[..length], size, first, last - first);
        let transform = fourier::forward(PADDING * count);
        let (mut input, mut of_real, mut of_imaginary) =
            (transform.make_input_vec(), transform.make_output_vec(), transform.make_output_vec());
        let reach = (FREQUENCY_OFF * (PADDING * segments) as f64) as usize;
        let steps = (RUN_OFF * segments as f64 / RUN_STEP) as i32;
        let mut best: Option<Self> = None;
        for run in (-steps..=steps).map(|step| RUN_STEP * f64::from(step)) {
            let turned: Vec<Complex<f64>> = blocks
                .iter()
                .enumerate()
                .map(|(at, block)| {
                    let time = (at as f64 + 0.5) / count as f64;
                    block * Complex::cis(-PI * run * time * time)
                })
                .collect();
            let mut spectrum_of = |part: fn(&Complex<f64>) -> f64, output: &mut [Complex<f64>]| {
                input.fill(0.0);
                input.iter_mut().zip(&turned).for_each(|(slot, value)| *slot = part(value));
                transform.process(&mut input, output).ok()
            };
            spectrum_of(|value| value.re, &mut of_real)?;
            spectrum_of(|value| value.im, &mut of_imaginary)?;
            let turn = Complex::new(0.0, 1.0);
            // A complex series from the spectra of its parts.
            let power = |offset: i32| {
                let at = offset.unsigned_abs() as usize;
                let (real, imaginary) = (of_real[at], of_imaginary[at]);
                let sum = if offset < 0 { real.conj() + turn * imaginary.conj() } else { real + turn * imaginary };
                // A block has sin(πx)/(πx) of a frequency x times its rate.
                let phase = PI * at as f64 / (PADDING * count) as f64;
                sum.norm_sqr() * if at == 0 { 1.0 } else { (phase / phase.sin()).powi(2) }
            };
            let reach = reach as i32;
            let mean = (-reach..=reach).map(power).sum::<f64>() / f64::from(2 * reach + 1);
            let largest = (-reach..=reach).map(|offset| (power(offset), offset)).max_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((largest, offset)) = largest.filter(|(largest, _)| *largest > 0.0)
                && best.is_none_or(|best| largest / mean > best.power)
            {
                let begins = first + f64::from(offset) / PADDING as f64;
                let ends = begins + last - first + run;
                best = Some(Self {
                    frequencies: [begins, ends].map(|turns| turns / duration_s),
                    power: largest / mean,
                    // Half as many frequencies as samples; half a resolution per segment up or down.
                    trials: 0.5 * length as f64 * (segments * segments) as f64,
                });
            }
        }
        best
    }

    /// Probability of such a sum anywhere by chance.
    pub(super) fn by_chance(&self) -> f64 {
        self.trials * (-self.power).exp()
    }
}

/// Sums over blocks of `size` values, turned back by a line with `first` turns a record, and `run` more at the end.
fn turned_back(values: &[f64], size: usize, first: f64, run: f64) -> Vec<Complex<f64>> {
    let step = 1.0 / values.len() as f64;
    let mut phasor = Complex::cis(-TAU * (0.5 * first * step + 0.125 * run * step * step));
    let mut turn = Complex::cis(-TAU * (first + run * step) * step);
    let change = Complex::cis(-TAU * run * step * step);
    let mut next = |sum: Complex<f64>, value: &f64| {
        let sum = if value.is_finite() { sum + phasor * value } else { sum };
        phasor *= turn;
        turn *= change;
        sum
    };
    values.chunks_exact(size).map(|block| block.iter().fold(Complex::ZERO, &mut next)).collect()
}
