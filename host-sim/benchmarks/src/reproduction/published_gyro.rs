//! Gyro z of the paper: coefficients, simulated record, true model, slope method.

use adis16405_driver::{Channel, GyroRange};
use allan_core::term::MovingAverageFilter;
use allan_core::{AllanPoint, Cascade, Curve, Model, NoiseTerm};
use std::f64::consts::{LN_2, PI};
use std::ops::RangeInclusive;
use virtual_sensor::{NoiseModel, OutputRegister, VirtualAdis16405};

/// N in deg/√s, B in deg/s and K in deg/s^1.5 of gyro z, as printed in the paper.
pub const TRUTH: [f64; 3] = [0.0368, 0.0093, 0.0013];
pub const RATE_HZ: f64 = 204.8;
/// Length of the record, s.
pub const SECONDS: f64 = 3600.0;
pub(super) const SAMPLES: u64 = (SECONDS * RATE_HZ) as u64;
pub(super) const OCTAVES: usize = 20;
/// Size of a count, deg/s.
pub(super) const LSB: f64 = Channel::GyroZ.lsb(GyroRange::Dps300);
/// Taps of each of the two averages of the sensor's default filter.
pub(super) const TAPS: u16 = 4;
/// SPI word that writes 7 to SMPL_PRD: 8 ticks of 1/1638.4 s.
const WRITE_SAMPLE_PERIOD: u16 = 0xB607;

/// Counts of [`LSB`] with the default filter at ±300 °/s.
pub(super) fn simulate_counts(seed: u64) -> Vec<i32> {
    let mut noise = NoiseModel::noiseless();
    let gyro = noise.channel_mut(OutputRegister::GyroZ);
    [gyro.angle_random_walk, gyro.bias_instability, gyro.rate_random_walk] = TRUTH;
    let mut sensor = VirtualAdis16405::new(noise, seed);
    sensor.select();
    sensor.transfer(WRITE_SAMPLE_PERIOD);
    sensor.deselect();
    let mut next = || {
        sensor.advance_to(sensor.next_data_ready());
        i32::from(sensor.counts()[OutputRegister::GyroZ as usize])
    };
    (0..SAMPLES).map(|_| next()).collect()
}

pub(super) fn allan_curve<const OVERLAP: usize>(counts: &[i32]) -> Curve<OCTAVES> {
    let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
    cascade.push_slice(counts);
    cascade.curve(1.0 / RATE_HZ).scaled(LSB)
}

/// The fitted terms: N behind the filter, B, K, and the rounding as white noise.
pub(super) fn fitted_terms() -> [NoiseTerm; 4] {
    [
        NoiseTerm::Filtered(MovingAverageFilter::bartlett(TAPS)),
        NoiseTerm::BiasInstability,
        NoiseTerm::RateRandomWalk,
        NoiseTerm::AngleRandomWalk,
    ]
}

/// The model of [`TRUTH`], with the rounding as N of `LSB·√(1/(12·RATE_HZ))`.
pub(super) fn true_model() -> Model {
    let rounding = LSB * (1.0 / RATE_HZ / 12.0).sqrt();
    let terms = fitted_terms()
        .into_iter()
        .zip(TRUTH.into_iter().chain([rounding]))
        .map(|(kind, value)| allan_core::model::FittedTerm::exact(kind, value));
    Model::new(1.0 / RATE_HZ, terms)
}

/// Averaging times for the slopes −½, 0 and +½ in the paper, s.
pub const INTERVALS: [RangeInclusive<f64>; 3] = [0.125..=2.0, 32.0..=128.0, 120.0..=230.0];

/// N, B and K by equations (7) to (9) of the paper, fitted to the logarithms: a line read at 1 s, a flat minimum over
/// 0.664, a line read at 3 s. `points` are averaging times in s with Allan deviations. A coefficient is `None` if no
/// point is in its interval.
pub fn slope_coefficients(points: impl Iterator<Item = (f64, f64)> + Clone) -> [Option<f64>; 3] {
    // These factors convert an Allan deviation at τ to a coefficient.
    let factors: [fn(f64) -> f64; 3] = [f64::sqrt, |_| (PI / (2.0 * LN_2)).sqrt(), |tau| (3.0 / tau).sqrt()];
    let mut factors = factors.into_iter();
    INTERVALS.map(|interval| {
        let factor = factors.next()?;
        let inside = points.clone().filter(|(tau, _)| interval.contains(tau));
        let (sum, count) =
            inside.fold((0.0, 0), |(sum, count), (tau, deviation)| (sum + (factor(tau) * deviation).ln(), count + 1));
        (count > 0).then(|| (sum / f64::from(count)).exp())
    })
}

pub(super) fn deviations(points: &[AllanPoint]) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
    points.iter().map(|point| (point.tau, point.avar.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pure_slopes_give_their_coefficients() {
        let taus = || (0..18).map(|octave| 2f64.powi(octave) / 204.8);
        let [n, ..] = slope_coefficients(taus().map(|tau| (tau, 0.5 / tau.sqrt())));
        let [_, b, _] = slope_coefficients(taus().map(|tau| (tau, 0.5 * 0.664)));
        let [.., k] = slope_coefficients(taus().map(|tau| (tau, 0.5 * (tau / 3.0).sqrt())));
        for (found, within) in [(n, 1e-12), (b, 1e-3), (k, 1e-12)] {
            assert!((found.expect("octaves") / 0.5 - 1.0).abs() < within, "{found:?}");
        }
        assert_eq!(slope_coefficients([(1000.0, 1.0)].into_iter()), [None; 3]);
    }
}
