//! Non-negative least squares of a few unknowns, from the normal equations.

use crate::math::sqrt;

pub(crate) type Vector<const N: usize> = [f64; N];
pub(crate) type Matrix<const N: usize> = [[f64; N]; N];

/// Minimises `½ xᵀAx − bᵀx` over `x ≥ 0` for the first `count` unknowns.
///
/// The active-set method of C. Lawson and R. Hanson, "Solving Least Squares Problems" (1974), chapter 23.
pub(crate) fn non_negative<const N: usize>(a: &Matrix<N>, b: &Vector<N>, count: usize) -> Vector<N> {
    let mut x = [0.0; N];
    let (mut free, mut refused) = (0_usize, 0_usize);
    // Each round lowers the objective, so no set of free unknowns comes twice; rounding could make it seem so.
    for _ in 0..4 * N {
        let pull = |i: usize| (b[i] - dot(&a[i], &x)) / sqrt(a[i][i]);
        let candidates = (0..count).filter(|i| (free | refused) >> i & 1 == 0 && a[*i][*i] > 0.0);
        let Some(entering) = candidates.max_by(|&i, &j| pull(i).total_cmp(&pull(j))) else { break };
        if pull(entering) <= 1e-12 * sqrt(b[entering] * b[entering] / a[entering][entering]) {
            break;
        }
        let Some((next, set)) = settle(a, b, &x, free | 1 << entering) else {
            refused |= 1 << entering;
            continue;
        };
        if next[entering] <= 0.0 {
            refused |= 1 << entering;
        }
        (x, free) = (next, set);
    }
    x
}

/// Goes from `x` towards the minimum over the unknowns in `free`, and frees fewer whenever one would turn negative.
fn settle<const N: usize>(a: &Matrix<N>, b: &Vector<N>, x: &Vector<N>, mut free: usize) -> Option<(Vector<N>, usize)> {
    let mut x = *x;
    while free != 0 {
        let target = solve(a, b, free)?;
        let blocking = |i: &usize| free >> i & 1 == 1 && target[*i] <= 0.0;
        let reach = |i: usize| if x[i] > target[i] { x[i] / (x[i] - target[i]) } else { 0.0 };
        let Some(first) = (0..N).filter(blocking).min_by(|&i, &j| reach(i).total_cmp(&reach(j))) else {
            return Some((target, free));
        };
        let step = reach(first);
        for (i, entry) in x.iter_mut().enumerate().filter(|(i, _)| free >> i & 1 == 1) {
            *entry = (*entry + step * (target[i] - *entry)).max(0.0);
        }
        x[first] = 0.0;
        free &= !(1 << first);
    }
    Some((x, free))
}

pub(crate) fn dot<const N: usize>(a: &Vector<N>, b: &Vector<N>) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Solves `Ax = b` for the unknowns in the bit set, the others being 0.
pub(crate) fn solve<const N: usize>(a: &Matrix<N>, b: &Vector<N>, set: usize) -> Option<Vector<N>> {
    let (mut a, mut x) = (*a, [0.0; N]);
    (0..N).filter(|i| set >> i & 1 == 1).for_each(|i| x[i] = b[i]);
    solve_in_place(&mut a, &mut x, set)?;
    Some(x)
}

/// The same where they stand: `x` is `b` before. Of `a` the lower triangle is looked at, and used up.
///
/// By Cholesky's decomposition of the matrix scaled to a unit diagonal (the terms' squares differ by many orders of
/// magnitude).
pub(crate) fn solve_in_place<const N: usize>(a: &mut Matrix<N>, x: &mut Vector<N>, set: usize) -> Option<()> {
    let chosen = |i: &usize| set >> i & 1 == 1;
    let mut scale = [0.0; N];
    (0..N).for_each(|i| scale[i] = sqrt(a[i][i]));
    for i in (0..N).filter(chosen) {
        for j in (0..=i).filter(chosen) {
            let known: f64 = (0..j).filter(chosen).map(|k| a[i][k] * a[j][k]).sum();
            let rest = a[i][j] / (scale[i] * scale[j]) - known;
            if i != j {
                a[i][j] = rest / a[j][j];
            } else if rest > 1e-12 {
                a[i][i] = sqrt(rest);
            } else {
                return None; // singular, or not a number
            }
        }
        let known: f64 = (0..i).filter(chosen).map(|k| a[i][k] * x[k]).sum();
        x[i] = (x[i] / scale[i] - known) / a[i][i];
    }
    for i in (0..N).rev().filter(chosen) {
        let known: f64 = (i + 1..N).filter(chosen).map(|k| a[k][i] * x[k]).sum();
        x[i] = (x[i] - known) / a[i][i];
    }
    for (i, entry) in x.iter_mut().enumerate().filter(|(i, _)| chosen(i)) {
        *entry /= scale[i];
    }
    Some(())
}
