//! Figures of a report that have to agree with each other: the share of a covariate in the modelled curve, N by the fit and by
//! the spectrum, the measured curve and equation (5) on the measured spectrum, the largest deviation and the curve.

use measurement::adis16405::profile;
use measurement::{MeasuredChannel, Measurement};
use noise_analysis::analysis::analyze;
use noise_analysis::report::{ChannelReport, Report};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use simulation::Simulation;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

const SECONDS: f64 = 600.0;

/// Ten minutes of the paper's sensor, at 204.8 Hz.
fn recorded(seed: u64) -> Measurement {
    let recording = Simulation::paper(SECONDS, seed).run(|_| ()).expect("a simulation");
    recordings::time_base::measurement(&recording, None).expect("a time base")
}

fn channel<'a>(report: &'a Report, name: &str) -> &'a ChannelReport {
    report.channels.iter().find(|channel| channel.name == name).expect("a recorded channel")
}

#[test]
fn the_share_of_a_covariate_reaches_to_the_last_octave() {
    const SENSITIVITY: f64 = 0.05;
    let mut measurement = recorded(3);
    // The temperature goes up and down by 4 °C in a third of the record, and the gyro follows.
    let rate = measurement.sample_rate_hz;
    let profile =
        |name: &str| measurement.channels.iter().find(|of| of.profile.name == name).expect("recorded").profile;
    let (gyro, temperature) = (profile("gyro_x"), profile("temp"));
    let slots = measurement.slots.clone();
    let course = |slot: u64| 4.0 * (TAU * slot as f64 / rate / (SECONDS / 3.0)).sin();
    for of in &mut measurement.channels {
        let factor = match of.profile {
            profile if profile == gyro => SENSITIVITY / gyro.lsb,
            profile if profile == temperature => 1.0 / temperature.lsb,
            _ => continue,
        };
        for (slot, count) in slots.iter().zip(&mut of.counts) {
            *count += (factor * course(*slot)).round() as i32;
        }
    }
    let report = analyze(&measurement);
    let (gyro, temperature) = (channel(&report, "gyro_x"), channel(&report, "temp"));
    assert!(gyro.effects.iter().any(|shown| shown.effect.name() == "temperature"), "{:?}", gyro.effects);
    // Nearly all of the variance beyond a minute is the temperature's: β²·σ² at each octave. The sensitivity is measured to
    // a few percent, and the other terms add less than a tenth.
    let tail = gyro.curve.len() - 2..gyro.curve.len();
    for ((gyro, temperature), after) in
        gyro.curve.iter().zip(&temperature.curve).zip(&gyro.after.adev).skip(tail.start).take(tail.len())
    {
        let share = SENSITIVITY * temperature.adev;
        assert!((after / share - 1.0).abs() < 0.2, "{} s: {after} of {share}, measured {}", gyro.tau_s, gyro.adev);
    }
}

#[test]
fn the_largest_deviation_is_that_of_a_point_of_the_curve() {
    let report = analyze(&recorded(5));
    for of in &report.channels {
        for error in [&of.before.fitted, &of.before.unseen, &of.after.fitted, &of.after.unseen] {
            let (sigma, tau) = (error.worst_sigma.expect("octaves"), error.worst_tau_s.expect("octaves"));
            let ratio = error.worst_ratio.expect("octaves");
            assert!(of.curve.iter().any(|point| (point.tau_s / tau - 1.0).abs() < 1e-9), "{}: {tau} s", of.name);
            // A model above the measurement deviates downwards, but for the mean of the cube root, 1 − 2/9edf.
            assert!(sigma.abs() < 0.5 || (sigma < 0.0) == (ratio > 1.0), "{}: {sigma}, {ratio}", of.name);
        }
    }
}

/// White noise of 10 counts for a third of 600,000 samples, and of 20 counts then. The record is condensed, and the faster half of its
/// spectrum is that of all samples as the slower one is that of all means.
#[test]
fn the_spectrum_of_a_condensed_record_is_that_of_all_its_samples() {
    const SAMPLES: u64 = 600_000;
    const RATE_HZ: f64 = 204.8;
    let profile = profile(0.05);
    let mut random = ChaCha8Rng::seed_from_u64(17);
    let deviation = |slot: u64| if 3 * slot < SAMPLES { 10.0 } else { 20.0 };
    let count = |slot: u64| (deviation(slot) * random.sample::<f64, _>(StandardNormal)).round() as i32;
    let counts = (0..SAMPLES).map(count).collect();
    let gyro = MeasuredChannel::new(profile.channel("gyro_x").expect("a channel of the part"), counts);
    let report = analyze(&Measurement {
        profile,
        sample_rate_hz: RATE_HZ,
        stated_rate_hz: Some(RATE_HZ),
        slots: (0..SAMPLES).collect(),
        times_s: None,
        channels: [gyro].into_iter().collect(),
        dropped: BTreeMap::new(),
        flagged: BTreeMap::new(),
    });
    let spectrum = channel(&report, "gyro_x").figure_data.spectrum.as_ref().expect("a spectrum");
    // One-sided: 2σ²·dt, with the mean of the variances, and rounding's twelfth of a count.
    let expected = (2.0 * ((100.0 + 2.0 * 400.0) / 3.0 + 1.0 / 12.0) / RATE_HZ).sqrt() * 0.05;
    let (first, last): (Vec<_>, Vec<_>) =
        spectrum.frequency_hz.iter().zip(&spectrum.density).partition(|(frequency, _)| **frequency < 30.0);
    for (range, points) in [("slow", &first[first.len() - 30..]), ("fast", &last[..])] {
        // The mean of 15 points or more, each with half the relative error 1/√120 of a density by 64 segments: 1.2 %, or less.
        let mean = points.iter().map(|(_, density)| **density).sum::<f64>() / points.len() as f64;
        assert!(
            points.len() >= 15 && (mean / expected - 1.0).abs() < 0.05,
            "{range}: {mean} for {expected}, {}",
            points.len()
        );
    }
}
