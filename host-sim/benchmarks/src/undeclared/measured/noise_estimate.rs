//! N, B and K of measured noise and the filter of N: Whittle's fit to medians of bands, which lines hardly change.

use crate::undeclared::channel_under_test::{Densities, baseline_densities, fit_baseline, low_pass_gain};
use adis16405_driver::Channel;
use measurement::{MeasuredChannel, Measurement};
use std::f64::consts::PI;
use virtual_sensor::{NoiseModel, OutputRegister};

const BANDS_PER_OCTAVE: f64 = 6.0;
/// Least number of ordinates in a band.
const FEWEST: usize = 5;
/// Corners that are tried: the highest over half the sample rate, their number, and the ratio of neighbours.
const HIGHEST_CORNER: f64 = 1.5;
const CORNERS: usize = 24;
const CORNER_RATIO: f64 = 1.15;
const LEAST_GAIN: f64 = 10.0;

pub(super) struct NoiseEstimate {
    pub(super) model: NoiseModel,
    /// Corner of each channel's white noise, Hz; infinite without a filter.
    pub(super) corners_hz: [f64; 12],
    pub(super) channels: Vec<OutputRegister>,
}

pub(super) fn noise_estimate(samples: &Measurement) -> NoiseEstimate {
    let (mut model, mut channels) = (NoiseModel::noiseless(), Vec::new());
    let mut corners_hz = [f64::INFINITY; 12];
    for channel in Channel::INERTIAL {
        let Some(measured) = samples.channels.iter().find(|of| of.profile.name == channel.name()) else { continue };
        let found = coefficients(&values(measured), samples.period_s(), measured.profile.lsb);
        let Some(([n, b, k], corner_hz)) = found else { continue };
        let output = simulation::output_register(channel);
        let noise = model.channel_mut(output);
        [noise.angle_random_walk, noise.bias_instability, noise.rate_random_walk] = [n, b, k];
        corners_hz[channel as usize] = corner_hz;
        channels.push(output);
    }
    NoiseEstimate { model, corners_hz, channels }
}

fn values(channel: &MeasuredChannel) -> Vec<f64> {
    channel.counts.iter().map(|&count| f64::from(count) * channel.profile.lsb).collect()
}

/// N, B, K and the corner of N in Hz, of values rounded to `resolution`; `None` if the values are constant.
fn coefficients(values: &[f64], period_s: f64, resolution: f64) -> Option<([f64; 3], f64)> {
    let bands = bands(values, period_s)?;
    let rounding = resolution * resolution / 12.0 * period_s;
    let counts: Vec<f64> = bands.iter().map(|band| band.ordinates).collect();
    // The white noise is first estimated from the highest frequencies.
    let white = bands.last().map_or(0.0, |band| band.density);
    // The fit for a corner: coefficients, corner, and log likelihood up to a constant.
    let fit = |corner_hz: f64| {
        let of_band = |band: &Band| {
            let [white, flicker, walk] = baseline_densities(period_s, band.frequency_hz);
            let baseline = [low_pass_gain(corner_hz, band.frequency_hz) * white, flicker, walk];
            Densities { baseline, known: rounding, truth: band.density }
        };
        let densities: Vec<Densities> = bands.iter().map(of_band).collect();
        let squares = fit_baseline(&densities, &counts, [white, 0.0, 0.0]);
        let deviance = |(densities, count): (&Densities, &f64)| {
            let modelled = densities.modelled(&squares);
            count * (modelled.ln() + densities.truth / modelled)
        };
        let likelihood = -densities.iter().zip(&counts).map(deviance).sum::<f64>();
        (squares.map(f64::sqrt), corner_hz, likelihood)
    };
    let corner = |step: usize| HIGHEST_CORNER * 0.5 / period_s / CORNER_RATIO.powi(step as i32);
    let (unfiltered, filtered) = (fit(f64::INFINITY), (0..CORNERS).map(|step| fit(corner(step))));
    let likeliest = filtered.max_by(|one, other| one.2.total_cmp(&other.2));
    let filtered = likeliest.filter(|filtered| filtered.2 > unfiltered.2 + LEAST_GAIN);
    let (coefficients, corner_hz, _) = filtered.unwrap_or(unfiltered);
    Some((coefficients, corner_hz))
}

struct Band {
    frequency_hz: f64,
    /// Two-sided density, unit²/Hz.
    density: f64,
    ordinates: f64,
}

/// The densities of bands: medians over their bias, under Hann's window, without the lowest two ordinates.
fn bands(values: &[f64], period_s: f64) -> Option<Vec<Band>> {
    let length = values.len();
    let mean = values.iter().sum::<f64>() / length as f64;
    let window = |at: usize| (PI * (at as f64 + 0.5) / length as f64).sin().powi(2);
    let mut input: Vec<f64> = values.iter().enumerate().map(|(at, value)| window(at) * (value - mean)).collect();
    if length < 64 || input.iter().all(|value| *value == 0.0) {
        return None;
    }
    let transform = fourier::forward(length);
    let mut output = transform.make_output_vec();
    transform.process(&mut input, &mut output).ok()?;
    // The window has a mean square of 3/8.
    let scale = period_s / (0.375 * length as f64);
    let mut from = 2;
    let mut bands = Vec::new();
    while from + FEWEST <= output.len() {
        let wide = (from as f64 * 2f64.powf(1.0 / BANDS_PER_OCTAVE)).ceil() as usize;
        let to = wide.max(from + FEWEST).min(output.len());
        let mut ordinates: Vec<f64> = output[from..to].iter().map(|bin| scale * bin.norm_sqr()).collect();
        ordinates.sort_by(f64::total_cmp);
        let middle = ordinates.len() / 2;
        // The expected median of exponential variables is 1/n + 1/(n − 1) + …
        let expected: f64 = (ordinates.len() - middle..=ordinates.len()).map(|left| 1.0 / left as f64).sum();
        bands.push(Band {
            frequency_hz: 0.5 * (from + to - 1) as f64 / (length as f64 * period_s),
            density: ordinates[middle] / expected,
            ordinates: ordinates.len() as f64,
        });
        from = to;
    }
    (!bands.is_empty() && bands.iter().all(|band| band.density > 0.0)).then_some(bands)
}

#[cfg(test)]
mod tests {
    use super::coefficients;
    use crate::spectral_noise::{baseline, gaussian_noise};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use std::f64::consts::TAU;
    use virtual_sensor::ChannelNoise;

    /// Over 8 seeds N is known to 1 %, B and K to a fifth. The line has ten standard deviations.
    #[test]
    fn the_coefficients_are_those_of_the_noise_in_spite_of_a_line() {
        let truth = [0.02, 0.03, 0.01];
        let noise = ChannelNoise {
            angle_random_walk: truth[0],
            bias_instability: truth[1],
            rate_random_walk: truth[2],
            ..ChannelNoise::default()
        };
        let mut sums = [0.0; 3];
        for seed in 0..8 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut values = baseline(&noise, 100.0, 1 << 17, &mut random);
            let line = |at: usize| 2.0 * (TAU * 7.3 * at as f64 / 100.0).sin();
            values.iter_mut().enumerate().for_each(|(at, value)| *value += line(at));
            let (found, corner_hz) = coefficients(&values, 0.01, 0.001).expect("noise");
            assert_eq!(corner_hz, f64::INFINITY);
            sums.iter_mut().zip(found).for_each(|(sum, value)| *sum += value.ln() / 8.0);
        }
        let ratios: Vec<f64> = sums.iter().zip(truth).map(|(sum, truth)| sum.exp() / truth).collect();
        let allowed = [0.02, 0.2, 0.2];
        assert!(ratios.iter().zip(allowed).all(|(ratio, allowed)| (ratio - 1.0).abs() < allowed), "{ratios:?}");
        assert_eq!(coefficients(&[1.0; 100], 0.01, 1.0), None);
    }
    /// The density is 2·N²/(1 + (f/f₀)²).
    #[test]
    fn the_filter_of_the_noise_is_found() {
        let (n, truth_hz) = (0.004, 45.0);
        for seed in 0..4 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let density = |frequency: f64| 2.0 * n * n / (1.0 + (frequency / truth_hz).powi(2));
            let values = gaussian_noise(density, 250.0, 12_000, &mut random);
            let ([found, ..], corner_hz) = coefficients(&values, 0.004, 1e-4).expect("noise");
            // The corners that are tried are 15 % apart.
            assert!((corner_hz / truth_hz).ln().abs() < 0.15, "{corner_hz}");
            assert!((found / n - 1.0).abs() < 0.1, "{found}");
        }
    }
}
