//! The smooth density of slow noise in block means: white, a random walk, and Markov processes.

use super::whittle::{Sign, SpectralBand, fit_mixture, mixture_density};

/// Corner of the slowest Markov process, periods per record; doubled for each further one.
const LEAST_CORNER: f64 = 2.0;

/// A sum of `TERMS` densities.
pub(super) struct SlowBackground<const TERMS: usize> {
    densities: [f64; TERMS],
}

impl<const TERMS: usize> SlowBackground<TERMS> {
    /// Fitted to `bands`, in periods per record; `None` if all terms are 0.
    pub(super) fn fit(bands: &[SpectralBand]) -> Option<Self> {
        let bases: Vec<[f64; TERMS]> = bands.iter().map(|band| Self::basis(band.frequency)).collect();
        let mut densities = [0.0; TERMS];
        fit_mixture(bands, &bases, Sign::NonNegative, &mut densities);
        (densities.iter().sum::<f64>() > 0.0).then_some(Self { densities })
    }

    pub(super) fn density(&self, order: f64) -> f64 {
        mixture_density(&Self::basis(order), &self.densities)
    }

    fn basis(order: f64) -> [f64; TERMS] {
        std::array::from_fn(|term| match term {
            0 => 1.0,
            1 => 1.0 / (order * order),
            term => {
                let corner = LEAST_CORNER * f64::from(1_u32 << (term - 2));
                1.0 / (1.0 + (order / corner).powi(2))
            }
        })
    }
}
