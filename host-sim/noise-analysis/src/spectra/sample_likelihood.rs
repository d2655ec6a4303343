//! The coefficients of a model by all samples: Whittle's likelihood of the spectrum of a record.
//!
//! ```text
//! spectrum in bands, model ─► likeliest densities ─► profile likelihood ─► 95 % bounds
//! ```
//!
//! The cosine coefficients of white noise with a random walk are independent, so that its likelihood is exact, without a taper. That of
//! flicker noise has the expected squares of its lowest coefficients, which [`flicker_leakage`] gives.
//!
//! A record of which only means are kept has coefficients with the density of the samples, weighted by the response of a mean and
//! with its aliases.

use super::cosine_spectrum::flicker_leakage;
use super::filtered_noise::FilteredNoise;
use super::sample_spectrum::{Place, SampleBand, SampleSpectrum};
use super::whittle::{
    Sign, SpectralBand, departure_by_chance, fit_mixture, fit_mixture_with, least_departure, mixture_density,
};
use crate::distributions::{NORMAL_975, upper_tail};
use crate::effects::findings::REFUTED;
use crate::minimum::reach;
use crate::samples::rounding::Rounding;
use allan_core::model::FittedTerm;
use allan_core::term::MovingAverageFilter;
use allan_core::{Model, NoiseTerm};
use std::f64::consts::PI;
use std::ops::Range;

/// Frequencies in a band at which the densities are evaluated, at most: of samples, and of means, which have no null of a filter.
const POINTS_IN_BAND: usize = 8;
const POINTS_IN_BAND_OF_MEANS: usize = 2;
/// Weights of a point of Welch's spectrum and of its neighbours in what the density is averaged over: the squares of the transform of a
/// Hann window.
const HANN: [f64; 3] = [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0];
/// Largest part of the density of filtered white noise that the ends of the record may leak.
const MOST_LEAKAGE: f64 = 0.1;
/// Least part of a density that a term has where the spectrum shows its shape.
const SHOWS_SHAPE: f64 = 0.1;
/// True if a term is a sinusoid, whose size is no density.
fn is_sinusoid(kind: &NoiseTerm) -> bool {
    matches!(kind, NoiseTerm::Sinusoid(_))
}

impl SampleSpectrum {
    /// `model`, whose lines the spectrum has not, with the coefficients that make the spectrum likeliest, and their bounds. Its shapes and
    /// its lines are kept.
    ///
    /// A bound is where the likelihood, with all other coefficients at their likeliest, is `exp(−1.96²/2)` of its maximum, and farther
    /// where the decimation of the filter is known between bounds. Flicker noise and random walks pass the filter; where white noise
    /// beside it is not one of the terms, that of rounding is, of known size. `None` if the model has a ramp, whose size is no density, or if more
    /// than a thousandth of the samples is interpolated.
    #[must_use]
    pub fn fitted(self, model: &Model) -> Option<Model> {
        let kinds: Vec<NoiseTerm> = model.terms().iter().map(|term| term.kind).collect();
        if kinds.contains(&NoiseTerm::RateRamp) || !self.has_all_noise() {
            return None;
        }
        let spectrum = if let Some(filter) = model.filter() { self.without_leakage(filter) } else { self };
        let likelihood = Likelihood::new(&spectrum, &kinds);
        let at_decimation = |decimation: f64| {
            let read = |kind: &NoiseTerm| match kind {
                NoiseTerm::Filtered(filter) => NoiseTerm::Filtered(MovingAverageFilter { decimation, ..*filter }),
                other => *other,
            };
            Likelihood::new(&spectrum, &kinds.iter().map(read).collect::<Vec<NoiseTerm>>()).densities
        };
        let bounds = decimation_bounds(model).filter(|(low, high)| low < high);
        let others: Vec<Vec<f64>> = bounds.into_iter().flat_map(|(low, high)| [low, high]).map(at_decimation).collect();
        let mut fitted = (0..).map(|term| {
            let (value, low, high) = likelihood.coefficient(term);
            let shifts = others.iter().map(|densities| densities[term].sqrt() - value);
            // The scatter of a coefficient with a known decimation, and that of the decimation, are independent.
            let (down, up) = shifts.fold((0.0_f64, 0.0_f64), |(down, up), shift| (down.min(shift), up.max(shift)));
            (value, (value - (value - low).hypot(down)).max(0.0), value + (high - value).hypot(up))
        });
        let terms = model.terms().iter().map(|term| {
            let mut term = *term;
            if !is_sinusoid(&term.kind) {
                (term.value, term.low, term.high) = fitted.next()?;
            }
            Some(term)
        });
        Some(Model::new(model.sample_period(), terms.collect::<Option<Vec<FittedTerm>>>()?))
    }

    /// Probability that the spectrum contradicts as much of the `model` term at the position `at`; `None` where so many samples are
    /// interpolated that this may be what contradicts it. The smaller one of
    ///
    /// - that of a departure from the terms of `model`, at their likeliest, where this one has a tenth of the density or more: Bartlett's test
    ///   ([`departure_by_chance`]);
    /// - where that is less than its lower bound, that of the likelihood ratio of this bound: the spectrum does not show the term.
    pub(crate) fn term_p_value(&self, model: &Model, at: usize) -> Option<f64> {
        let kinds: Vec<NoiseTerm> = model.terms().iter().map(|term| term.kind).collect();
        let likelihood = Likelihood::new(self, &kinds);
        let filtered = match kinds[..] {
            [NoiseTerm::Filtered(ref filter), ..] => Some(FilteredNoise::new(filter, self.period, 1)),
            _ => None,
        };
        let shown = kinds[..at].iter().filter(|kind| !is_sinusoid(kind)).count();
        let with_shape = |(band, basis): (&SampleBand, &Vec<f64>)| {
            let of_term = |at: usize| likelihood.densities[at] * basis[at];
            let density: f64 = (0..basis.len()).map(of_term).sum();
            let others = (density - of_term(0)) / likelihood.densities[0];
            let is_leakage = filtered.as_ref().is_some_and(|of| self.leaks_into(of, &band.place, others));
            let is_shown = !is_leakage && of_term(shown) >= SHOWS_SHAPE * density;
            is_shown.then_some((band.measured.density / density, band.measured.ordinates))
        };
        let bands: Vec<(f64, f64)> = self.bands.iter().zip(&likelihood.bases).filter_map(with_shape).collect();
        let ordinates: f64 = bands.iter().fold(0.0, |sum, (_, ordinates)| sum + ordinates);
        // An interpolated sample has no noise at some frequencies and all of it at others, which moves the cumulative sum by a quarter of
        // their share at most.
        let moved = self.interpolated / 4.0;
        let by_shape = (moved < 0.5 * least_departure(ordinates, REFUTED)).then(|| departure_by_chance(&bands));
        let least = model.terms()[at].low.powi(2);
        let is_less = self.has_all_noise() && likelihood.densities[shown] < least;
        let by_size = is_less.then(|| {
            2.0 * upper_tail(likelihood.deviate(shown, model.terms()[at].low, &mut likelihood.densities.clone()))
        });
        by_shape.into_iter().chain(by_size).reduce(f64::min)
    }

    /// Twice what the logarithm of the likelihood, with the terms of `one` model and their likeliest coefficients, is above that with the terms
    /// of the `other` one, which has as many.
    pub(crate) fn gain(&self, one: &Model, other: &Model) -> f64 {
        let objective = |model: &Model| {
            let kinds: Vec<NoiseTerm> = model.terms().iter().map(|term| term.kind).collect();
            Likelihood::new(self, &kinds).objective
        };
        2.0 * (objective(other) - objective(one))
    }

    /// The mean density of white noise behind a filter, or of none, in each band.
    pub(crate) fn shape(&self, filtered: NoiseTerm) -> Vec<f64> {
        let shapes = Shapes::new(self, &[filtered]);
        shapes.in_bands(shapes.all[0])
    }

    /// Its likelihood with the terms `kinds`, of which the first is noise behind a filter.
    pub(crate) fn behind(&self, kinds: &[NoiseTerm]) -> SpectrumBehindFilter {
        let as_measured = |band: &SpectralBand| band.ordinates * (band.density.max(f64::MIN_POSITIVE).ln() + 1.0);
        let saturated = self.bands.iter().map(|band| as_measured(&band.measured)).sum();
        SpectrumBehindFilter { likelihood: Likelihood::new(self, kinds), saturated }
    }

    /// Leaves out the bands into whose first, middle or last coefficient behind `filter` the ends of the record leak. Few
    /// numbers make these, so they scatter more than an average of independent coefficients.
    pub(crate) fn without_leakage(mut self, filter: MovingAverageFilter) -> Self {
        let filtered = FilteredNoise::new(&filter, self.period, 1);
        let bands = std::mem::take(&mut self.bands);
        self.bands = bands.into_iter().filter(|band| !self.leaks_into(&filtered, &band.place, 0.0)).collect();
        self
    }

    /// True if the ends of the record leak so much into the first, middle or last coefficient of a band where there is a density of `other`
    /// noise too, over that of the white noise before the filter.
    fn leaks_into(&self, filtered: &FilteredNoise, place: &Place, other: f64) -> bool {
        let leaks = |order: usize| {
            let density = filtered.density(order as f64 * self.resolution);
            (filtered.expected(order as f64, self.count) - density).abs() > MOST_LEAKAGE * (density + other)
        };
        match place {
            Place::Coefficients(at) if self.samples_per_mean == 1 => {
                [at.start + 1, at.start.midpoint(at.end) + 1, at.end].into_iter().any(leaks)
            }
            Place::Coefficients(_) | Place::Points(_) => false,
        }
    }
}

/// The likelihood of a spectrum behind a filter that is read at one rate or another. What else passes the filter has its gain at the rate
/// that it was made for: it is slow against any filter.
pub(crate) struct SpectrumBehindFilter {
    likelihood: Likelihood,
    /// The objective of a spectrum that is as measured.
    saturated: f64,
}

impl SpectrumBehindFilter {
    /// With a filter of this [shape](SampleSpectrum::shape) in place of the first term: twice what the logarithm of the likelihood, with the
    /// likeliest coefficients, is below that of a spectrum that is as measured. A true model has about the number of
    /// [bands](SampleSpectrum::bands).
    pub(crate) fn deviance(&self, filtered: &[f64]) -> f64 {
        2.0 * (self.likelihood.with_first(filtered) - self.saturated)
    }
}

/// The bounds of the decimation of the filter of a model.
fn decimation_bounds(model: &Model) -> Option<(f64, f64)> {
    let mut shapes = model.terms().iter().flat_map(|term| term.shape.named());
    shapes.find(|(name, _)| *name == "decimation").map(|(_, bounds)| bounds)
}

/// A shape that a spectrum is made of.
#[derive(Clone, Copy)]
enum Shape<'a> {
    /// That of a noise term for the coefficient 1.
    Term(NoiseTerm),
    /// That of rounding errors, whose size is known.
    Rounding(&'a Rounding),
}

/// The shapes that a spectrum is made of: the densities of noise terms, and of what rounding adds.
struct Shapes<'a> {
    spectrum: &'a SampleSpectrum,
    /// The terms, and rounding as the last one.
    all: Vec<Shape<'a>>,
    filter: Option<MovingAverageFilter>,
    /// White noise behind it, in samples and in means.
    filtered: Option<[FilteredNoise; 2]>,
}

impl<'a> Shapes<'a> {
    /// Sinusoids, whose frequencies the spectrum has not, are left out of `kinds`.
    fn new(spectrum: &'a SampleSpectrum, kinds: &[NoiseTerm]) -> Self {
        let filter = kinds.iter().find_map(|kind| match kind {
            NoiseTerm::Filtered(filter) => Some(*filter),
            _ => None,
        });
        // White noise has that of white errors in it.
        let has_white = filter.is_none() || kinds.contains(&NoiseTerm::AngleRandomWalk);
        let rounding = &spectrum.rounding;
        let is_apart = rounding.is_correlated() || (rounding.variance() > 0.0 && !has_white);
        let rounding = is_apart.then_some(Shape::Rounding(rounding));
        let noise = kinds.iter().filter(|kind| !is_sinusoid(kind));
        Self {
            spectrum,
            all: noise.map(|kind| Shape::Term(*kind)).chain(rounding).collect(),
            filtered: filter.map(|filter| {
                let noise = |samples_per_mean| FilteredNoise::new(&filter, spectrum.period, samples_per_mean);
                let samples = noise(1);
                let means =
                    if spectrum.samples_per_mean == 1 { samples.clone() } else { noise(spectrum.samples_per_mean) };
                [samples, means]
            }),
            filter,
        }
    }

    /// Position of what is known, the rounding.
    fn known(&self) -> Option<usize> {
        self.all.iter().position(|shape| matches!(shape, Shape::Rounding(_)))
    }

    /// The mean of a shape in each band.
    fn in_bands(&self, shape: Shape) -> Vec<f64> {
        let bands = || self.spectrum.bands.iter();
        let points = bands().filter_map(|band| match &band.place {
            Place::Points(points) => Some(points.first().copied().zip(points.last().copied())?),
            Place::Coefficients(_) => None,
        });
        let ends = points.reduce(|ends, next| (ends.0.min(next.0), ends.1.max(next.1)));
        let (lowest, highest) = ends.map_or((1, 0), |(lowest, highest)| (lowest - 1, highest + 1));
        let density = |point: usize| self.density(shape, point as f64 * self.spectrum.point_resolution);
        let densities: Vec<f64> = (lowest..=highest).map(density).collect();
        let at_point = |point: &usize| {
            let beside = &densities[point - 1 - lowest..];
            HANN.iter().zip(beside).map(|(weight, density)| weight * density).sum::<f64>()
        };
        let in_band = |band: &SampleBand| match &band.place {
            Place::Coefficients(indices) => self.at_coefficients(shape, indices),
            Place::Points(points) => points.iter().map(at_point).sum::<f64>() / points.len() as f64,
        };
        bands().map(in_band).collect()
    }

    /// The mean of a shape over coefficients of the cosine transform.
    fn at_coefficients(&self, shape: Shape, indices: &Range<usize>) -> f64 {
        let most = if self.spectrum.samples_per_mean == 1 { POINTS_IN_BAND } else { POINTS_IN_BAND_OF_MEANS };
        let points = indices.len().min(most);
        let order = |point: usize| {
            let part = (point as f64 + 0.5) / points as f64;
            0.5 + indices.start as f64 + part * indices.len() as f64
        };
        (0..points).map(|at| self.at_order(shape, order(at))).sum::<f64>() / points as f64
    }

    /// That of a shape at a coefficient of this order.
    fn at_order(&self, shape: Shape, order: f64) -> f64 {
        let density = || self.density_of_means(shape, order * self.spectrum.resolution);
        match (shape, &self.filtered) {
            (Shape::Term(NoiseTerm::Filtered(_)), Some([_, means])) => means.expected(order, self.spectrum.count),
            (Shape::Term(NoiseTerm::BiasInstability), _) => density() * flicker_leakage(order),
            _ => density(),
        }
    }

    /// The density of the means: what they let through, with its aliases.
    fn density_of_means(&self, shape: Shape, frequency: f64) -> f64 {
        let SampleSpectrum { samples_per_mean, period, .. } = *self.spectrum;
        let count = samples_per_mean as f64;
        let rate = 1.0 / (count * period);
        let alias = |order: f64| {
            let frequency = frequency + order * rate;
            let half = PI * frequency * period;
            let gain = if half == 0.0 { 1.0 } else { (count * half).sin() / (count * half.sin()) };
            gain * gain * self.density(shape, frequency)
        };
        match shape {
            _ if samples_per_mean == 1 => self.density(shape, frequency),
            // Means of means are means over their whole time.
            Shape::Term(kind @ NoiseTerm::BiasInstability) => {
                kind.process().density(frequency, 1.0 / rate) * self.gain(frequency)
            }
            Shape::Term(NoiseTerm::AngleRandomWalk) => 1.0,
            _ => (0..samples_per_mean).map(|order| alias(order as f64)).sum(),
        }
    }

    /// The density of the samples.
    fn density(&self, shape: Shape, frequency: f64) -> f64 {
        match shape {
            // One-sided there.
            Shape::Rounding(rounding) => rounding.density(frequency) / 2.0,
            Shape::Term(kind) => {
                if let (NoiseTerm::Filtered(_), Some([samples, _])) = (kind, &self.filtered) {
                    return samples.density(frequency);
                }
                let density = kind.process().density(frequency, self.spectrum.period);
                if kind.passes_filter() { density * self.gain(frequency) } else { density }
            }
        }
    }

    /// Power gain of the filter.
    fn gain(&self, frequency: f64) -> f64 {
        self.filter.map_or(1.0, |filter| filter.gain(frequency, self.spectrum.period))
    }
}

/// The likelihood of a spectrum around its maximum.
struct Likelihood {
    bands: Vec<SpectralBand>,
    /// The mean density of each shape in each band.
    bases: Vec<Vec<f64>>,
    /// At the maximum.
    densities: Vec<f64>,
    /// `Σ g·(ln S + P/S)` there.
    objective: f64,
    /// Position of the density that is known.
    known: Option<usize>,
}

impl Likelihood {
    fn new(spectrum: &SampleSpectrum, kinds: &[NoiseTerm]) -> Self {
        let shapes = Shapes::new(spectrum, kinds);
        let bands: Vec<SpectralBand> = spectrum.bands.iter().map(|band| band.measured).collect();
        let columns: Vec<Vec<f64>> = shapes.all.iter().map(|shape| shapes.in_bands(*shape)).collect();
        let row = |band: usize| columns.iter().map(|column| column[band]).collect();
        let bases: Vec<Vec<f64>> = (0..bands.len()).map(row).collect();
        let known = shapes.known();
        let mut densities = vec![0.0; shapes.all.len()];
        let mut objective = fit_mixture(&bands, &bases, Sign::NonNegative, &mut densities);
        if let Some(known) = known {
            densities[known] = 1.0;
            objective = fit_mixture_with(&bands, &bases, Sign::NonNegative, &[known], &mut densities);
        }
        Self { bands, bases, densities, objective, known }
    }

    /// The objective at its minimum with another shape in place of the `first` one.
    fn with_first(&self, first: &[f64]) -> f64 {
        let mut bases = self.bases.clone();
        bases.iter_mut().zip(first).for_each(|(basis, first)| basis[0] = *first);
        let held: Vec<usize> = self.known.into_iter().collect();
        fit_mixture_with(&self.bands, &bases, Sign::NonNegative, &held, &mut self.densities.clone())
    }

    /// The coefficient of a term and its 95 % bounds. A density is the square of a coefficient.
    fn coefficient(&self, term: usize) -> (f64, f64, f64) {
        let density = self.densities[term];
        let value = density.sqrt();
        let of_band = |(band, basis): (&SpectralBand, &Vec<f64>)| {
            band.ordinates * (basis[term] / mixture_density(basis, &self.densities)).powi(2)
        };
        let information: f64 = self.bands.iter().zip(&self.bases).map(of_band).sum();
        // The half-width if all other densities were known.
        let scatter = NORMAL_975 / information.sqrt();
        let (first_up, first_down) = ((density + scatter).sqrt(), (density - scatter).max(0.0).sqrt());
        // The deviate is nearly linear in the coefficient.
        let bound = |side: f64, first: f64, far: f64| {
            let mut densities = self.densities.clone();
            let deviate = |distance: f64| self.deviate(term, value + side * distance, &mut densities) / NORMAL_975;
            value + side * reach((first - value).abs(), far, deviate)
        };
        (value, if value > 0.0 { bound(-1.0, first_down, value) } else { 0.0 }, bound(1.0, first_up, f64::INFINITY))
    }

    /// The normal deviate at which the likelihood, with this coefficient of a term, is below its maximum; the other `densities` become the
    /// likeliest beside it, sought from where they are.
    fn deviate(&self, term: usize, coefficient: f64, densities: &mut [f64]) -> f64 {
        densities[term] = coefficient * coefficient;
        let held: Vec<usize> = std::iter::once(term).chain(self.known).collect();
        let objective = fit_mixture_with(&self.bands, &self.bases, Sign::NonNegative, &held, densities);
        (2.0 * (objective - self.objective).max(0.0)).sqrt()
    }
}
