//! Recordings of several sensors.

use benchmarks::undeclared::NoiseRecording;
use measurement::{Measurement, Quantity};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt::Write;

fn means(of: &Measurement, quantity: Quantity) -> Vec<f64> {
    let mean = |counts: &[i32]| counts.iter().map(|&count| f64::from(count)).sum::<f64>() / counts.len() as f64;
    let channels = of.channels.iter().filter(|channel| channel.profile.quantity == quantity);
    channels.map(|channel| channel.profile.lsb * mean(&channel.counts)).collect()
}

/// The file has 10,000 rows at 100 Hz, and the sensor turns in the first 3,000. Gravity shows that the units are m/s²
/// and rad/s.
#[test]
fn units_are_guessed_and_what_moves_is_left_out() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut text = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n".to_owned();
    for row in 0..10_000 {
        let mut noise = |size: f64| size * (random.random::<f64>() + random.random::<f64>() - 1.0);
        let turn = if row < 3_000 { 0.5 * (f64::from(row) / 100.0).sin() } else { 0.0 };
        let rates = [noise(0.003), 0.01 + noise(0.003), turn + noise(0.003)];
        let forces = [noise(0.05), noise(0.05), 9.81 + noise(0.05)];
        let [[gx, gy, gz], [ax, ay, az]] = [rates, forces];
        writeln!(text, "{:.2},{gx:.5},{gy:.5},{gz:.5},{ax:.4},{ay:.4},{az:.4}", f64::from(row) / 100.0)
            .expect("memory");
    }
    let dir = tempfile::tempdir().expect("a folder");
    let file = dir.path().join("table.csv");
    std::fs::write(&file, text).expect("written");
    let NoiseRecording { name, samples } = NoiseRecording::read(&file, None).expect("a recording");
    assert_eq!(name, "table.csv");
    assert!((samples.sample_rate_hz - 100.0).abs() < 1e-3, "{} Hz", samples.sample_rate_hz);
    assert!((7_000 - 2 * 256..=7_000).contains(&samples.len()), "{} samples", samples.len());
    // The rate of 0.01 rad/s is known to 0.03 mrad/s.
    let rates = means(&samples, Quantity::AngularRate);
    assert!((rates[1] - 0.01_f64.to_degrees()).abs() < 0.006 && rates[2].abs() < 0.006, "{rates:?} °/s");
    assert!((means(&samples, Quantity::SpecificForce)[2] - 9.81 / 9.80665).abs() < 1e-3);
}

/// Rates, samples and gyroscopes are those of the files' descriptions. Gravity within the scale error shows that the
/// units are right.
#[test]
fn recordings_of_other_sensors_are_read_where_they_are_at_rest() {
    let test = "recordings_of_other_sensors_are_read_where_they_are_at_rest";
    for (file, rate_hz, samples, has_force) in [
        ("mpu9250_imu1_raw.mat", 43.05, 41_671, true),
        ("mpu9250_imu2_raw.mat", 43.05, 41_671, true),
        ("phone_gyro4.txt", 5.0, 38_577, false),
        ("vn100_nitin.bag", 40.0, 13_217, true),
        ("px4_sample.ulg", 250.0, 17_070 - 8 * 250 - 51, true),
        ("stampfly_fft_20260114T115628.csv", 400.0, 12_000, true),
    ] {
        let Some(path) = system_tests::recording(test, &format!("others/{file}")) else { return };
        let NoiseRecording { name, samples: read } = NoiseRecording::read(&path, None).expect("a recording");
        assert_eq!(name, file);
        assert!((read.sample_rate_hz / rate_hz - 1.0).abs() < 0.01, "{file}: {} Hz", read.sample_rate_hz);
        // Up to 2 % of the phone's rows may be repeated.
        assert!((read.len() as f64 / f64::from(samples) - 1.0).abs() < 0.03, "{file}: {} samples", read.len());
        let [rates, forces] = [Quantity::AngularRate, Quantity::SpecificForce].map(|quantity| means(&read, quantity));
        // The sensors are uncalibrated, with biases of a few °/s.
        assert!(rates.len() == 3 && rates.iter().all(|rate| rate.abs() < 5.0), "{file}: {rates:?} °/s");
        assert_eq!(forces.len(), if has_force { 3 } else { 0 }, "{file}");
        let norm = forces.iter().map(|force| force * force).sum::<f64>().sqrt();
        assert!(!has_force || (norm - 1.0).abs() < 0.2, "{file}: {norm} g");
    }
}
