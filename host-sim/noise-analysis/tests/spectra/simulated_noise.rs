//! Noise whose N, B and K are known.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::PI;

/// White noise with N = 1, at `rate` Hz.
pub(crate) fn white(count: usize, rate: f64, random: &mut ChaCha8Rng) -> Vec<f64> {
    (0..count).map(|_| rate.sqrt() * random.sample::<f64, _>(StandardNormal)).collect()
}

/// Adds flicker noise B, whose one-sided density is `B²/(πf)`, and a random walk K at `rate` Hz, as sums.
pub(crate) fn with_drift(mut values: Vec<f64>, [b, k]: [f64; 2], rate: f64, random: &mut ChaCha8Rng) -> Vec<f64> {
    // Random phases and amplitudes at the frequencies of a record of twice the length.
    let length = 2 * values.len();
    let transform = fourier::inverse(length);
    let mut spectrum = transform.make_input_vec();
    let last = spectrum.len() - 1;
    for (at, value) in spectrum.iter_mut().enumerate().take(last).skip(1) {
        let density = b * b * length as f64 / (PI * at as f64 * rate);
        // The transform back is a sum without a factor: an ordinate has the variance S·Δf/4 in each part.
        let deviation = (density * rate / length as f64).sqrt() / 2.0;
        value.re = deviation * random.sample::<f64, _>(StandardNormal);
        value.im = deviation * random.sample::<f64, _>(StandardNormal);
    }
    let mut flicker = transform.make_output_vec();
    transform.process(&mut spectrum, &mut flicker).expect("the planner's own buffers");
    let mut walk = 0.0;
    for (value, flicker) in values.iter_mut().zip(flicker) {
        walk += k / rate.sqrt() * random.sample::<f64, _>(StandardNormal);
        *value += flicker + walk;
    }
    values
}

/// Two cascaded averages over `taps` values each.
pub(crate) fn filtered(values: &[f64], taps: usize) -> Vec<f64> {
    let average = |values: &[f64]| -> Vec<f64> {
        values.windows(taps).map(|window| window.iter().sum::<f64>() / taps as f64).collect()
    };
    average(&average(values))
}
