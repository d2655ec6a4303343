//! A spectrum as a sum of known shapes: the densities that Whittle's likelihood makes likeliest.

use super::shape::Band;

const ROUNDS: usize = 300;

/// Densities of shapes whose values in each band are `bases`.
///
/// Begins with each shape alone, at its share of the whole. A multiplicative step is never negative and never worse
/// (C. Févotte and J. Idier, "Algorithms for nonnegative matrix factorization with the β-divergence", 2011, for the
/// Itakura-Saito divergence, which is Whittle's likelihood).
pub(super) fn fit<const TERMS: usize>(bands: &[Band], bases: &[[f64; TERMS]], densities: &mut [f64; TERMS]) {
    for (term, density) in densities.iter_mut().enumerate() {
        let shown = bands.iter().zip(bases).filter(|(_, basis)| basis[term] > 0.0);
        let (sum, weight) = shown.fold((0.0, 0.0), |(sum, weight), (band, basis)| {
            let alone = (band.density / basis[term]).max(f64::MIN_POSITIVE);
            (sum + band.ordinates * alone.ln(), weight + band.ordinates)
        });
        *density = if weight > 0.0 { (sum / weight).exp() / TERMS as f64 } else { 0.0 };
    }
    for _ in 0..ROUNDS {
        improve(bands, bases, densities);
    }
}

fn improve<const TERMS: usize>(bands: &[Band], bases: &[[f64; TERMS]], densities: &mut [f64; TERMS]) {
    let (mut pull, mut push) = ([0.0; TERMS], [0.0; TERMS]);
    for (band, basis) in bands.iter().zip(bases) {
        let density = total(basis, densities);
        if density <= 0.0 {
            continue;
        }
        for term in 0..TERMS {
            let weight = band.ordinates * basis[term] / density;
            pull[term] += weight * band.density / density;
            push[term] += weight;
        }
    }
    for term in 0..TERMS {
        if push[term] > 0.0 {
            densities[term] *= (pull[term] / push[term]).sqrt();
        }
    }
}

/// Density of the mixture where its shapes have the values `basis`.
pub(super) fn total<const TERMS: usize>(basis: &[f64; TERMS], densities: &[f64; TERMS]) -> f64 {
    basis.iter().zip(densities).map(|(basis, density)| basis * density).sum()
}

/// `Σ g·(ln S + P/S)`, `g` being half the degrees of freedom of a band's density `P` and `S` the `modelled` one.
pub(super) fn objective(bands: &[Band], modelled: &[f64]) -> f64 {
    let of = |(band, modelled): (&Band, &f64)| {
        let density = modelled.max(f64::MIN_POSITIVE);
        band.ordinates * (density.ln() + band.density / density)
    };
    bands.iter().zip(modelled).map(of).sum()
}
