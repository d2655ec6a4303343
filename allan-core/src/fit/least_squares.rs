//! Non-negative least squares of a few unknowns, from the normal equations.
//!
//! Symmetric matrices are stored as their lower triangle, row by row.

use crate::math::sqrt;

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

/// Relative size below which a gradient, or the remainder of a pivot, counts as a rounding error.
const ROUNDING: f64 = 1e-12;

/// Minimises `½ xᵀAx − bᵀx` over `x ≥ 0` for the first `count` unknowns, starting from the given `x ≥ 0`.
///
/// The active-set method of C. Lawson and R. Hanson, "Solving Least Squares Problems" (1974), chapter 23.
pub(crate) fn non_negative<const N: usize, const TRIANGLE: usize>(
    a: &[f64; TRIANGLE],
    b: &[f64; N],
    count: usize,
    x: &mut [f64; N],
) {
    let mut free = (0..count).filter(|&i| x[i] > 0.0).fold(0, |free, i| free | 1 << i);
    let mut refused = 0_usize;
    match minimise_free(a, b, x, free) {
        Some(set) => free = set,
        None => (*x, free) = ([0.0; N], 0),
    }
    // Each round lowers the objective, so no set of free unknowns recurs, except by rounding: hence the limit.
    for _ in 0..4 * N {
        let along = |i: usize| (0..count).map(|j| a[entry(i, j)] * x[j]).sum::<f64>();
        let gradient = |i: usize| (b[i] - along(i)) / sqrt(a[entry(i, i)]);
        let candidates = (0..count).filter(|&i| (free | refused) >> i & 1 == 0 && a[entry(i, i)] > 0.0);
        let Some(entering) = candidates.max_by(|&i, &j| gradient(i).total_cmp(&gradient(j))) else { break };
        if gradient(entering) <= ROUNDING * b[entering] / sqrt(a[entry(entering, entering)]) {
            break;
        }
        let before = *x;
        match minimise_free(a, b, x, free | 1 << entering) {
            Some(set) => free = set,
            None => *x = before,
        }
        if x[entering] <= 0.0 {
            refused |= 1 << entering;
        }
    }
}

/// Moves `x` to the minimum over the unknowns in the bit set `free`, removing from the set each one that would turn
/// negative. Returns the remaining set; `None` if the matrix is singular.
fn minimise_free<const N: usize, const TRIANGLE: usize>(
    a: &[f64; TRIANGLE],
    b: &[f64; N],
    x: &mut [f64; N],
    mut free: usize,
) -> Option<usize> {
    while free != 0 {
        let (mut used, mut target) = (*a, *b);
        solve(&mut used, &mut target, free)?;
        let blocking = |i: &usize| free >> i & 1 == 1 && target[*i] <= 0.0;
        let reach = |i: usize| if x[i] > target[i] { x[i] / (x[i] - target[i]) } else { 0.0 };
        let Some(first) = (0..N).filter(blocking).min_by(|&i, &j| reach(i).total_cmp(&reach(j))) else {
            *x = target;
            break;
        };
        let step = reach(first);
        for (i, entry) in x.iter_mut().enumerate().filter(|(i, _)| free >> i & 1 == 1) {
            *entry = (*entry + step * (target[i] - *entry)).max(0.0);
        }
        x[first] = 0.0;
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
pub(crate) fn solve(a: &mut [f64], x: &mut [f64], set: usize) -> Option<()> {
    let chosen = |i: &usize| set >> i & 1 == 1;
    let count = x.len();
    let mut scale = [0.0; MOST];
    for i in 0..count {
        scale[i] = 1.0 / sqrt(a[entry(i, i)]);
        x[i] = if chosen(&i) { x[i] * scale[i] } else { 0.0 };
    }
    for i in (0..count).filter(chosen) {
        for j in (0..=i).filter(chosen) {
            let known: f64 = (0..j).filter(chosen).map(|k| a[entry(i, k)] * a[entry(j, k)]).sum();
            let rest = a[entry(i, j)] * scale[i] * scale[j] - known;
            if i != j {
                a[entry(i, j)] = rest / a[entry(j, j)];
            } else if rest > ROUNDING {
                a[entry(i, i)] = sqrt(rest);
            } else {
                return None; // singular, or not a number
            }
        }
        let known: f64 = (0..i).filter(chosen).map(|k| a[entry(i, k)] * x[k]).sum();
        x[i] = (x[i] - known) / a[entry(i, i)];
    }
    for i in (0..count).rev().filter(chosen) {
        let known: f64 = (i + 1..count).filter(chosen).map(|k| a[entry(k, i)] * x[k]).sum();
        x[i] = (x[i] - known) / a[entry(i, i)];
    }
    x.iter_mut().zip(scale).enumerate().filter(|(i, _)| chosen(i)).for_each(|(_, (x, scale))| *x *= scale);
    Some(())
}
