//! Regression on covariates, on simulated channels with known sensitivities.

use crate::simulation::{Noise, PERIOD};
use allan_core::regression::{CovarianceCurve, Covariate, CovariateRegression, Sensitivity};
use allan_core::term::{Markov, NoiseTerm};
use allan_core::{Cascade, Coupling, Curve};

const OCTAVES: usize = 18;
const SAMPLES: usize = 1 << 16;
/// Unit to a count of every channel.
const LSB: f64 = 1e-4;

type Estimator = Cascade<OCTAVES, 8>;

/// Curves of channels that are sampled together, and the covariances of each with those before it.
fn measured(channels: &[Vec<f64>]) -> (Vec<Curve<OCTAVES>>, Vec<CovarianceCurve<OCTAVES>>) {
    let mut cascades = vec![Estimator::new(); channels.len()];
    let mut couplings = vec![Coupling::<OCTAVES>::new(); channels.len() * (channels.len() - 1) / 2];
    for k in 0..SAMPLES {
        for (cascade, channel) in cascades.iter_mut().zip(channels) {
            cascade.push((channel[k] / LSB).round() as i32);
        }
        for i in 1..channels.len() {
            for j in 0..i {
                couplings[i * (i - 1) / 2 + j].observe(&cascades[i], &cascades[j]);
            }
        }
    }
    let curves = cascades.iter().map(|cascade| cascade.curve(PERIOD).scaled(LSB)).collect();
    let in_units = |coupling: &Coupling<OCTAVES>| {
        let mut points = coupling.points();
        points.iter_mut().for_each(|point| point.covariance *= LSB * LSB);
        points
    };
    (curves, couplings.iter().map(in_units).collect())
}

/// Covariance of the channel, which comes first, or of a covariate with a covariate.
fn covariance(shared: &[CovarianceCurve<OCTAVES>], with: Option<usize>, covariate: usize, n: u64) -> Option<f64> {
    let (a, b) = (with.map_or(0, |other| other + 1), covariate + 1);
    let (high, low) = (a.max(b), a.min(b));
    let points = &shared[high * (high - 1) / 2 + low];
    points.iter().find(|point| point.n == n).map(|point| point.covariance)
}

/// The significant sensitivities of the first channel to the others.
fn sensitivities(channels: &[Vec<f64>]) -> Vec<Sensitivity> {
    let (curves, shared) = measured(channels);
    let covariates: Vec<Covariate<OCTAVES>> = curves[1..].iter().map(|curve| Covariate::new(curve, LSB, 1)).collect();
    let covariance = |a: Option<usize>, b: usize, n: u64| covariance(&shared, a, b, n);
    let regression = CovariateRegression { channel: &curves[0], covariates: &covariates, covariance: &covariance };
    regression.sensitivities().into_iter().collect()
}

/// The curve of a stream from which multiples of covariates are subtracted sample by sample equals the calculated one.
#[test]
fn the_curve_after_subtracting_covariates_is_exact() {
    let mut noise = Noise::new(7);
    let channels = [rest(&mut noise), slow_covariate(&mut noise, 0.3).1, slow_covariate(&mut noise, 0.2).1];
    let count = |channel: &[f64], k: usize| (channel[k] / LSB).round();
    let rest_of_stream: Vec<f64> = (0..SAMPLES)
        .map(|k| LSB * (count(&channels[0], k) - 3.0 * count(&channels[1], k) + 2.0 * count(&channels[2], k)))
        .collect();
    let (curves, shared) = measured(&channels);
    let (expected, _) = measured(&[rest_of_stream, channels[0].clone()]);
    let covariates: Vec<Covariate<OCTAVES>> =
        curves[1..].iter().map(|curve| Covariate::as_measured(curve, 1)).collect();
    let known = |a: Option<usize>, b: usize, n: u64| covariance(&shared, a, b, n);
    let regression = CovariateRegression { channel: &curves[0], covariates: &covariates, covariance: &known };
    let mut subtracted = curves[0].clone();
    regression.subtract_from(&mut subtracted, &[Sensitivity::exact(0, 3.0), Sensitivity::exact(1, -2.0)]);
    for (found, expected) in subtracted.points().iter().zip(expected[0].points()) {
        // The calculation subtracts sums 10⁴ times as large.
        assert!((found.avar / expected.avar - 1.0).abs() < 1e-9, "{found:?}, {expected:?}");
    }
    // If a covariance is not known, nothing is subtracted.
    let short = [Covariate::<OCTAVES>::as_measured(&curves[1], 256)];
    let regression = CovariateRegression { channel: &curves[0], covariates: &short, covariance: &known };
    let mut subtracted = curves[0].clone();
    regression.subtract_from(&mut subtracted, &[Sensitivity::exact(0, 3.0)]);
    for (found, raw) in subtracted.points().iter().zip(curves[0].points()) {
        assert_eq!(found.avar == raw.avar, found.n < 256, "{found:?}");
    }
}

fn rest(noise: &mut Noise) -> Vec<f64> {
    noise.sum(SAMPLES, &[(NoiseTerm::AngleRandomWalk, 0.05), (NoiseTerm::RateRandomWalk, 0.002)])
}

/// A slowly varying quantity such as a temperature, and its measurement with white noise.
fn slow_covariate(noise: &mut Noise, deviation: f64) -> (Vec<f64>, Vec<f64>) {
    let slow = noise.sum(SAMPLES, &[(NoiseTerm::Markov(Markov { time_constant: 40.0 }), deviation)]);
    let seen = slow.iter().map(|value| value + 0.2 * noise.normal()).collect();
    (slow, seen)
}

#[test]
fn sensitivities_to_noisy_covariates_are_unbiased() {
    const RECORDS: u64 = 40;
    let truth = [0.05, -0.03];
    let mut standardised = Vec::new();
    for seed in 0..RECORDS {
        let mut noise = Noise::new(seed);
        let (first, first_seen) = slow_covariate(&mut noise, 3.0);
        let (second, second_seen) = slow_covariate(&mut noise, 3.0);
        let mut channel = rest(&mut noise);
        let covariates = first.iter().zip(&second);
        channel.iter_mut().zip(covariates).for_each(|(y, (a, b))| *y += truth[0] * a + truth[1] * b);
        let mut found = sensitivities(&[channel, first_seen, second_seen]);
        found.sort_by_key(|of| of.covariate);
        assert_eq!(found.iter().map(|of| of.covariate).collect::<Vec<_>>(), [0, 1], "seed {seed}");
        for (of, truth) in found.iter().zip(truth) {
            standardised.push((of.value - truth) / of.error);
            assert!((of.value / truth - 1.0).abs() < 0.15, "seed {seed}: {of:?}");
        }
    }
    let count = standardised.len() as f64;
    let mean = standardised.iter().sum::<f64>() / count;
    let deviation = (standardised.iter().map(|z| z * z).sum::<f64>() / count).sqrt();
    // Four standard deviations of a mean of 80; the stated errors may be off by a third, as the octaves'
    // correlations are those of pure noises.
    assert!(mean.abs() < 4.0 / count.sqrt(), "{mean}");
    assert!((0.5..1.5).contains(&deviation), "{deviation}");
}

/// N, B and K do not fit noise after a filter, so the octaves are weighted by their measured variances. A matched filter
/// would determine the sensitivity to 0.0195: the root of N²/PERIOD over the sum of the squares of the force.
#[test]
fn a_sensitivity_is_found_in_filtered_noise() {
    let truth = 0.25;
    for seed in 0..20 {
        let mut noise = Noise::new(1300 + seed);
        let force = noise.sum(SAMPLES, &[(NoiseTerm::Markov(Markov { time_constant: 4.0 }), 0.1)]);
        let seen: Vec<f64> = force.iter().map(|force| force + 0.003 * noise.normal()).collect();
        let own = rest(&mut noise);
        let channel: Vec<f64> = own.iter().zip(&force).map(|(own, force)| own + truth * force).collect();
        let found = sensitivities(&[averaged(&averaged(&channel)), averaged(&averaged(&seen))]);
        let [of] = found[..] else { panic!("seed {seed}: {found:?}") };
        assert!((of.value - truth).abs() < 4.0 * of.error && of.error < 3.0 * 0.0195, "seed {seed}: {of:?}");
    }
}

/// Means of each value and the three before it.
fn averaged(values: &[f64]) -> Vec<f64> {
    (0..values.len()).map(|at| (0..4).map(|lag| values[at.saturating_sub(lag)]).sum::<f64>() / 4.0).collect()
}

/// Two random walks that are similar by chance, and a covariate that varies less than its measurement noise.
#[test]
fn independent_channels_have_no_significant_sensitivity() {
    let walk = [(NoiseTerm::RateRandomWalk, 0.1), (NoiseTerm::AngleRandomWalk, 0.01)];
    let still = [(NoiseTerm::AngleRandomWalk, 0.05), (NoiseTerm::RateRandomWalk, 0.001)];
    for kinds in [walk.as_slice(), still.as_slice()] {
        // The probability of a significant sensitivity is 2 in 10,000 pairs, or 2 % for this test.
        for seed in 0..60 {
            let mut noise = Noise::new(900 + seed);
            let (own, other) = (noise.sum(SAMPLES, kinds), noise.sum(SAMPLES, kinds));
            assert!(sensitivities(&[own, other]).is_empty(), "seed {seed}");
        }
    }
}
