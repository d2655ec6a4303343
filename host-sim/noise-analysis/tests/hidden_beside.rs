//! Effects that something else in the record hides or imitates: what is slow beside a sinusoid, and knocks that are over in half a second.

use measurement::adis16405::profile;
use measurement::{MeasuredChannel, Measurement};
use noise_analysis::analysis::analyze;
use noise_analysis::effects::Effect;
use noise_analysis::report::{ChannelReport, Report};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

fn record(rate_hz: f64, channels: &[(&str, Vec<f64>)]) -> Report {
    let profile = profile(0.05);
    let samples = channels[0].1.len() as u64;
    let channel = |(name, values): &(&str, Vec<f64>)| {
        let counts = values.iter().map(|value| value.round() as i32).collect();
        MeasuredChannel::new(profile.channel(name).expect("a channel of the part"), counts)
    };
    let channels = channels.iter().map(channel).collect();
    let measurement = Measurement {
        sample_rate_hz: rate_hz,
        stated_rate_hz: Some(rate_hz),
        slots: (0..samples).collect(),
        times_s: None,
        channels,
        dropped: BTreeMap::new(),
        flagged: BTreeMap::new(),
        profile,
    };
    analyze(&measurement)
}

fn kinds(channel: &ChannelReport) -> Vec<&'static str> {
    channel.effects.iter().map(|shown| shown.effect.name()).collect()
}

/// White noise of 20 counts at 100 Hz for half an hour, with a random walk of 0.004 counts a sample.
fn noise(random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut bias = 0.0;
    let value = |_| {
        bias += 0.004 * random.sample::<f64, _>(StandardNormal);
        bias + 20.0 * random.sample::<f64, _>(StandardNormal)
    };
    (0..180_000).map(value).collect()
}

/// A sinusoid of 60 counts and 0.15 Hz is in the means of 14 s with up to 60/(π·0.15·14) = 9 counts, where white noise has 20/√1400 =
/// 0.5. A step of 8 counts, and 5 counts that follow the temperature, are below the one and far above the other.
#[test]
fn a_step_and_a_temperature_are_found_beside_a_sinusoid() {
    for seed in 0..3 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut own = noise(&mut random);
        own.iter_mut().enumerate().for_each(|(at, value)| *value += 60.0 * (TAU * 0.15 * 0.01 * at as f64).sin());
        let mut stepped = own.clone();
        stepped[100_000..].iter_mut().for_each(|value| *value += 8.0);
        let report = record(100.0, &[("gyro_x", stepped)]);
        let found = kinds(&report.channels[0]);
        assert!(found.contains(&"sinusoid") && found.contains(&"bias_step"), "seed {seed}: {found:?}");
        // A period of 25 min, in counts of 0.14 °C.
        let temperature: Vec<f64> =
            (0..180_000).map(|at| 5.0 / 0.14 * (TAU * 0.01 * f64::from(at) / 1500.0).sin()).collect();
        own.iter_mut().zip(&temperature).for_each(|(value, temperature)| *value += 0.14 * temperature);
        let report = record(100.0, &[("gyro_x", own), ("temp", temperature)]);
        let found = kinds(&report.channels[0]);
        assert!(found.contains(&"sinusoid") && found.contains(&"temperature"), "seed {seed}: {found:?}");
    }
}

/// Half a second of five forms, 60 times the noise, in a record that is kept and in one that is condensed: one knock, no spikes, and
/// nothing that the rest of the record is taken for. Its time is that of the form within the stretch in which that decays.
///
/// The limit: half a sine and a rectangle are told in the longer record alone. In ten minutes they have 1.5 and 3 times the energy of
/// the noise (102 samples of 60²/2 or 60² against 120,000 of 1). The interpolation follows what has `E` times the energy of the noise in
/// all 12 neighbours, but for `1/(1 + 12E)`: it leaves less than 60/19 = 3.2 standard deviations, which do not stand out.
#[test]
fn half_a_second_is_a_knock() {
    const RATE_HZ: f64 = 204.8;
    type Form = fn(f64, f64) -> f64;
    let oscillations: [(&str, Form); 3] = [
        ("a damped oscillation", |time_s, _| (-time_s / 0.1).exp() * (TAU * 20.0 * time_s).sin()),
        ("an oscillation", |time_s, _| (TAU * 12.0 * time_s).sin()),
        ("a burst of noise", |_, normal| normal),
    ];
    let pulses: [(&str, Form); 2] =
        [("half a sine", |time_s, _| (PI * time_s / 0.5).sin()), ("a rectangle", |_, _| 1.0)];
    for (samples, pulses) in [(120_000, &[][..]), (400_000, &pulses[..])] {
        for (number, (name, form)) in oscillations.iter().chain(pulses).enumerate() {
            let mut random = ChaCha8Rng::seed_from_u64(number as u64);
            let starts = samples / 3;
            let value = |at: usize| {
                let normal = random.sample::<f64, _>(StandardNormal);
                let time_s = (at as f64 - starts as f64) / RATE_HZ;
                let knock = if (0.0..0.5).contains(&time_s) { form(time_s, normal) } else { 0.0 };
                20.0 * (random.sample::<f64, _>(StandardNormal) + 60.0 * knock)
            };
            let values: Vec<f64> = (0..samples).map(value).collect();
            let report = record(RATE_HZ, &[("gyro_x", values)]);
            let channel = &report.channels[0];
            let found = kinds(channel);
            assert_eq!(found, ["knock"], "{name}, {samples} samples");
            let Effect::NoisyInterval(knock) = &channel.effects[0].effect else { panic!("a knock") };
            let start_s = starts as f64 / RATE_HZ;
            let (from, to) = (knock.from_s.value - start_s, knock.to_s.value - start_s);
            assert!((-0.05..0.3).contains(&from) && (0.2..0.6).contains(&to), "{name}: {from} s to {to} s");
        }
    }
}

/// A damped oscillation of 60 times the noise in one channel, of 8 times in another, where single samples stand out of it, and ten
/// spikes of 12 times the noise in a third: a knock in two channels, and spikes where they are.
#[test]
fn what_stands_out_during_a_knock_of_another_channel_is_the_knock() {
    const RATE_HZ: f64 = 100.0;
    const SAMPLES: usize = 60_000;
    const START: usize = 20_000;
    for seed in 0..3 {
        let channel = |knock: f64, spikes: usize| -> Vec<f64> {
            let mut random = ChaCha8Rng::seed_from_u64(seed + (knock as u64) + 100 * spikes as u64);
            let value = |at: usize| {
                let time_s = (at as f64 - START as f64) / RATE_HZ;
                let decay = if time_s < 0.0 { 0.0 } else { (-time_s / 0.1).exp() * (TAU * 20.0 * time_s).sin() };
                let is_spike = spikes > 0 && at % (SAMPLES / spikes) == 5_000;
                20.0 * (random.sample::<f64, _>(StandardNormal) + knock * decay + if is_spike { 12.0 } else { 0.0 })
            };
            (0..SAMPLES).map(value).collect()
        };
        let channels = [("gyro_x", channel(60.0, 0)), ("gyro_y", channel(8.0, 0)), ("gyro_z", channel(0.0, 10))];
        let report = record(RATE_HZ, &channels);
        let found: Vec<Vec<&str>> = report.channels.iter().map(kinds).collect();
        assert_eq!(found, [["knock"], ["knock"], ["spikes"]], "seed {seed}");
    }
}
