//! Densities of known shapes in a spectrum, by Whittle's likelihood.
//!
//! An ordinate `P` of a spectrum is gamma distributed around its density `S`, so the fit minimises `Σ g·(ln S + P/S)`, `g` being
//! half the degrees of freedom of the ordinate.

use nalgebra::{DMatrix, DVector};

/// An average over neighbouring ordinates of a spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectralBand {
    /// Hz.
    pub frequency: f64,
    /// One-sided, unit²/Hz.
    pub density: f64,
    /// Number of independent ordinates that were averaged: half the degrees of freedom.
    pub ordinates: f64,
}

/// The range of the densities of shapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sign {
    /// Each is 0 or more, and so is each shape.
    NonNegative,
    /// Only their sum is positive.
    Any,
}

/// Rounds of the multiplicative fit, which bring the densities near enough for the scoring.
const MULTIPLICATIVE_ROUNDS: usize = 4;
/// Most rounds of the scoring, and the gain in ln likelihood of a round with which it ends: what is left to gain then is far less
/// than 1/2, by which the likelihood falls at one standard deviation.
const SCORING_ROUNDS: usize = 50;
const LEAST_GAIN: f64 = 1e-4;
/// Shortest part of a step of the scoring that is tried.
const SHORTEST_STEP: f64 = 1e-3;

/// Probability that ordinates of a true density depart from it as far, in the order of their frequencies: `bands` are means over that
/// density, with the number of ordinates. Bartlett's test of the cumulative periodogram.
///
/// Ordinates over their density are exponential variables, whose cumulative sums over the total are distributed as the
/// ordered values of uniform ones, so that the largest distance from a straight line has Kolmogorov's distribution (M.
/// Bartlett, "An introduction to stochastic processes", 1955). That the parameters were fitted lowers the distance.
pub(super) fn departure_by_chance(bands: &[(f64, f64)]) -> f64 {
    let sums =
        |(total, count): (f64, f64), (ratio, ordinates): &(f64, f64)| (total + ratio * ordinates, count + ordinates);
    let (total, count) = bands.iter().fold((0.0, 0.0), sums);
    let (mut sum, mut position, mut largest) = (0.0, 0.0, 0.0_f64);
    for (ratio, ordinates) in bands {
        sum += ratio * ordinates / total;
        position += ordinates / count;
        largest = largest.max((sum - position).abs());
    }
    // The first term of Kolmogorov's series, which is exact where it matters.
    (2.0 * (-2.0 * count * largest * largest).exp()).min(1.0)
}

/// The distance that has this probability.
pub(super) fn least_departure(ordinates: f64, p_value: f64) -> f64 {
    ((2.0 / p_value).ln() / (2.0 * ordinates)).sqrt()
}

/// Fits the densities of shapes whose values in each band are a row of `bases`; returns `Σ g·(ln S + P/S)` with them.
///
/// Begins with each shape that is nowhere negative alone explaining an equal part of the bands. A few rounds multiply the densities
/// of these by factors that keep them non-negative and never lower the likelihood (C. Févotte and J. Idier, "Algorithms for
/// nonnegative matrix factorization with the β-divergence", Neural Computation 23, 2011, for the Itakura-Saito divergence, which is
/// Whittle's likelihood). Fisher's scoring, with steps that are halved until the likelihood grows, does the rest.
pub(super) fn fit_mixture<R: AsRef<[f64]>>(
    bands: &[SpectralBand],
    bases: &[R],
    sign: Sign,
    densities: &mut [f64],
) -> f64 {
    let is_positive: Vec<bool> =
        (0..densities.len()).map(|term| bases.iter().all(|basis| basis.as_ref()[term] >= 0.0)).collect();
    let positive = is_positive.iter().filter(|is_positive| **is_positive).count() as f64;
    let (mut total, mut parts) = (0.0, vec![0.0; densities.len()]);
    for (band, basis) in bands.iter().zip(bases).filter(|(band, _)| band.density > 0.0) {
        let weight = band.ordinates / band.density;
        total += band.ordinates;
        parts.iter_mut().zip(basis.as_ref()).for_each(|(part, shape)| *part += weight * shape);
    }
    for ((density, part), is_positive) in densities.iter_mut().zip(parts).zip(&is_positive) {
        *density = if *is_positive && part > 0.0 { total / (part * positive) } else { 0.0 };
    }
    for _ in 0..MULTIPLICATIVE_ROUNDS {
        multiplicative_step(bands, bases, &is_positive, densities);
    }
    fit_mixture_with(bands, bases, sign, &[], densities)
}

/// Fits like [`fit_mixture`], from these densities on, and keeps those of the terms `held`.
pub(super) fn fit_mixture_with<R: AsRef<[f64]>>(
    bands: &[SpectralBand],
    bases: &[R],
    sign: Sign,
    held: &[usize],
    densities: &mut [f64],
) -> f64 {
    let mut objective = mixture_objective(bands, bases, densities);
    for _ in 0..SCORING_ROUNDS {
        let Some(next) = weighted_least_squares(bands, bases, sign, held, densities) else { break };
        let step = |part: f64| -> Vec<f64> {
            densities.iter().zip(&next).map(|(density, next)| density + part * (next - density)).collect()
        };
        let parts = std::iter::successors(Some(1.0), |part| Some(part / 2.0)).take_while(|&part| part > SHORTEST_STEP);
        let mut tried = parts.map(step).map(|reached| (mixture_objective(bands, bases, &reached), reached));
        let Some((likelier, reached)) = tried.find(|(tried, _)| *tried < objective) else { break };
        let gain = objective - likelier;
        objective = likelier;
        densities.copy_from_slice(&reached);
        if gain < LEAST_GAIN {
            break;
        }
    }
    objective
}

/// A round of Fisher's scoring: the densities of that sign whose sum is nearest to the bands, each weighted by the inverse of its
/// variance under the present `densities`; those of `held` stay. What is negative and may not be is set to 0, one term after another.
/// `None` if the bands do not tell the shapes apart.
fn weighted_least_squares<R: AsRef<[f64]>>(
    bands: &[SpectralBand],
    bases: &[R],
    sign: Sign,
    held: &[usize],
    densities: &[f64],
) -> Option<Vec<f64>> {
    let NormalEquations { information, pull } = NormalEquations::new(bands, bases, held, densities);
    // In units in which each term alone is known to 1.
    let scale = information.diagonal().map(f64::sqrt);
    let mut is_left_out: Vec<bool> = scale.iter().map(|scale| *scale == 0.0).collect();
    held.iter().for_each(|&held| is_left_out[held] = true);
    loop {
        let entry = |row: usize, column: usize| {
            if is_left_out[row] || is_left_out[column] {
                f64::from(u8::from(row == column))
            } else {
                information[(row, column)] / (scale[row] * scale[column])
            }
        };
        let matrix = DMatrix::from_fn(pull.len(), pull.len(), entry);
        let right =
            DVector::from_fn(pull.len(), |term, _| if is_left_out[term] { 0.0 } else { pull[term] / scale[term] });
        let solved = matrix.cholesky()?.solve(&right);
        if solved.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let (least, value) = solved.argmin();
        if sign == Sign::Any || value >= 0.0 {
            let unscaled = |term: usize| if is_left_out[term] { 0.0 } else { solved[term] / scale[term] };
            let mut reached: Vec<f64> = (0..pull.len()).map(unscaled).collect();
            held.iter().for_each(|&held| reached[held] = densities[held]);
            return Some(reached);
        }
        is_left_out[least] = true;
    }
}

/// Fisher's information of the bands on the densities.
pub(super) fn information<R: AsRef<[f64]>>(bands: &[SpectralBand], bases: &[R], densities: &[f64]) -> DMatrix<f64> {
    NormalEquations::new(bands, bases, &[], densities).information
}

/// The equations that the weighted least squares solve.
struct NormalEquations {
    /// Fisher's information.
    information: DMatrix<f64>,
    /// For each term: the sum of the bands, less the held terms, times its shape and their weight.
    pull: Vec<f64>,
}

impl NormalEquations {
    fn new<R: AsRef<[f64]>>(bands: &[SpectralBand], bases: &[R], held: &[usize], densities: &[f64]) -> Self {
        let of_terms = match densities.len() {
            0..=4 => Self::of::<4, R>,
            5 => Self::of::<5, R>,
            6 => Self::of::<6, R>,
            7..=8 => Self::of::<8, R>,
            _ => Self::of_many,
        };
        of_terms(bands, bases, held, densities)
    }

    /// For up to `TERMS` terms, a number that the compiler knows: the sums then stay in registers.
    fn of<const TERMS: usize, R: AsRef<[f64]>>(
        bands: &[SpectralBand],
        bases: &[R],
        held: &[usize],
        densities: &[f64],
    ) -> Self {
        let terms = densities.len();
        let (mut sums, mut pull) = ([[0.0; TERMS]; TERMS], [0.0; TERMS]);
        for_each_weight(bands, bases, held, densities, |basis, weight, towards| {
            let mut shapes = [0.0; TERMS];
            shapes[..terms].copy_from_slice(&basis[..terms]);
            for ((entries, pull), shape) in sums.iter_mut().zip(&mut pull).zip(shapes) {
                let of_column = weight * shape;
                entries.iter_mut().zip(shapes).for_each(|(entry, shape)| *entry += of_column * shape);
                *pull += towards * shape;
            }
        });
        let information = DMatrix::from_fn(terms, terms, |row, column| sums[column][row]);
        Self { information, pull: pull[..terms].to_vec() }
    }

    /// For any number of terms: white noise that is correlated with many neighbours has one for each.
    fn of_many<R: AsRef<[f64]>>(bands: &[SpectralBand], bases: &[R], held: &[usize], densities: &[f64]) -> Self {
        let terms = densities.len();
        let (mut information, mut pull) = (DMatrix::zeros(terms, terms), vec![0.0; terms]);
        for_each_weight(bands, bases, held, densities, |basis, weight, towards| {
            for (column, mut entries) in information.column_iter_mut().enumerate() {
                let of_column = weight * basis[column];
                entries.iter_mut().zip(basis).for_each(|(entry, shape)| *entry += of_column * shape);
            }
            pull.iter_mut().zip(basis).for_each(|(pull, shape)| *pull += towards * shape);
        });
        Self { information, pull }
    }
}

/// Calls `add` with the shapes in each band where there is a density, the inverse of the variance of the band, and that times what the band
/// has beside the terms that are held.
fn for_each_weight<R: AsRef<[f64]>>(
    bands: &[SpectralBand],
    bases: &[R],
    held: &[usize],
    densities: &[f64],
    mut add: impl FnMut(&[f64], f64, f64),
) {
    for (band, basis) in bands.iter().zip(bases) {
        let basis = basis.as_ref();
        let density = mixture_density(basis, densities);
        if density > 0.0 {
            let of_held: f64 = held.iter().map(|&held| densities[held] * basis[held]).sum();
            let square = density * density;
            add(basis, band.ordinates / square, band.ordinates * (band.density - of_held) / square);
        }
    }
}

/// A round of the multiplicative fit of the terms that are nowhere negative.
fn multiplicative_step<R: AsRef<[f64]>>(
    bands: &[SpectralBand],
    bases: &[R],
    is_positive: &[bool],
    densities: &mut [f64],
) {
    let mut sums = vec![(0.0, 0.0); densities.len()];
    for (band, basis) in bands.iter().zip(bases) {
        let density = mixture_density(basis.as_ref(), densities);
        if density <= 0.0 {
            continue;
        }
        let (push, towards) = (band.ordinates / density, band.density / density);
        for (sums, shape) in sums.iter_mut().zip(basis.as_ref()) {
            *sums = (sums.0 + push * shape * towards, sums.1 + push * shape);
        }
    }
    for ((density, (pull, push)), is_positive) in densities.iter_mut().zip(sums).zip(is_positive) {
        if *is_positive && push > 0.0 {
            *density *= (pull / push).sqrt();
        }
    }
}

/// Density of the mixture where its shapes have the values `basis`.
pub(super) fn mixture_density(basis: &[f64], densities: &[f64]) -> f64 {
    basis.iter().zip(densities).map(|(basis, density)| basis * density).sum()
}

/// `Σ g·(ln S + P/S)` over the bands, `S` being the mixture.
fn mixture_objective<R: AsRef<[f64]>>(bands: &[SpectralBand], bases: &[R], densities: &[f64]) -> f64 {
    let of_band = |(band, basis): (&SpectralBand, &R)| {
        let density = mixture_density(basis.as_ref(), densities).max(f64::MIN_POSITIVE);
        band.ordinates * (density.ln() + band.density / density)
    };
    bands.iter().zip(bases).map(of_band).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Σ g·b_i·b_j/S² of every pair of shapes, for as many as are summed in registers and more.
    #[test]
    fn the_information_is_that_of_any_number_of_terms() {
        for terms in [1, 4, 5, 6, 7, 8, 9, 16, 17, 20] {
            let basis = |band: usize| (0..terms).map(|term| 1.0 + ((band * (term + 1)) as f64).cos().abs()).collect();
            let bases: Vec<Vec<f64>> = (0..30).map(basis).collect();
            let band = |of: usize| SpectralBand { frequency: of as f64, density: 1.0, ordinates: 3.0 + of as f64 };
            let bands: Vec<SpectralBand> = (0..30).map(band).collect();
            let densities: Vec<f64> = (0..terms).map(|term| 0.5 + term as f64).collect();
            let found = information(&bands, &bases, &densities);
            for (row, column) in (0..terms).flat_map(|row| (0..terms).map(move |column| (row, column))) {
                let of = |(band, basis): (&SpectralBand, &Vec<f64>)| {
                    let density: f64 = basis.iter().zip(&densities).map(|(shape, density)| shape * density).sum();
                    band.ordinates * basis[row] * basis[column] / (density * density)
                };
                let expected: f64 = bands.iter().zip(&bases).map(of).sum();
                assert!((found[(row, column)] / expected - 1.0).abs() < 1e-12, "{terms} terms");
            }
        }
    }

    /// Bands whose densities are exactly those of a mixture: the fit is that mixture, of either sign.
    #[test]
    fn the_densities_of_exact_bands_are_found() {
        let frequencies: Vec<f64> = (1..=40).map(|at| 0.02 * f64::from(at)).collect();
        let shapes = |f: f64| [1.0, 1.0 / f, 2.0 * (std::f64::consts::PI * f).cos()];
        let bases: Vec<[f64; 3]> = frequencies.iter().map(|f| shapes(*f)).collect();
        for (sign, truth) in [(Sign::Any, [3.0, 0.2, -0.4]), (Sign::Any, [2.0, -0.02, 0.9])] {
            let band = |(f, basis): (&f64, &[f64; 3])| SpectralBand {
                frequency: *f,
                density: mixture_density(basis, &truth),
                ordinates: 50.0,
            };
            let bands: Vec<SpectralBand> = frequencies.iter().zip(&bases).map(band).collect();
            let mut densities = [0.0; 3];
            fit_mixture(&bands, &bases, sign, &mut densities);
            for (found, truth) in densities.iter().zip(truth) {
                assert!((found - truth).abs() < 1e-4, "{densities:?}");
            }
        }
        // Without a negative density the nearest mixture has none of the shape that would need one.
        let bases: Vec<[f64; 2]> = frequencies.iter().map(|f| [1.0, 1.0 / f]).collect();
        let band = |f: &f64| SpectralBand { frequency: *f, density: 2.0 - 0.02 / f, ordinates: 50.0 };
        let bands: Vec<SpectralBand> = frequencies.iter().map(band).collect();
        let mut densities = [0.0; 2];
        fit_mixture(&bands, &bases, Sign::NonNegative, &mut densities);
        let mean = bands.iter().map(|band| band.density).sum::<f64>() / 40.0;
        assert!(densities[1] == 0.0 && (densities[0] - mean).abs() < 1e-3, "{densities:?}, {mean}");
    }

    /// With one density held where it is not, the others are the nearest mixture to what it leaves.
    #[test]
    fn a_density_that_is_held_stays() {
        let frequencies: Vec<f64> = (1..=40).map(|at| 0.02 * f64::from(at)).collect();
        let bases: Vec<[f64; 2]> = frequencies.iter().map(|f| [1.0, 1.0 / f]).collect();
        let band = |f: &f64| SpectralBand { frequency: *f, density: 3.0 + 0.2 / f, ordinates: 50.0 };
        let bands: Vec<SpectralBand> = frequencies.iter().map(band).collect();
        let mut densities = [1.0, 0.2];
        fit_mixture_with(&bands, &bases, Sign::NonNegative, &[1], &mut densities);
        assert!(densities[1] == 0.2 && (densities[0] - 3.0).abs() < 1e-4, "{densities:?}");
        densities = [3.0, 0.1];
        let objective = fit_mixture_with(&bands, &bases, Sign::NonNegative, &[1], &mut densities);
        assert!(densities[1] == 0.1 && densities[0] > 3.0, "{densities:?}");
        for near in [0.999, 1.001] {
            assert!(mixture_objective(&bands, &bases, &[near * densities[0], 0.1]) > objective - 1e-6);
        }
    }
}
