//! Stationary Gaussian noise of a given spectrum, generated in the frequency domain.

use fourier::Complex;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::PI;

/// One-sided density of flicker noise with the bias instability `b` at `frequency` Hz, `B²/(πf)` (IEEE Std 952).
pub(crate) fn flicker_density(b: f64, frequency: f64) -> f64 {
    b * b / (PI * frequency)
}

/// Noise of the one-sided `density` (argument in Hz) at `rate_hz`. It is at most half of a periodic record.
pub(crate) fn gaussian_noise(
    density: impl Fn(f64) -> f64,
    rate_hz: f64,
    samples: usize,
    random: &mut impl Rng,
) -> Vec<f64> {
    let length = 2 * samples.next_power_of_two();
    let transform = fourier::inverse(length);
    let mut spectrum = transform.make_input_vec();
    // A density S gives each quadrature the amplitude √(S·Δf/2)/√2.
    let spacing = rate_hz / length as f64;
    for (k, value) in spectrum.iter_mut().enumerate().skip(1) {
        let amplitude = (density(k as f64 * spacing) * spacing / 4.0).sqrt();
        *value = Complex::new(amplitude * normal(random), amplitude * normal(random));
    }
    if let Some(highest) = spectrum.last_mut() {
        highest.im = 0.0;
    }
    let mut record = transform.make_output_vec();
    transform
        .process(&mut spectrum, &mut record)
        .unwrap_or_else(|error| panic!("a transform of its own length: {error}"));
    record.truncate(samples);
    record
}

pub(crate) fn normal(random: &mut impl Rng) -> f64 {
    StandardNormal.sample(random)
}

#[cfg(test)]
mod tests {
    use super::{flicker_density, gaussian_noise};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use std::f64::consts::{LN_2, PI};

    /// The Allan variance is (2 ln 2/π)·B² at every averaging time (IEEE Std 952). At least 255 pairs in each of 10
    /// records give it to 3 % (1 σ).
    #[test]
    fn flicker_noise_has_the_flat_allan_variance_of_the_standard() {
        for factor in [16, 64, 256] {
            let of_seed = |seed: u64| {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                let noise = gaussian_noise(|frequency| flicker_density(0.5, frequency), 100.0, 1 << 16, &mut random);
                let means: Vec<f64> =
                    noise.chunks_exact(factor).map(|part| part.iter().sum::<f64>() / factor as f64).collect();
                let squares = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2));
                0.5 * squares.sum::<f64>() / (means.len() - 1) as f64
            };
            let mean = (0..10).map(of_seed).sum::<f64>() / 10.0;
            let expected = 2.0 * LN_2 / PI * 0.25;
            assert!((mean / expected - 1.0).abs() < 0.12, "{factor}: {mean}, {expected}");
        }
    }

    #[test]
    fn white_noise_has_the_variance_of_its_density() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        // A density of 2N² up to 50 Hz has the variance 100 N².
        let noise = gaussian_noise(|_| 2.0, 100.0, 1 << 16, &mut random);
        let variance = noise.iter().map(|value| value * value).sum::<f64>() / noise.len() as f64;
        // The tolerance is 4 σ of 65,536 squares.
        assert!((variance / 100.0 - 1.0).abs() < 4.0 * (2.0f64 / 65_536.0).sqrt(), "{variance}");
    }
}
