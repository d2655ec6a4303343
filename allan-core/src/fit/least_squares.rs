//! Non-negative least squares of a few unknowns, from the normal equations.
//!
//! Symmetric matrices are stored as their lower triangle, row by row.

use crate::math::Real;

/// Largest number of unknowns.
pub(crate) const MOST: usize = 12;

/// Number of entries of a stored triangle.
pub(crate) const fn triangle(unknowns: usize) -> usize {
    unknowns * (unknowns + 1) / 2
}

/// Index of a matrix element in a stored triangle.
pub(crate) const fn entry(i: usize, j: usize) -> usize {
    if i < j { triangle(j) + i } else { triangle(i) + j }
}

/// Minimises `½ xᵀAx − bᵀx` over `x ≥ 0` for the first `count` unknowns, starting from the given `x ≥ 0`.
///
/// The active-set method of C. Lawson and R. Hanson, "Solving Least Squares Problems" (1974), chapter 23.
pub(crate) fn non_negative<F: Real, const N: usize, const TRIANGLE: usize>(
    a: &[F; TRIANGLE],
    b: &[F; N],
    count: usize,
    x: &mut [F; N],
) {
    let mut free = (0..count).filter(|&i| x[i] > F::ZERO).fold(0, |free, i| free | 1 << i);
    let mut refused = 0_usize;
    match minimise_free(a, b, x, free) {
        Some(set) => free = set,
        None => (*x, free) = ([F::ZERO; N], 0),
    }
    // Each round lowers the objective, so no set of free unknowns recurs, except by rounding: hence the limit.
    for _ in 0..4 * N {
        let along = |i: usize| (0..count).map(|j| a[entry(i, j)] * x[j]).sum::<F>();
        let gradient = |i: usize| (b[i] - along(i)) / a[entry(i, i)].sqrt();
        let candidates = (0..count).filter(|&i| (free | refused) >> i & 1 == 0 && a[entry(i, i)] > F::ZERO);
        let Some(entering) = candidates.max_by(|&i, &j| gradient(i).order(&gradient(j))) else { break };
        if gradient(entering) <= F::ROUNDING * b[entering] / a[entry(entering, entering)].sqrt() {
            break;
        }
        let before = *x;
        match minimise_free(a, b, x, free | 1 << entering) {
            Some(set) => free = set,
            None => *x = before,
        }
        if x[entering] <= F::ZERO {
            refused |= 1 << entering;
        }
    }
}

/// Moves `x` to the minimum over the unknowns in the bit set `free`, removing from the set each one that would turn
/// negative. Returns the remaining set; `None` if the matrix is singular.
fn minimise_free<F: Real, const N: usize, const TRIANGLE: usize>(
    a: &[F; TRIANGLE],
    b: &[F; N],
    x: &mut [F; N],
    mut free: usize,
) -> Option<usize> {
    while free != 0 {
        let (mut used, mut target) = (*a, *b);
        solve(&mut used, &mut target, free)?;
        let blocking = |i: &usize| free >> i & 1 == 1 && target[*i] <= F::ZERO;
        let reach = |i: usize| if x[i] > target[i] { x[i] / (x[i] - target[i]) } else { F::ZERO };
        let Some(first) = (0..N).filter(blocking).min_by(|&i, &j| reach(i).order(&reach(j))) else {
            *x = target;
            break;
        };
        let step = reach(first);
        for (i, entry) in x.iter_mut().enumerate().filter(|(i, _)| free >> i & 1 == 1) {
            let moved = *entry + step * (target[i] - *entry);
            *entry = if moved > F::ZERO { moved } else { F::ZERO };
        }
        x[first] = F::ZERO;
        free &= !(1 << first);
    }
    Some(free)
}

/// Solves `Ax = b` of up to [`MOST`] unknowns for those in the bit set `set`; the others are 0. `x` holds `b` on entry and
/// the solution on return; `a` is overwritten.
///
/// By Cholesky decomposition of the matrix scaled to a unit diagonal, as the unknowns may differ by orders of magnitude.
/// `None` if the matrix is singular.
#[inline(never)] // one copy for all sizes
pub(crate) fn solve<F: Real>(a: &mut [F], x: &mut [F], set: usize) -> Option<()> {
    let chosen = |i: &usize| set >> i & 1 == 1;
    let count = x.len();
    let mut scale = [F::ZERO; MOST];
    for i in 0..count {
        scale[i] = F::constant(1.0) / a[entry(i, i)].sqrt();
        x[i] = if chosen(&i) { x[i] * scale[i] } else { F::ZERO };
    }
    for i in (0..count).filter(chosen) {
        for j in (0..=i).filter(chosen) {
            let known: F = (0..j).filter(chosen).map(|k| a[entry(i, k)] * a[entry(j, k)]).sum();
            let rest = a[entry(i, j)] * scale[i] * scale[j] - known;
            if i != j {
                a[entry(i, j)] = rest / a[entry(j, j)];
            } else if rest > F::ROUNDING {
                a[entry(i, i)] = rest.sqrt();
            } else {
                return None; // singular, or not a number
            }
        }
        let known: F = (0..i).filter(chosen).map(|k| a[entry(i, k)] * x[k]).sum();
        x[i] = (x[i] - known) / a[entry(i, i)];
    }
    for i in (0..count).rev().filter(chosen) {
        let known: F = (i + 1..count).filter(chosen).map(|k| a[entry(k, i)] * x[k]).sum();
        x[i] = (x[i] - known) / a[entry(i, i)];
    }
    x.iter_mut().zip(scale).enumerate().filter(|(i, _)| chosen(i)).for_each(|(_, (x, scale))| *x = *x * scale);
    Some(())
}
