//! Non-negative least squares of a few unknowns; symmetric matrices are their lower triangle, row by row.

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

/// Minimises `½ xᵀAx − bᵀx` over `x ≥ 0` for the first `count` unknowns, from the given `x ≥ 0`.
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
    // A set can recur only by rounding; the limit ends such a loop.
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

/// Moves `x` to the minimum over the unknowns in `free`; returns those that are not negative, `None` if singular.
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

/// Solves `Ax = b` for the unknowns in the bit set `set`, the others being 0; `x` holds `b`, then the solution, and `a`
/// is overwritten.
///
/// Cholesky decomposition of the matrix scaled to a unit diagonal. `None` if the matrix is singular.
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

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 4;

    /// Solves the equations of the unknowns in `set` by elimination; `None` unless all are positive.
    fn positive(a: &[[f64; N]; N], b: &[f64; N], set: usize) -> Option<[f64; N]> {
        let (mut a, mut x) = (*a, *b);
        let chosen = |i: &usize| set >> i & 1 == 1;
        for pivot in (0..N).filter(chosen) {
            for row in (0..N).filter(chosen).filter(|&row| row != pivot) {
                let factor = a[row][pivot] / a[pivot][pivot];
                (0..N).for_each(|column| a[row][column] -= factor * a[pivot][column]);
                x[row] -= factor * x[pivot];
            }
        }
        let solution = core::array::from_fn(|i| if chosen(&i) { x[i] / a[i][i] } else { 0.0 });
        (0..N).filter(chosen).all(|i| solution[i] > 0.0).then_some(solution)
    }

    /// All sixteen sets of unknowns are tried from every kind of start.
    #[test]
    fn the_minimum_is_the_least_of_all_sets() {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for case in 0..2_000 {
            let rows: [[f64; N]; N] = core::array::from_fn(|_| core::array::from_fn(|_| uniform()));
            let dot = |i: usize, j: usize| (0..N).map(|k| rows[i][k] * rows[j][k]).sum::<f64>();
            let full = core::array::from_fn(|i| core::array::from_fn(|j| dot(i, j) + if i == j { 0.01 } else { 0.0 }));
            let b: [f64; N] = core::array::from_fn(|_| uniform());
            let objective = |x: &[f64; N]| -> f64 {
                let along = |i: usize| (0..N).map(|j| full[i][j] * x[j]).sum::<f64>();
                (0..N).map(|i| x[i] * (along(i) / 2.0 - b[i])).sum()
            };
            let full: [[f64; N]; N] = full;
            let least =
                (0..1 << N).filter_map(|set| positive(&full, &b, set)).map(|x| objective(&x)).fold(0.0, f64::min);
            let mut a = [0.0; triangle(N)];
            (0..N).for_each(|i| (0..=i).for_each(|j| a[entry(i, j)] = full[i][j]));
            let start: [f64; N] = core::array::from_fn(|_| uniform().max(0.0) * 10.0);
            let mut x = start;
            non_negative(&a, &b, N, &mut x);
            // The unit changes by a power of two that is a square, so every digit stays the same.
            let (mut same, unit) = (start, 2.0_f64.powi(-60));
            non_negative(&a.map(|entry| entry * unit), &b.map(|entry| entry * unit), N, &mut same);
            assert_eq!(same, x, "case {case}");
            assert!(x.iter().all(|&x| x >= 0.0), "case {case}: {x:?}");
            assert!(objective(&x) - least <= 1e-9, "case {case}: {x:?}, {} above the minimum", objective(&x) - least);
        }
    }
}
