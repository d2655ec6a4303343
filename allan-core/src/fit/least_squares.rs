//! Non-negative least squares of a few unknowns, from the normal equations.

use crate::math::sqrt;

pub(crate) type Vector<const N: usize> = [f64; N];
pub(crate) type Matrix<const N: usize> = [[f64; N]; N];

/// Minimises `½ xᵀAx − bᵀx` over `x ≥ 0` for the first `count` unknowns.
///
/// Tries every set of unknowns that may be positive: with so few of them that is both the simplest and the surest
/// way, and it always ends.
pub(crate) fn non_negative<const N: usize>(a: &Matrix<N>, b: &Vector<N>, count: usize) -> Vector<N> {
    let mut best = ([0.0; N], 0.0);
    for set in 1_usize..1 << count {
        let Some(x) = solve(a, b, set) else { continue };
        if x.iter().any(|&entry| entry < 0.0) {
            continue;
        }
        // At the unconstrained minimum over the set the objective is −½ bᵀx.
        let objective = -0.5 * b.iter().zip(&x).map(|(b, x)| b * x).sum::<f64>();
        if objective < best.1 {
            best = (x, objective);
        }
    }
    best.0
}

/// The inverse of the leading `count × count` block; `None` if it is singular.
pub(crate) fn inverse<const N: usize>(a: &Matrix<N>, count: usize) -> Option<Matrix<N>> {
    let mut inverse = [[0.0; N]; N];
    for column in 0..count {
        let mut unit = [0.0; N];
        unit[column] = 1.0;
        let x = solve(a, &unit, (1 << count) - 1)?;
        for (row, entry) in inverse.iter_mut().zip(x) {
            row[column] = entry;
        }
    }
    Some(inverse)
}

/// Solves `Ax = b` for the unknowns in the bit set, the others being 0, by Cholesky's decomposition of the matrix
/// scaled to a unit diagonal (the terms' squares differ by many orders of magnitude).
fn solve<const N: usize>(a: &Matrix<N>, b: &Vector<N>, set: usize) -> Option<Vector<N>> {
    let chosen = |i: &usize| set >> i & 1 == 1;
    let scale = |i: usize| sqrt(a[i][i]);
    let mut factor = [[0.0; N]; N];
    let mut x = [0.0; N];
    for i in (0..N).filter(chosen) {
        for j in (0..=i).filter(chosen) {
            let dot: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let rest = a[i][j] / (scale(i) * scale(j)) - dot;
            if i != j {
                factor[i][j] = rest / factor[j][j];
            } else if rest > 1e-12 {
                factor[i][i] = sqrt(rest);
            } else {
                return None; // singular, or not a number
            }
        }
        let dot: f64 = (0..i).map(|k| factor[i][k] * x[k]).sum();
        x[i] = (b[i] / scale(i) - dot) / factor[i][i];
    }
    for i in (0..N).rev().filter(chosen) {
        let dot: f64 = (i + 1..N).map(|k| factor[k][i] * x[k]).sum();
        x[i] = (x[i] - dot) / factor[i][i];
    }
    for (i, entry) in x.iter_mut().enumerate().filter(|(i, _)| chosen(i)) {
        *entry /= scale(i);
    }
    Some(x)
}
