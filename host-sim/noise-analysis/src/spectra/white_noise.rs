//! N by a spectrum: the white density far below the corner of the sensor's filter.
//!
//! Bands of Welch's spectrum are fitted by Whittle's likelihood with white, flicker and random-walk noise behind the
//! filter, and the model's Markov processes. Densities may be negative, so that intervals keep their confidence. The
//! filter (none, the part's own, or a correlation over several samples) has the least `−2 ln L + p·ln n` (G. Schwarz,
//! Annals of Statistics 6, 1978).

use super::smooth_shape::{filter_gain, walk_amplitude};
use super::welch::Welch;
use super::whittle::{Sign, SpectralBand, fit_mixture, information, mixture_density};
use crate::bounds::BoundedEstimate;
use allan_core::term::{LowPass, Process};
use allan_core::{Model, NoiseTerm};
use nalgebra::DVector;
use std::f64::consts::PI;

/// Lowest point in use; below, mean and window change a steep spectrum.
const LOWEST: usize = 3;
/// Half-width of a line's band, in resolutions, and in bandwidths of a resonance.
const LINE_WIDTHS: f64 = 4.0;
/// Settings of the filter: two averages over `2^1 … 2^6` samples.
const TAPS_LOG2: std::ops::RangeInclusive<u32> = 1..=6;
/// Independent ordinates in a band over those of [`Welch`]: half-overlapping segments have 2.111/n.
const OVERLAPPING_NEIGHBOURS: f64 = 1.944 * 1.056 / 2.111;
/// Least power gain of bands in the estimate of N; below it the spectrum is that of the rounding.
const PASSBAND: f64 = 0.1;
/// Most lags of correlated samples: 64 taps read every 9th time reach over 14.
const MOST_LAGS: u32 = 16;
/// Standard deviations of excess scatter that widen the intervals.
const SIGNIFICANT_MISFIT: f64 = 3.0;
/// 97.5 % quantile of the normal distribution.
const TWO_SIDED_95: f64 = 1.96;

/// Frequencies of the mean gain of a low-pass filter.
const SAMPLED: u32 = 512;

/// White noise behind the sensor's filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FilterSpectrum {
    Unfiltered,
    /// Two cascaded averages, and white noise behind them.
    Bartlett {
        taps: u32,
    },
    /// A second-order low-pass filter, and white noise behind it.
    LowPass(LowPass),
    /// Correlated with samples on either side.
    Correlated {
        /// The longest lag with a correlation, samples.
        lags: u32,
    },
}

/// N by a spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WhiteNoiseFit {
    /// N in unit·√s, with 95 % bounds, rounding included.
    pub angle_random_walk: BoundedEstimate,
    pub filter: FilterSpectrum,
    /// Standard deviation of a sample by this white noise, behind the filter.
    pub sample_deviation: f64,
    /// Factor on the bounds by excess scatter of the bands; 1 without it.
    pub widened: f64,
}

/// Known shapes besides N, B and K.
pub struct KnownShapes<'a> {
    /// Fitted model: its lines are left out, its Markov processes fitted, its low-pass filter is a candidate.
    pub model: &'a Model,
    /// Reach, samples, of a filter that is known to be read slowly.
    pub reach_of_slow_reading: Option<u32>,
}

/// Fits the white noise of `welch`; `None` if shapes cannot be told apart, or the lower 95 % bound is not above 0.
#[must_use]
pub fn fit_white_noise(welch: &Welch, known: &KnownShapes) -> Option<WhiteNoiseFit> {
    let lines = |frequency: f64| is_near_line(known.model, frequency, LINE_WIDTHS * welch.resolution());
    let bands = Bands::new(welch, lines);
    let reach = known.reach_of_slow_reading.unwrap_or(1).clamp(1, MOST_LAGS);
    let correlated = (1..=reach).map(|lags| FilterSpectrum::Correlated { lags });
    let unfiltered = known.reach_of_slow_reading.is_none().then_some(FilterSpectrum::Unfiltered);
    let bartlett = TAPS_LOG2.map(|log2| FilterSpectrum::Bartlett { taps: 1 << log2 });
    let low_pass = known.model.terms().iter().find_map(|term| match term.kind {
        NoiseTerm::LowPass(filter) => Some(FilterSpectrum::LowPass(filter)),
        _ => None,
    });
    let candidates = unfiltered.into_iter().chain(correlated).chain(bartlett).chain(low_pass);
    let fits = candidates.filter_map(|filter| MixtureFit::new(&bands, filter, known.model));
    let likeliest = fits.min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
    let FilterSpectrum::Bartlett { taps } = likeliest.filter else { return likeliest.white_noise(&bands) };
    let passband = bands.filtered(|frequency| bartlett_gain(frequency, welch.sample_period(), taps) > PASSBAND);
    MixtureFit::new(&passband, likeliest.filter, known.model)?.white_noise(&passband)
}

fn is_near_line(model: &Model, frequency: f64, reach: f64) -> bool {
    model.terms().iter().any(|term| match term.kind {
        NoiseTerm::Sinusoid(sinusoid) => (frequency - sinusoid.frequency).abs() < reach,
        NoiseTerm::Resonance(resonance) => {
            (frequency - resonance.frequency).abs() < reach + LINE_WIDTHS * resonance.bandwidth
        }
        _ => false,
    })
}

struct Bands {
    sample_period: f64,
    resolution: f64,
    /// Points of the spectrum in each band.
    points: Vec<Vec<usize>>,
    bands: Vec<SpectralBand>,
}

impl Bands {
    fn new(welch: &Welch, is_line: impl Fn(f64) -> bool) -> Self {
        let counted = |points: &Vec<usize>| {
            let band = welch.average(points);
            SpectralBand { ordinates: OVERLAPPING_NEIGHBOURS * band.ordinates, ..band }
        };
        let bands = welch.band_points(LOWEST, is_line).into_iter().map(|points| (counted(&points), points));
        let (bands, points) = bands.filter(|(band, _)| band.density > 0.0).unzip();
        Self { sample_period: welch.sample_period(), resolution: welch.resolution(), points, bands }
    }

    /// The bands for which `is_kept` holds at the first point, Hz.
    fn filtered(&self, is_kept: impl Fn(f64) -> bool) -> Self {
        let all = self.points.iter().zip(&self.bands);
        let kept = all.filter(|(points, _)| is_kept(points[0] as f64 * self.resolution));
        let (points, bands) = kept.map(|(points, band)| (points.clone(), *band)).unzip();
        Self { points, bands, ..*self }
    }

    /// Mean of a density over each band under the Hann window: 2/3 of a point, 1/6 of either neighbour.
    fn averaged(&self, density: impl Fn(f64) -> f64) -> Vec<f64> {
        let last = self.points.iter().flatten().max().map_or(0, |last| last + 1);
        let at: Vec<f64> = (0..=last).map(|point| density(point as f64 * self.resolution)).collect();
        let shown = |&point: &usize| 2.0 / 3.0 * at[point] + (at[point - 1] + at[point + 1]) / 6.0;
        let mean = |band: &Vec<usize>| band.iter().map(shown).sum::<f64>() / band.len() as f64;
        self.points.iter().map(mean).collect()
    }
}

struct MixtureFit {
    filter: FilterSpectrum,
    /// Per band, each shape for a coefficient of 1.
    bases: Vec<Vec<f64>>,
    coefficients: DVector<f64>,
    /// Per shape, the white density at 0 Hz, and the variance of a sample over the Nyquist frequency.
    at_zero: DVector<f64>,
    in_sample: DVector<f64>,
    /// `−2 ln L + p·ln n`.
    criterion: f64,
}

impl MixtureFit {
    /// `None` if the shapes cannot be told apart.
    fn new(bands: &Bands, filter: FilterSpectrum, model: &Model) -> Option<Self> {
        let period = bands.sample_period;
        let gain = |f: f64| match filter {
            FilterSpectrum::Bartlett { taps } => bartlett_gain(f, period, taps),
            FilterSpectrum::LowPass(filter) => filter.density(f, period) / filter.density(0.0, period),
            _ => 1.0,
        };
        // White shapes with density at 0 Hz and variance of a sample.
        let mut white: Vec<(Vec<f64>, f64, f64)> = Vec::new();
        match filter {
            FilterSpectrum::Unfiltered => white.push((bands.averaged(|_| 1.0), 1.0, 1.0)),
            FilterSpectrum::Bartlett { taps } => {
                // Variance of triangular weights: (2L² + 1)/(3L³).
                let l = f64::from(taps);
                white.push((bands.averaged(gain), 1.0, (2.0 * l * l + 1.0) / (3.0 * l.powi(3))));
                white.push((bands.averaged(|_| 1.0), 1.0, 1.0));
            }
            FilterSpectrum::LowPass(_) => {
                let in_sample =
                    (0..SAMPLED).map(|at| gain((f64::from(at) + 0.5) / f64::from(SAMPLED) * 0.5 / period)).sum::<f64>();
                white.push((bands.averaged(gain), 1.0, in_sample / f64::from(SAMPLED)));
                white.push((bands.averaged(|_| 1.0), 1.0, 1.0));
            }
            FilterSpectrum::Correlated { lags } => {
                white.push((bands.averaged(|_| 1.0), 1.0, 1.0));
                for lag in 1..=lags {
                    let wave = |f: f64| 2.0 * (2.0 * PI * f * period * f64::from(lag)).cos();
                    white.push((bands.averaged(wave), 2.0, 0.0));
                }
            }
        }
        let coloured =
            [bands.averaged(|f| gain(f) / f), bands.averaged(|f| gain(f) * walk_amplitude(f, period).powi(2))];
        let markov = model.terms().iter().filter(|term| matches!(term.kind, NoiseTerm::Markov(_)));
        let markov = markov.map(|term| bands.averaged(|f| gain(f) * term.kind.process().density(f, period)));
        let count = white.len();
        let columns: Vec<Vec<f64>> = white.iter().map(|shape| shape.0.clone()).chain(coloured).chain(markov).collect();
        let padded = |values: Vec<f64>| {
            DVector::from_iterator(columns.len(), values.into_iter().chain(std::iter::repeat(0.0)).take(columns.len()))
        };
        let (at_zero, in_sample) =
            (padded(white.iter().map(|shape| shape.1).collect()), padded(white.iter().map(|shape| shape.2).collect()));
        if bands.points.len() <= columns.len() {
            return None;
        }
        let row = |band: usize| columns.iter().map(|column| column[band]).collect();
        let bases: Vec<Vec<f64>> = (0..bands.points.len()).map(row).collect();
        let mut coefficients = DVector::zeros(columns.len());
        let objective = fit_mixture(&bands.bands, &bases, Sign::Any, coefficients.as_mut_slice());
        let parameters = columns.len()
            + usize::from(count == 2 && matches!(filter, FilterSpectrum::Bartlett { .. } | FilterSpectrum::LowPass(_)));
        let ordinates: f64 = bands.bands.iter().map(|band| band.ordinates).sum();
        let criterion = 2.0 * objective + parameters as f64 * ordinates.ln();
        Some(Self { filter, bases, coefficients, at_zero, in_sample, criterion })
    }

    fn white_noise(&self, bands: &Bands) -> Option<WhiteNoiseFit> {
        let coefficients = self.coefficients.as_slice();
        let modelled = self.bases.iter().map(|basis| mixture_density(basis, coefficients));
        let widened = misfit(&bands.bands, modelled, coefficients.len());
        let density = self.at_zero.dot(&self.coefficients);
        let along = information(&bands.bands, &self.bases, coefficients).cholesky()?.solve(&self.at_zero);
        let reach = TWO_SIDED_95 * widened * self.at_zero.dot(&along).sqrt();
        if density - reach <= 0.0 {
            return None;
        }
        let coefficient = |density: f64| (density / 2.0).sqrt();
        let nyquist = 0.5 / bands.sample_period;
        Some(WhiteNoiseFit {
            angle_random_walk: BoundedEstimate {
                value: coefficient(density),
                low: coefficient(density - reach),
                high: coefficient(density + reach),
            },
            filter: self.filter,
            sample_deviation: (nyquist * self.in_sample.dot(&self.coefficients)).max(0.0).sqrt(),
            widened,
        })
    }
}

/// Factor on the standard deviations by excess scatter around the fit; 1 if chance explains it. Deviance `2g·(P/S − 1 −
/// ln(P/S))` of g ordinates: mean `1 + 1/(6g)`, variance about 2.
fn misfit(bands: &[SpectralBand], modelled: impl Iterator<Item = f64>, parameters: usize) -> f64 {
    let of = |(band, s): (&SpectralBand, f64)| {
        let (g, ratio) = (band.ordinates, band.density / s);
        2.0 * g * (ratio - 1.0 - ratio.ln()) / (1.0 + 1.0 / (6.0 * g))
    };
    let deviance: f64 = bands.iter().zip(modelled).map(of).sum();
    let freedom = (bands.len() - parameters) as f64;
    if deviance > freedom + SIGNIFICANT_MISFIT * (2.0 * freedom).sqrt() { (deviance / freedom).sqrt() } else { 1.0 }
}

fn bartlett_gain(frequency: f64, sample_period: f64, taps: u32) -> f64 {
    filter_gain(frequency, sample_period, taps, (PI * frequency * sample_period).sin())
}
