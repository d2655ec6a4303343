//! N by a spectrum: the density of the white noise far below the corner of the sensor's filter.
//!
//! The bands of Welch's spectrum are fitted by Whittle's likelihood with a sum of known shapes: white, flicker and
//! random-walk noise, each behind the filter, and the Markov processes of the channel's model. The densities are free, also to
//! be negative: a term that is not in the data then takes part in the estimate without bending it, and the intervals keep
//! their confidence where flicker noise or a walk is just not visible.
//!
//! A filter is assumed only where the data shows it. The candidates are no filter, the two cascaded averages of the part read
//! at their own rate with white noise (at least that of rounding) behind them, and samples that are correlated with as
//! many neighbours as a filter reaches over whose output is read more slowly. The one with the least `−2 ln L + p·ln n` is taken (G.
//! Schwarz, "Estimating the dimension of a model", Annals of Statistics 6, 1978), `p` being the number of densities, with
//! one more for the choice of the averages' length, and `n` the number of independent ordinates. Where the noise is white, a
//! second white term behind a filter leaves `ln L` where it is (twice its rise is χ² of one or two degrees of freedom), and
//! costs 2·ln n, about 20. A filter that halves the density at the highest frequency changes `ln L` by about 0.02·n.

use super::smooth_shape::{filter_gain, walk_amplitude};
use super::welch::Welch;
use super::whittle::{Sign, SpectralBand, fit_mixture, information, mixture_density};
use crate::bounds::BoundedEstimate;
use allan_core::term::{LowPass, Process};
use allan_core::{Model, NoiseTerm};
use nalgebra::DVector;
use std::f64::consts::PI;

/// Lowest point of the spectrum that is used: below, the removed mean and the window's skirts change a steep spectrum.
const LOWEST: usize = 3;
/// Half-width of the band that is left out around a line, in resolutions of the spectrum, and in bandwidths of a resonance.
const LINE_WIDTHS: f64 = 4.0;
/// Settings of the filter: two averages over `2^1 … 2^6` samples each.
const TAPS_LOG2: std::ops::RangeInclusive<u32> = 1..=6;
/// Independent ordinates in a band over those that [`Welch`] counts. It takes the correlations of neighbouring points and of
/// overlapping segments apart; neighbouring points of overlapping segments are correlated too. The power of white noise under
/// segments that overlap by half has the variance `2/n·⟨ω²⟩/⟨ω⟩²` for `ω = sin⁴ + cos⁴`, which is 2.111/n, where the product
/// of both is 1.944·1.056/n.
const OVERLAPPING_NEIGHBOURS: f64 = 1.944 * 1.056 / 2.111;
/// Least power gain of a filter at which bands take part in the estimate of N behind it. Where it suppresses the noise,
/// the spectrum is that of the rounding error, which is correlated where neighbouring samples differ by less than a count and
/// then no white noise. It takes part in the choice of the filter alone.
const PASSBAND: f64 = 0.1;
/// Most lags at which samples are correlated: 64 taps that are read every 9th time reach over 14.
const MOST_LAGS: u32 = 16;
/// Standard deviations by which the scatter of the bands around the fit must exceed what the fit predicts for the intervals
/// to be widened.
const SIGNIFICANT_MISFIT: f64 = 3.0;
/// 97.5 % quantile of the normal distribution.
const TWO_SIDED_95: f64 = 1.96;

/// Frequencies over which the gain of a low-pass filter is averaged.
const SAMPLED: u32 = 512;

/// What the sensor's filter makes of white noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FilterSpectrum {
    /// It stays white.
    Unfiltered,
    /// Two cascaded averages over so many samples each, with white noise added behind them.
    Bartlett {
        /// Samples of each average.
        taps: u32,
    },
    /// A low-pass filter of the second order, with white noise added behind it.
    LowPass(LowPass),
    /// Each sample is correlated with so many on either side.
    Correlated {
        /// The longest lag with a correlation, samples.
        lags: u32,
    },
}

/// N by a spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WhiteNoiseFit {
    /// N in unit·√s, with 95 % bounds: the root of half the one-sided density of the white noise at low frequencies, that of
    /// the rounding included.
    pub angle_random_walk: BoundedEstimate,
    /// The filter that the data shows.
    pub filter: FilterSpectrum,
    /// Standard deviation of a sample by this white noise, behind the filter.
    pub sample_deviation: f64,
    /// Factor by which the bounds were widened because the bands scatter more than the fit predicts; 1 where they do not.
    pub widened: f64,
}

/// Shapes that are known of a channel besides N, B and K.
pub struct KnownShapes<'a> {
    /// Its fitted model: lines and resonances are left out of the spectrum, Markov processes are fitted, and its low-pass filter of the
    /// second order, if it has one, is a candidate.
    pub model: &'a Model,
    /// Of a filter that is known to have been read at a rate below its own, the number of samples over which it reaches: these may be
    /// correlated even where that is too little to be seen.
    pub reach_of_slow_reading: Option<u32>,
}

/// Fits the white noise of `welch`; `None` where the shapes cannot be told apart, or the white noise not from none: its lower 95 %
/// bound is not above 0.
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

/// Whether a frequency is within `reach` Hz of a line of the model.
fn is_near_line(model: &Model, frequency: f64, reach: f64) -> bool {
    model.terms().iter().any(|term| match term.kind {
        NoiseTerm::Sinusoid(sinusoid) => (frequency - sinusoid.frequency).abs() < reach,
        NoiseTerm::Resonance(resonance) => {
            (frequency - resonance.frequency).abs() < reach + LINE_WIDTHS * resonance.bandwidth
        }
        _ => false,
    })
}

/// Averages of a spectrum over bands.
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

    /// The bands in which `is_kept` holds at the first point's frequency in Hz.
    fn filtered(&self, is_kept: impl Fn(f64) -> bool) -> Self {
        let all = self.points.iter().zip(&self.bands);
        let kept = all.filter(|(points, _)| is_kept(points[0] as f64 * self.resolution));
        let (points, bands) = kept.map(|(points, band)| (points.clone(), *band)).unzip();
        Self { points, bands, ..*self }
    }

    /// The mean of a density over each band, as the Hann window shows it: a point of the spectrum has 2/3 of the density
    /// at its own frequency and 1/6 of that at either neighbour's.
    fn averaged(&self, density: impl Fn(f64) -> f64) -> Vec<f64> {
        let last = self.points.iter().flatten().max().map_or(0, |last| last + 1);
        let at: Vec<f64> = (0..=last).map(|point| density(point as f64 * self.resolution)).collect();
        let shown = |&point: &usize| 2.0 / 3.0 * at[point] + (at[point - 1] + at[point + 1]) / 6.0;
        let mean = |band: &Vec<usize>| band.iter().map(shown).sum::<f64>() / band.len() as f64;
        self.points.iter().map(mean).collect()
    }
}

/// A fitted sum of shapes.
struct MixtureFit {
    filter: FilterSpectrum,
    /// Of each band the value of each shape for a coefficient of 1.
    bases: Vec<Vec<f64>>,
    coefficients: DVector<f64>,
    /// What a coefficient of 1 of each shape contributes to the density of white noise at 0 Hz, and to the variance of a
    /// sample, over the Nyquist frequency.
    at_zero: DVector<f64>,
    in_sample: DVector<f64>,
    /// `−2 ln L + p·ln n`.
    criterion: f64,
}

impl MixtureFit {
    /// `None` if the shapes cannot be told apart in these bands.
    fn new(bands: &Bands, filter: FilterSpectrum, model: &Model) -> Option<Self> {
        let period = bands.sample_period;
        let gain = |f: f64| match filter {
            FilterSpectrum::Bartlett { taps } => bartlett_gain(f, period, taps),
            FilterSpectrum::LowPass(filter) => filter.density(f, period) / filter.density(0.0, period),
            _ => 1.0,
        };
        // Each white shape with its contributions at 0 Hz and to the variance of a sample.
        let mut white: Vec<(Vec<f64>, f64, f64)> = Vec::new();
        match filter {
            FilterSpectrum::Unfiltered => white.push((bands.averaged(|_| 1.0), 1.0, 1.0)),
            FilterSpectrum::Bartlett { taps } => {
                // The variance of the triangular weights: (2L² + 1)/(3L³).
                let l = f64::from(taps);
                white.push((bands.averaged(gain), 1.0, (2.0 * l * l + 1.0) / (3.0 * l.powi(3))));
                white.push((bands.averaged(|_| 1.0), 1.0, 1.0));
            }
            FilterSpectrum::LowPass(_) => {
                // The mean of the gain up to the Nyquist frequency.
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

/// By how much more the bands scatter around the fit than it predicts, as a factor of the standard deviation; 1 where chance
/// explains it.
///
/// The deviance `2g·(P/S − 1 − ln(P/S))` of a band has the expectation `1 + 1/(6g)` for `g` ordinates, and about the variance 2.
fn misfit(bands: &[SpectralBand], modelled: impl Iterator<Item = f64>, parameters: usize) -> f64 {
    let of = |(band, s): (&SpectralBand, f64)| {
        let (g, ratio) = (band.ordinates, band.density / s);
        2.0 * g * (ratio - 1.0 - ratio.ln()) / (1.0 + 1.0 / (6.0 * g))
    };
    let deviance: f64 = bands.iter().zip(modelled).map(of).sum();
    let freedom = (bands.len() - parameters) as f64;
    if deviance > freedom + SIGNIFICANT_MISFIT * (2.0 * freedom).sqrt() { (deviance / freedom).sqrt() } else { 1.0 }
}

/// Power gain of two cascaded averages over `taps` samples each.
fn bartlett_gain(frequency: f64, sample_period: f64, taps: u32) -> f64 {
    filter_gain(frequency, sample_period, taps, (PI * frequency * sample_period).sin())
}
