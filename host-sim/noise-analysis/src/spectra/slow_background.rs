//! The smooth density of slow noise in block means: white, a random walk, and Markov processes.

use super::whittle::{Sign, SpectralBand, fit_mixture, mixture_density};

/// White noise, a random walk and ten Markov processes.
const TERMS: usize = 12;
/// Corner of the slowest Markov process, periods per record; doubled for each further one.
const LEAST_CORNER: f64 = 2.0;

pub(super) struct SlowBackground {
    densities: [f64; TERMS],
}

impl SlowBackground {
    /// Fitted to ordinates in ascending order, by their numbers of periods per record, in bands an eighth of their frequency wide; `None`
    /// if the bands are fewer than the terms, or all terms are 0.
    pub(super) fn fit(ordinates: impl Iterator<Item = (usize, f64)>) -> Option<Self> {
        let mut bands: Vec<(usize, SpectralBand)> = Vec::new();
        for (order, density) in ordinates {
            match bands.last_mut() {
                Some((first, band)) if order < *first + *first / 8 + 1 => {
                    band.ordinates += 1.0;
                    band.frequency += (order as f64 - band.frequency) / band.ordinates;
                    band.density += (density - band.density) / band.ordinates;
                }
                _ => bands.push((order, SpectralBand { frequency: order as f64, density, ordinates: 1.0 })),
            }
        }
        let bands: Vec<SpectralBand> = bands.into_iter().map(|(_, band)| band).collect();
        if bands.len() < TERMS {
            return None;
        }
        let bases: Vec<[f64; TERMS]> = bands.iter().map(|band| basis(band.frequency)).collect();
        let mut densities = [0.0; TERMS];
        fit_mixture(&bands, &bases, Sign::NonNegative, &mut densities);
        (densities.iter().sum::<f64>() > 0.0).then_some(Self { densities })
    }

    pub(super) fn density(&self, order: f64) -> f64 {
        mixture_density(&basis(order), &self.densities)
    }
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
