//! The noise source against the Allan variance of each coefficient, and the digital filter against its impulse
//! response.

use virtual_sensor::{CascadedBoxFilter, NoiseModel, NoiseSource, OutputRegister};

const SAMPLES: usize = 1 << 14;
const SEEDS: u64 = 60;

/// Allan variance at averaging factor `n` by its definition (IEEE Std 952), sample period 1 s, no overlap.
fn allan_variance(values: &[f64], n: usize) -> f64 {
    let means: Vec<f64> = values.chunks_exact(n).map(|chunk| chunk.iter().sum::<f64>() / n as f64).collect();
    let differences = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2));
    differences.sum::<f64>() / (2.0 * (means.len() - 1) as f64)
}

/// The mean over the seeds, and its standard error.
fn mean_allan_variance(model: &NoiseModel, n: usize) -> (f64, f64) {
    let variances: Vec<f64> = (0..SEEDS)
        .map(|seed| {
            let mut source = NoiseSource::new(model, seed, 1.0);
            let values: Vec<f64> = (0..SAMPLES).map(|_| source.sample()[OutputRegister::GyroX as usize]).collect();
            allan_variance(&values, n)
        })
        .collect();
    let mean = variances.iter().sum::<f64>() / SEEDS as f64;
    let spread = variances.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (SEEDS - 1) as f64;
    (mean, (spread / SEEDS as f64).sqrt())
}

fn check(model: &NoiseModel, n: usize, expected: f64, bias: f64) {
    let (mean, error) = mean_allan_variance(model, n);
    assert!(
        (mean - expected).abs() < 5.0 * error + bias * expected,
        "n = {n}: {mean:e} ± {error:e}, expected {expected:e}"
    );
}

#[test]
fn each_coefficient_gives_its_allan_variance() {
    let mut model = NoiseModel::noiseless();
    let gyro = model.channel_mut(OutputRegister::GyroX);
    gyro.angle_random_walk = 2.0;
    for n in [1, 16, 128] {
        check(&model, n, 4.0 / n as f64, 0.0);
    }

    let mut model = NoiseModel::noiseless();
    model.channel_mut(OutputRegister::GyroX).rate_random_walk = 0.5;
    for n in [1, 16, 128] {
        // A continuous walk has K²τ/3; sampling at n points gives a factor 1 + 1/(2n²).
        let tau = n as f64;
        check(&model, n, 0.25 * tau / 3.0 * (1.0 + 0.5 / (tau * tau)), 0.0);
    }

    let mut model = NoiseModel::noiseless();
    model.channel_mut(OutputRegister::GyroX).bias_instability = 3.0;
    for n in [32, 256] {
        // Processes an octave apart ripple by less than 1 %. Processes shorter than the sample period, and aliasing,
        // are missing: about 1/n each.
        let expected = 9.0 * 2.0 * std::f64::consts::LN_2 / std::f64::consts::PI;
        check(&model, n, expected, 0.01 + 2.0 / n as f64);
    }
}

#[test]
fn channels_and_seeds_are_independent_and_repeatable() {
    let model = NoiseModel::paper();
    let first: Vec<_> = (0..3).map(|seed| NoiseSource::new(&model, seed, 1.0).sample()).collect();
    assert_eq!(first[0], NoiseSource::new(&model, 0, 1.0).sample());
    assert_ne!(first[0], first[1]);
    assert_ne!(first[0][OutputRegister::GyroX as usize], first[0][OutputRegister::GyroY as usize]);

    let mut quiet = model.clone();
    *quiet.channel_mut(OutputRegister::GyroX) = Default::default();
    let changed = NoiseSource::new(&quiet, 0, 1.0).sample();
    assert_eq!(changed[OutputRegister::GyroY as usize], first[0][OutputRegister::GyroY as usize]);
}

#[test]
fn the_impulse_response_of_the_filter_is_a_triangle() {
    let mut filter = CascadedBoxFilter::new(2);
    filter.filter(0.0);
    let response: Vec<f64> = (0..10).map(|k| 16.0 * filter.filter(if k == 0 { 1.0 } else { 0.0 })).collect();
    // The filter has 2N + 1 taps with a phase of N samples (data sheet Rev. B, Figure 15), N = 4; a Bartlett window
    // begins and ends with 0.
    assert_eq!(response, [0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0, 0.0]);
}

#[test]
fn a_filter_of_one_tap_delays_by_its_phase_of_one_sample() {
    let mut filter = CascadedBoxFilter::new(0);
    assert_eq!([3.0, -1.0, 0.25].map(|value| filter.filter(value)), [3.0, 3.0, -1.0]);
}

#[test]
fn a_constant_passes_the_filter_from_the_first_sample() {
    let mut filter = CascadedBoxFilter::new(6);
    assert_eq!([0.1; 200].map(|value| (filter.filter(value) - 0.1).abs() < 1e-15), [true; 200]);
}
