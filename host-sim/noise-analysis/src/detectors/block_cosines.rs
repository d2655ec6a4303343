//! Expected squares of the orders of the cosine transform of block means: the orthonormal DCT-II.
//!
//! The orders of white noise and of a random walk are uncorrelated, those of flicker noise nearly: by 0.12 at most. So a mixture of
//! noises is one variance per order.

use std::f64::consts::PI;

/// Expected squares of orders 1 to `blocks` − 1, for means with this covariance at a lag in blocks; `blocks` is even.
pub(crate) fn expected_squares(blocks: usize, covariance: impl Fn(usize) -> f64) -> Vec<f64> {
    let cosines: Vec<f64> = (0..2 * blocks).map(|at| (PI * at as f64 / blocks as f64).cos()).collect();
    let cosine = |multiple: usize| cosines[multiple % cosines.len()];
    let sine = |multiple: usize| cosine(multiple + 3 * blocks / 2);
    let covariances: Vec<f64> = (0..blocks).map(covariance).collect();
    let of_order = |order: usize| {
        // Twice the sum of the products of two values of the cosine at this lag.
        let products = |lag: usize| (blocks - lag) as f64 * cosine(order * lag) - sine(order * lag) / sine(order);
        let of_lag = |(lag, covariance): (usize, &f64)| if lag == 0 { 1.0 } else { 2.0 } * covariance * products(lag);
        covariances.iter().enumerate().map(of_lag).sum::<f64>() / blocks as f64
    };
    (1..blocks).map(of_order).collect()
}

/// Expected squares of flicker noise with B = 1.
pub(crate) fn flicker_squares(blocks: usize) -> Vec<f64> {
    expected_squares(blocks, flicker_covariance)
}

/// Covariance of means of flicker noise with B = 1: −ln of the lag over π, up to a constant, which is in order 0 alone.
fn flicker_covariance(lag: usize) -> f64 {
    let integral = |x: f64| if x == 0.0 { 0.0 } else { -0.5 * x * x * (x.abs().ln() - 1.5) / PI };
    let lag = lag as f64;
    integral(lag + 1.0) - 2.0 * integral(lag) + integral(lag - 1.0)
}

/// Expected squares of a random walk with steps of variance 1 per block: the eigenvalues of the covariance of its means.
pub(crate) fn walk_squares(blocks: usize) -> Vec<f64> {
    let square = |order: usize| 0.25 / (PI * order as f64 / (2 * blocks) as f64).sin().powi(2) - 1.0 / 6.0;
    (1..blocks).map(square).collect()
}

/// Expected squares of a Gauss-Markov process of variance 1; time constant in blocks.
pub(crate) fn markov_squares(blocks: usize, time: f64) -> Vec<f64> {
    let decay = |blocks: f64| (-blocks / time).exp();
    expected_squares(blocks, |lag| match lag {
        0 => 2.0 * time * (1.0 - time * (1.0 - decay(1.0))),
        lag => time * time * (decay(lag as f64 - 1.0) - 2.0 * decay(lag as f64) + decay(lag as f64 + 1.0)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use std::f64::consts::LN_2;

    /// The cosine transform of the covariance of means: all orders but the constant, by matrices.
    fn transformed(blocks: usize, covariance: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
        let basis = DMatrix::from_fn(blocks - 1, blocks, |order, at| {
            let phase = PI * ((order + 1) * (2 * at + 1)) as f64 / (2 * blocks) as f64;
            (2.0 / blocks as f64).sqrt() * phase.cos()
        });
        &basis * DMatrix::from_fn(blocks, blocks, covariance) * basis.transpose()
    }

    /// Variance of the walk in the middle of the earlier block; a third of a block for the same block.
    #[test]
    fn the_orders_of_a_random_walk_are_uncorrelated() {
        let walk = |row: usize, column: usize| row.min(column) as f64 + if row == column { 1.0 / 3.0 } else { 0.5 };
        let mut rest = transformed(64, walk);
        for (order, square) in walk_squares(64).into_iter().enumerate() {
            assert!((rest[(order, order)] / square - 1.0).abs() < 1e-9, "{order}");
            rest[(order, order)] = 0.0;
        }
        assert!(rest.amax() < 1e-9, "{}", rest.amax());
    }

    #[test]
    fn the_orders_of_flicker_noise_are_nearly_uncorrelated() {
        let (matrix, squares) =
            (transformed(64, |row, column| flicker_covariance(row.abs_diff(column))), flicker_squares(64));
        let correlation = |row: usize, column: usize| matrix[(row, column)] / (squares[row] * squares[column]).sqrt();
        let mut largest = 0.0_f64;
        for row in 0..63 {
            assert!((correlation(row, row) - 1.0).abs() < 1e-9, "{row}");
            largest = (0..row).map(|column| correlation(row, column).abs()).fold(largest, f64::max);
        }
        assert!((0.10..0.13).contains(&largest), "{largest}");
    }

    /// Flicker noise is a sum of Gauss-Markov processes an octave apart. Those faster than 1/256 of a block and slower than 64
    /// records are left out: 0.5 % of the highest order and 0.3 % of the lowest.
    #[test]
    fn flicker_noise_has_the_squares_of_a_sum_of_markov_processes() {
        let mut sum = vec![0.0; 63];
        for octave in -8..=12 {
            let squares = markov_squares(64, 2f64.powi(octave));
            sum.iter_mut().zip(squares).for_each(|(sum, square)| *sum += LN_2 / PI * square);
        }
        for (sum, flicker) in sum.iter().zip(flicker_squares(64)) {
            assert!((sum / flicker - 1.0).abs() < 0.01, "{sum} {flicker}");
        }
    }
}
