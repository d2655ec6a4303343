//! The scatter of κ₄/κ₃ of a filtered record by chance overlaps of disturbances.
//!
//! Two responses r at the distance u add `G₄(u) = 4R₃₁ + 6R₂₂ + 4R₁₃` and `G₃(u) = 3R₂₁ + 3R₁₂`, `Rₚ_q(u) = Σ
//! r(t)ᵖ·r(t+u)^q`. With n²/2N pairs of n in N blocks, ln(κ₄/κ₃) has the variance `Σᵤ (G₄/Σr⁴ − G₃/Σr³)²/2N`, whatever
//! n is.

use fourier::Complex;

pub(super) fn variance_of_ratio(response: &[f64], blocks: f64) -> Option<f64> {
    let (forward, inverse) = (fourier::forward(response.len()), fourier::inverse(response.len()));
    let transform = |power: i32| {
        let (mut powers, mut bins) =
            (response.iter().map(|of| of.powi(power)).collect::<Vec<f64>>(), forward.make_output_vec());
        forward.process(&mut powers, &mut bins).ok()?;
        Some(bins)
    };
    let [first, second, third] = [transform(1)?, transform(2)?, transform(3)?];
    let sum = |power: i32| response.iter().map(|of| of.powi(power)).sum::<f64>();
    // R₁₃(u) = R₃₁(−u): the conjugate transform.
    let both = |one: Complex<f64>, other: Complex<f64>| 2.0 * (one.conj() * other).re;
    let difference = |at: usize| {
        let fourth = 4.0 * both(third[at], first[at]) + 6.0 * second[at].norm_sqr();
        let third = 3.0 * both(second[at], first[at]);
        Complex::from(fourth / sum(4) - third / sum(3))
    };
    let mut bins: Vec<Complex<f64>> = (0..first.len()).map(difference).collect();
    let mut by_distance = inverse.make_output_vec();
    inverse.process(&mut bins, &mut by_distance).ok()?;
    let squares: f64 = by_distance.iter().map(|of| (of / response.len() as f64).powi(2)).sum();
    Some(squares / (2.0 * blocks))
}

#[cfg(test)]
mod tests {
    use super::variance_of_ratio;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Simulated records with 40 equal responses and no noise.
    #[test]
    fn the_variance_is_that_of_simulated_records() {
        const BLOCKS: usize = 4096;
        let mut response: Vec<f64> = (0..BLOCKS).map(|at| (-(at.min(BLOCKS - at) as f64) / 2.0).exp()).collect();
        let mean = response.iter().sum::<f64>() / BLOCKS as f64;
        response.iter_mut().for_each(|of| *of -= mean);
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let ratios: Vec<f64> = (0..400)
            .map(|_| {
                let mut sum = vec![0.0; BLOCKS];
                for _ in 0..40 {
                    let from = random.random_range(0..BLOCKS);
                    (0..BLOCKS).for_each(|at| sum[(from + at) % BLOCKS] += response[at]);
                }
                let mean = |power: i32| sum.iter().map(|z| z.powi(power)).sum::<f64>() / BLOCKS as f64;
                ((mean(4) - 3.0 * mean(2).powi(2)) / mean(3)).ln()
            })
            .collect();
        let mean = ratios.iter().sum::<f64>() / 400.0;
        let variance = ratios.iter().map(|of| (of - mean).powi(2)).sum::<f64>() / 400.0;
        let expected = variance_of_ratio(&response, BLOCKS as f64).expect("transforms");
        // A variance of 400 values scatters by up to 15 %; the logarithm is linear to some tenths.
        assert!((variance / expected - 1.0).abs() < 0.5, "{variance} {expected}");
    }
}
