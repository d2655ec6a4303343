//! What the first half of a recording alone foretells of the second: no model of it depends on the second half, and spikes and knocks
//! that are left out of the coefficients are foretold all the same.

use measurement::adis16405::profile;
use measurement::{MeasuredChannel, Measurement};
use noise_analysis::analysis::analyze;
use noise_analysis::report::{ChannelReport, ModelErrorReport};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

const RATE_HZ: f64 = 100.0;
/// Samples of a half: nearly 11 minutes.
const HALF: usize = 1 << 16;
/// Standard deviation of the white noise, counts.
const NOISE: f64 = 20.0;

/// Counts of a gyroscope from the values of both halves.
fn report(first: &[f64], second: &[f64]) -> ChannelReport {
    let profile = profile(0.05);
    let gyro = profile.channel("gyro_x").expect("a channel of the part");
    let counts: Vec<i32> = first.iter().chain(second).map(|value| value.round() as i32).collect();
    let measurement = Measurement {
        profile,
        sample_rate_hz: RATE_HZ,
        stated_rate_hz: Some(RATE_HZ),
        slots: (0..counts.len() as u64).collect(),
        times_s: None,
        channels: vec![MeasuredChannel::new(gyro, counts)],
        dropped: BTreeMap::new(),
        flagged: BTreeMap::new(),
    };
    analyze(&measurement).channels.into_iter().next().expect("one channel was recorded")
}

fn white(random: &mut ChaCha8Rng, deviation: f64) -> Vec<f64> {
    (0..HALF).map(|_| deviation * random.sample::<f64, _>(StandardNormal)).collect()
}

/// Adds spikes of 30 to 90 times the noise at random, one in `every` samples.
fn add_spikes(random: &mut ChaCha8Rng, values: &mut [f64], every: usize) {
    for _ in 0..values.len() / every {
        let size = NOISE * random.random_range(30.0..90.0) * if random.random() { 1.0 } else { -1.0 };
        let at = random.random_range(0..values.len());
        values[at] += size;
    }
}

/// Adds bursts of half a second of noise of 30 to 90 times the noise, so many.
fn add_bursts(random: &mut ChaCha8Rng, values: &mut [f64], bursts: usize) {
    const LENGTH: usize = 50;
    for _ in 0..bursts {
        let size = NOISE * random.random_range(30.0..90.0);
        let at = random.random_range(0..values.len() - LENGTH);
        values[at..at + LENGTH].iter_mut().for_each(|value| *value += size * random.sample::<f64, _>(StandardNormal));
    }
}

/// The first half has spikes, a burst of noise and a drift. Second halves of stronger noise with a step and a ramp, of hardly any noise,
/// and of spikes alone leave every number of its models as it is.
#[test]
fn no_parameter_of_the_first_half_s_models_depends_on_the_second_half() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut first = white(&mut random, NOISE);
    add_spikes(&mut random, &mut first, 3000);
    add_bursts(&mut random, &mut first, 1);
    first.iter_mut().enumerate().for_each(|(at, value)| *value += 30.0 * (at as f64 / HALF as f64).powi(2));
    let same = white(&mut random, NOISE);
    let mut step = white(&mut random, 3.0 * NOISE);
    step.iter_mut().enumerate().for_each(|(at, value)| *value += if at > HALF / 3 { 900.0 } else { 0.02 * at as f64 });
    let quiet = white(&mut random, 0.1 * NOISE);
    let mut spikes = white(&mut random, NOISE);
    add_spikes(&mut random, &mut spikes, 300);
    add_bursts(&mut random, &mut spikes, 20);
    let expected = report(&first, &same);
    let events = expected.after.events.as_ref().expect("spikes and a burst");
    assert!(events.count > 10, "{events:?}");
    for (name, second) in [("a step", step), ("hardly any noise", quiet), ("spikes", spikes)] {
        let found = report(&first, &second);
        assert_eq!(found.before.terms, expected.before.terms, "{name}");
        assert_eq!(found.after.terms, expected.after.terms, "{name}");
        assert_eq!(found.after.fitted, expected.after.fitted, "{name}");
        assert_eq!(found.after.events, expected.after.events, "{name}");
    }
}

/// Twenty-one spikes a half, or twelve bursts: N, B and K of the first half have them as white noise, which a burst of half a second is
/// not at half a second and longer. With the events the model foretells the second half as recorded, within what the scatter of their
/// number and size leaves: the deviance a point is 1 for a true model, and from 3 on a model fails.
#[test]
fn spikes_and_bursts_are_foretold_at_the_rate_of_the_first_half() {
    for seed in 0..10 {
        for bursts in [false, true] {
            let mut random = ChaCha8Rng::seed_from_u64(100 + seed);
            let mut half = || {
                let mut values = white(&mut random, NOISE);
                if bursts {
                    add_bursts(&mut random, &mut values, 12);
                } else {
                    add_spikes(&mut random, &mut values, 3000);
                }
                values
            };
            let channel = report(&half(), &half());
            let deviance = |error: &ModelErrorReport| error.deviance_per_point.expect("octaves");
            let (before, after) = (deviance(&channel.before.unseen), deviance(&channel.after.unseen));
            let events = channel.after.events.as_ref().expect("events");
            assert!(events.count >= 10, "seed {seed}, bursts {bursts}: {events:?}");
            assert!(after <= before.max(3.0), "seed {seed}, bursts {bursts}: {before} → {after}, {events:?}");
        }
    }
}

/// Allan deviation by definition: σ²(nτ₀) is half the mean square of the differences of neighbouring means of n samples.
#[test]
fn the_curve_of_the_unseen_half_is_that_of_its_samples() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let first = white(&mut random, NOISE);
    let mut second = white(&mut random, 3.0 * NOISE);
    add_spikes(&mut random, &mut second, 3000);
    let report = report(&first, &second);
    let counts: Vec<f64> = second.iter().map(|value| value.round()).collect();
    let squares: f64 = counts.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
    let expected = 0.05 * (0.5 * squares / (HALF - 1) as f64).sqrt();
    assert!((report.unseen_adev[0] / expected - 1.0).abs() < 1e-9, "{} and {expected}", report.unseen_adev[0]);
    // The whole record has twice as many samples, and one octave more.
    assert_eq!(report.unseen_adev.len() + 1, report.curve.len());
}

/// Of the 95 % bounds of N, B and K of the model `after`, how many hold: N is that of [`NOISE`], B and K are 0.
fn held(channel: &ChannelReport) -> usize {
    let bounds = |kind: &str| {
        let term = channel.after.terms.iter().find(|term| term.kind() == kind);
        term.map_or((0.0, 0.0), |term| (term.coefficient().low, term.coefficient().high))
    };
    let (low, high) = bounds("angle_random_walk");
    let is_n = (low..=high).contains(&(0.05 * NOISE / RATE_HZ.sqrt()));
    usize::from(is_n) + ["bias_instability", "rate_random_walk"].iter().filter(|kind| bounds(kind).0 == 0.0).count()
}

/// A sawtooth and a pulse of 2 s, of half the noise and every 20 s, and a line of a fifth of the noise from 2 Hz in the beginning to 12 Hz at the
/// end: their share is foretold, the frequencies of the line as they go on. The deviance a point is 1 for a true model. That of the first
/// half's own curve, which scatters as the second half does, is 2, and by chance several times that: a model may leave half more.
#[test]
fn signals_of_the_first_half_are_foretold() {
    const SEEDS: u64 = 6;
    let sawtooth = |time_s: f64| 0.5 * NOISE * (time_s / 20.0).fract();
    let pulse = |time_s: f64| if (time_s / 20.0).fract() < 0.1 { -0.5 * NOISE } else { 0.0 };
    let seconds = 2.0 * HALF as f64 / RATE_HZ;
    let chirp = |time_s: f64| 0.2 * NOISE * (TAU * (2.0 + 5.0 * time_s / seconds) * time_s).sin();
    let signals: [(&str, &dyn Fn(f64) -> f64); 3] = [("sawtooth", &sawtooth), ("pulse", &pulse), ("chirp", &chirp)];
    for (name, signal) in signals {
        let mut bounds_held = 0;
        for seed in 0..SEEDS {
            let mut random = ChaCha8Rng::seed_from_u64(200 + seed);
            let mut values = [white(&mut random, NOISE), white(&mut random, NOISE)].concat();
            values.iter_mut().enumerate().for_each(|(at, value)| *value += signal(at as f64 / RATE_HZ));
            let (first, second) = values.split_at(HALF);
            let channel = report(first, second);
            let deviance = |error: &ModelErrorReport| error.deviance_per_point.expect("octaves");
            let (after, curve) = (deviance(&channel.after.unseen), deviance(&channel.first_half_curve));
            // The curve of a line that runs is one of other frequencies.
            let curve = if name == "chirp" { 2.0 } else { curve.max(2.0) };
            assert!(after <= 1.5 * curve, "{name}, seed {seed}: {after} {curve}");
            bounds_held += held(&channel);
        }
        // Of 18 intervals of 95 % fewer than 13 hold in one of 3,000 cases.
        assert!(bounds_held >= 13, "{name}: {bounds_held}");
    }
}
