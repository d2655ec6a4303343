//! Recordings of the same and of different noise: how often they are told apart, and the interval of an inflation.

use measurement::{MeasuredChannel, Measurement, adis16405};
use noise_analysis::report::several::{IncomparableRecordings, compare, inflation};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::BTreeMap;

const RATE_HZ: f64 = 100.0;

/// A recording of gyro x: white noise and a random walk, standard deviations of a sample and of a step in counts.
fn recording(samples: usize, white: f64, walk: f64, seed: u64) -> Measurement {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut bias = 0.0;
    let mut count = || {
        let [noise, step]: [f64; 2] = std::array::from_fn(|_| random.sample(StandardNormal));
        bias += walk * step;
        (bias + white * noise).round() as i32
    };
    let profile = adis16405::profile(0.05);
    let gyro = profile.channel("gyro_x").expect("a gyro");
    Measurement {
        channels: vec![MeasuredChannel::new(gyro, (0..samples).map(|_| count()).collect())],
        profile,
        sample_rate_hz: RATE_HZ,
        stated_rate_hz: Some(RATE_HZ),
        slots: (0..samples as u64).collect(),
        times_s: None,
        dropped: BTreeMap::new(),
        flagged: BTreeMap::new(),
    }
}

/// 200 pairs and triples of the same noise, white and with a random walk: at a level of 5 %, ten of 200 with a standard
/// deviation of 3.1 are said to differ. The bounds are four of these, as the approximations may be off by a little.
#[test]
fn recordings_of_the_same_noise_differ_as_often_as_the_level_says() {
    for (walk, count) in [(0.0, 2), (0.3, 2), (0.1, 3)] {
        let differs = |seed: &u64| {
            let all: Vec<Measurement> =
                (0..count).map(|number| recording(8192, 20.0, walk, 10 * seed + number)).collect();
            let agreement = compare(&all).expect("comparable");
            agreement.channels[0].p_value.expect("enough samples") < 0.05
        };
        let found = (0..200).filter(differs).count();
        assert!((1..=22).contains(&found), "walk {walk}: {found} of 200");
    }
}

/// White noise that is 10 % larger: 16,384 samples give the variance a relative standard deviation of √(2/10,923) = 1.4 %, that
/// of the ratio 1.9 %; 21 % are eleven of them.
#[test]
fn different_noise_is_told_and_the_joint_model_is_that_of_all() {
    let [one, other, louder] =
        [(1, 20.0), (2, 20.0), (3, 22.0)].map(|(seed, white)| recording(16_384, white, 0.0, seed));
    let same = &compare(&[one.clone(), other]).expect("comparable").channels[0];
    assert!(same.agree, "{same:?}");
    // N = 20 counts of 0.05 deg/s over √100 Hz, with the rounding's twelfth: from 32,768 samples to 0.5 %.
    let white = same.joint.iter().find(|term| term.kind() == "angle_random_walk").expect("white noise");
    let expected = 0.05 * (20.0_f64.powi(2) + 1.0 / 12.0).sqrt() / RATE_HZ.sqrt();
    let found = white.term;
    assert!((found.value / expected - 1.0).abs() < 0.025 && found.low < expected && expected < found.high, "{found:?}");
    // The same samples in another range, whose counts are half as large: nothing differs.
    let mut finer = one.clone();
    finer.profile = adis16405::profile(0.025);
    let gyro = finer.profile.channel("gyro_x").expect("a gyro");
    let counts = finer.channels[0].counts.iter().map(|count| 2 * count).collect();
    finer.channels = vec![MeasuredChannel::new(gyro, counts)];
    assert!(compare(&[one.clone(), finer]).expect("comparable").channels[0].p_value > Some(0.999_999));
    let different = &compare(&[one, louder]).expect("comparable").channels[0];
    assert!(!different.agree && different.joint.is_empty() && different.p_value.expect("a test") < 1e-6);
}

/// The 95 % interval at the first octave holds the factor 2 in 95 of 100 pairs whose noise is doubled, with a standard deviation of 2.2.
#[test]
fn intervals_of_the_inflation_hold_the_truth() {
    let holds = |seed: &u64| {
        let (still, running) = (recording(4096, 20.0, 0.0, 2 * seed), recording(4096, 40.0, 0.0, 2 * seed + 1));
        let octaves = &inflation(&[still], &running).expect("comparable").channels[0].octaves;
        [0, 7].map(|octave| octaves[octave].low < 2.0 && 2.0 < octaves[octave].high)
    };
    let found: Vec<[bool; 2]> = (0..100).map(|seed| holds(&seed)).collect();
    for octave in 0..2 {
        let held = found.iter().filter(|held| held[octave]).count();
        assert!((86..=100).contains(&held), "{held} of 100");
    }
}

#[test]
fn recordings_that_cannot_be_compared_are_refused() {
    let one = recording(1000, 20.0, 0.0, 1);
    let other_rate = Measurement { sample_rate_hz: 101.0, ..recording(1000, 20.0, 0.0, 2) };
    assert_eq!(compare(&[one.clone(), other_rate]), Err(IncomparableRecordings::Rates(100.0, 101.0)));
    let mut other_channel = recording(1000, 20.0, 0.0, 3);
    other_channel.channels[0].profile = adis16405::profile(0.05).channel("gyro_y").expect("a gyro");
    assert_eq!(compare(&[one.clone(), other_channel]), Err(IncomparableRecordings::NoChannel));
    assert_eq!(compare(&[]), Err(IncomparableRecordings::NoChannel));
    // Too short for any octave with five degrees of freedom: no verdict.
    let short = recording(6, 20.0, 0.0, 4);
    let channel = &compare(&[short.clone(), short]).expect("comparable").channels[0];
    assert!(channel.p_value.is_none() && !channel.agree);
}
