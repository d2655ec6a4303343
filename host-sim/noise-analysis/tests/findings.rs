//! One finding a cause, on recordings whose causes are known. The samples are drawn here: sums of white noise and of waveforms
//! that are written out, none of which the detectors know.

use measurement::{MeasuredChannel, Measurement, adis16405};
use noise_analysis::analysis::analyze;
use noise_analysis::effects::Effect;
use noise_analysis::report::{Finding, Report, Validation};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::BTreeMap;
use std::f64::consts::{SQRT_2, TAU};

const RATE_HZ: f64 = 100.0;

/// The value that is added to the white noise of a channel at a time in s, in the channel's unit.
type Waveform<'a> = &'a dyn Fn(&str, f64) -> f64;

/// A recording of `seconds` of the gyros, the accelerometers and the temperature; white noise of 0.4 deg/s and 5 mg.
fn recorded(seconds: f64, seed: u64, waveform: Waveform) -> Measurement {
    let profile = adis16405::profile(0.05);
    let count = (seconds * RATE_HZ) as u64;
    let names = ["gyro_x", "gyro_y", "gyro_z", "accl_x", "accl_y", "accl_z", "temp"];
    let channel = |(number, name): (usize, &&str)| {
        let of = profile.channel(name).expect("a channel of the part");
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number as u64);
        let noise = match of.unit {
            "deg/s" => 0.4,
            "g" => 5e-3,
            _ => 0.05,
        };
        let counts = (0..count).map(|slot| {
            let white = noise * random.sample::<f64, _>(StandardNormal);
            ((white + waveform(name, slot as f64 / RATE_HZ)) / of.lsb).round() as i32
        });
        MeasuredChannel::new(of, counts.collect())
    };
    Measurement {
        channels: names.iter().enumerate().map(channel).collect(),
        sample_rate_hz: RATE_HZ,
        stated_rate_hz: Some(RATE_HZ),
        slots: (0..count).collect(),
        times_s: None,
        dropped: BTreeMap::new(),
        flagged: BTreeMap::new(),
        profile,
    }
}

/// Kind and channels of each finding.
fn kinds(report: &Report) -> Vec<(&str, Vec<&str>)> {
    report
        .findings
        .iter()
        .map(|finding| (finding.effect.name(), finding.channels.iter().map(String::as_str).collect()))
        .collect()
}

#[test]
fn a_square_wave_on_three_accelerometers_is_one_finding() {
    let frequency = 0.53;
    let size = |name: &str| match name {
        "accl_x" => 0.020,
        "accl_y" => 0.012,
        "accl_z" => 0.008,
        _ => 0.0,
    };
    let wave = |name: &str, time: f64| if (frequency * time).fract() < 0.5 { size(name) } else { -size(name) };
    let report = analyze(&recorded(600.0, 1, &wave));
    assert_eq!(kinds(&report), [("square_wave", vec!["accl_x", "accl_y", "accl_z"])]);
    let finding = &report.findings[0];
    assert_eq!(finding.validated, Validation::Yes, "{finding:?}");
    let found = &finding.effect.parameters()["frequency"];
    assert!(found.low < frequency && frequency < found.high && found.high - found.low < 1e-3, "{found:?}");
    for channel in &report.channels {
        let amplitude = size(&channel.name);
        let effects: Vec<_> = channel.effects.iter().map(|effect| (effect.effect.name(), effect.finding)).collect();
        if amplitude == 0.0 {
            assert!(effects.is_empty(), "{}: {effects:?}", channel.name);
            continue;
        }
        assert_eq!(effects, [("square_wave", 0)]);
        // The fundamental's error is √(2/60,000) of 5 mg, 0.3 % of the smallest wave; the samples are 0.5 % of a half period.
        let found = channel.effects[0].effect.parameters()["amplitude"].value;
        assert!((found / amplitude - 1.0).abs() < 0.02, "{}: {found} of {amplitude}", channel.name);
        // At half a period nearly all of the variance is the wave's: 8 mg beside 5 mg/√94.
        let share = finding.share_percent[&channel.name];
        assert!((90.0..=100.0).contains(&share), "{}: {share}", channel.name);
        // The record is too short for a minute.
        assert!(finding.minute_percent.is_empty(), "{finding:?}");
    }
}

#[test]
fn white_noise_has_no_finding() {
    let findings: usize = (0..12).map(|seed| analyze(&recorded(200.0, 100 + seed, &|_, _| 0.0)).findings.len()).sum();
    // 72 records of a channel. Their tests of the samples, of the spectrum and of the curve have a level of 2·10⁻⁵ each, a dozen of them some
    // 3·10⁻⁴ a record in all, and 0.02 here: more than one is expected in one of 5,000 such tests.
    assert!(findings <= 1, "{findings}");
}

/// The part that a bias has in the Allan variance of a gyro, in percent, beside its white noise of 0.4 deg/s: by the differences of its means
/// over the averaging time of an octave. The largest one, up to an eighth of the record, and that at 81.92 s, the octave next to a minute.
fn shares(bias: &dyn Fn(f64) -> f64, seconds: f64) -> [f64; 2] {
    const PARTS: u32 = 64;
    let parts = || (0..PARTS).map(|part| (f64::from(part) + 0.5) / f64::from(PARTS));
    let share_at = |n: f64| {
        let tau = n / RATE_HZ;
        let mean = |start: f64| parts().map(|part| bias(start + part * tau)).sum::<f64>() / f64::from(PARTS);
        let starts = parts().map(|part| part * (seconds - 2.0 * tau));
        let own = starts.map(|start| 0.5 * (mean(start + tau) - mean(start)).powi(2)).sum::<f64>() / f64::from(PARTS);
        100.0 * own / (own + 0.4 * 0.4 / n)
    };
    let octaves = (8..).map(|octave| f64::from(1_u32 << octave)).take_while(|n| *n <= seconds * RATE_HZ / 8.0);
    [octaves.map(share_at).fold(0.0, f64::max), share_at(8192.0)]
}

/// Both shares that a finding states of a channel, in percent.
fn stated_shares(finding: &Finding, channel: &str) -> [f64; 2] {
    [&finding.share_percent, &finding.minute_percent].map(|of| of.get(channel).copied().unwrap_or(0.0))
}

/// Asserts that shares are those expected, where the variance of the bias is known to the part `error`, and with it a share to what is left
/// of it; the octaves of the record differ by a fiftieth from their mean.
fn assert_near(shares: [f64; 2], expected: [f64; 2], error: f64, what: &str) {
    for (share, expected) in shares.into_iter().zip(expected) {
        let tolerance = 0.02 + error * (1.0 - expected / 100.0);
        assert!((share / expected - 1.0).abs() < tolerance, "{what}: {shares:?} %, {expected} %");
    }
}

/// Temperature at a time in s, °C: warming up by 8 °C, with a cycle of 1.5 °C.
fn temperature(time: f64) -> f64 {
    25.0 + 8.0 * (1.0 - (-time / 900.0).exp()) + 1.5 * (TAU * time / 1300.0).sin()
}

#[test]
fn a_bias_behind_a_lag_and_one_with_a_curvature_are_told_from_a_proportional_one() {
    const SECONDS: f64 = 3000.0;
    let (lag_s, lagged_by, curvature, vertex) = (237.0, -0.036, 0.002, 30.0);
    // Euler's steps of 0.01 s, 10⁻⁴ of the lag.
    let mut behind = Vec::new();
    let mut state = temperature(0.0);
    for slot in 0..(SECONDS * RATE_HZ) as u64 {
        behind.push(state);
        state += (temperature(slot as f64 / RATE_HZ) - state) / (lag_s * RATE_HZ);
    }
    let waveform = |name: &str, time: f64| match name {
        "temp" => temperature(time),
        "gyro_x" => lagged_by * behind[(time * RATE_HZ).round() as usize],
        "gyro_y" => curvature * (temperature(time) - vertex).powi(2),
        "gyro_z" => 0.03 * temperature(time),
        _ => 0.0,
    };
    let report = analyze(&recorded(SECONDS, 2, &waveform));
    let expected =
        [("thermal_lag", vec!["gyro_x"]), ("temperature_squared", vec!["gyro_y"]), ("temperature", vec!["gyro_z"])];
    assert_eq!(kinds(&report), expected);
    let agrees = |finding: usize, name: &str, truth: f64, tolerance: f64| {
        let of = &report.findings[finding].effect.parameters()[name];
        // Four standard deviations.
        let half = 4.0 * (of.high - of.low) / (2.0 * 1.96);
        assert!(
            (of.value - truth).abs() < half && (of.value / truth - 1.0).abs() < tolerance,
            "{name}: {of:?}, {truth}"
        );
    };
    // Four of the standard deviations that 0.4 deg/s of noise leaves of a lag of this course: 6 % of the time constant.
    agrees(0, "time_constant", lag_s, 0.25);
    agrees(0, "sensitivity", lagged_by, 0.05);
    // The temperature moves by 10 °C once: the standard deviation of the curvature is a tenth of it.
    agrees(1, "curvature", curvature, 0.4);
    let reference = report.findings[1].effect.parameters()["reference"].value;
    agrees(1, "sensitivity", 2.0 * curvature * (reference - vertex), 0.6);
    // The curvature, of which the bias of gyro_y has the square in its variance, is known to a tenth: four standard deviations of it are 0.8
    // of that variance. Those of the others are known better.
    for (finding, channel) in [(0, "gyro_x"), (1, "gyro_y"), (2, "gyro_z")] {
        let expected = shares(&|time| waveform(channel, time), SECONDS);
        assert_near(stated_shares(&report.findings[finding], channel), expected, 0.8, channel);
    }
    // The rest is white noise: no random walk is needed.
    for channel in &report.channels[..3] {
        let mut terms = channel.refitted.terms.iter();
        let walk = terms.find(|term| term.kind() == "rate_random_walk").expect("a baseline term");
        assert_eq!(walk.term.low, 0.0, "{}: {walk:?}", channel.name);
    }
    let channel = report.channels.iter().find(|of| of.name == "gyro_x").expect("recorded");
    let worst = channel.after.unseen.worst_sigma.expect("a curve");
    assert!(worst.abs() < 4.0, "{worst}");
}

/// The thermometer rounds to 0.14 °C. The deviation of that, 0.04 °C, is 0.8 mg at this sensitivity, and the noise leaves 0.2 mg of a
/// mean over 7 s. Behind a lag the rounding is smoothed.
#[test]
fn a_proportional_response_is_not_behind_a_lag_because_the_thermometer_rounds() {
    const SENSITIVITY: f64 = -0.02;
    for seed in 0..3 {
        let waveform = |name: &str, time: f64| match name {
            "temp" => temperature(time),
            "accl_x" => SENSITIVITY * temperature(time),
            _ => 0.0,
        };
        let report = analyze(&recorded(450.0, seed, &waveform));
        assert_eq!(kinds(&report), [("temperature", vec!["accl_x"])], "seed {seed}");
        let found = &report.findings[0].effect.parameters()["sensitivity"];
        // Four standard deviations, and the rounding.
        let half = 4.0 * (found.high - found.low) / (2.0 * 1.96);
        assert!((found.value - SENSITIVITY).abs() < half, "seed {seed}: {found:?}");
        assert!((found.value / SENSITIVITY - 1.0).abs() < 0.05, "seed {seed}: {found:?}");
    }
}

/// White noise through a resonance of 0.05 Hz, which the record resolves 22 times, and a sinusoid of the same power.
#[test]
fn a_narrow_resonance_is_no_sinusoid() {
    const SECONDS: f64 = 450.0;
    const BANDWIDTH_HZ: f64 = 0.05;
    const FREQUENCY_HZ: f64 = 4.3;
    const DEVIATION: f64 = 0.2;
    for seed in 0..3 {
        // The envelope of a resonance is a pair of Markov processes, which decay with π times its width.
        let mut random = ChaCha8Rng::seed_from_u64(100 + seed);
        let kept = (-0.5 * TAU * BANDWIDTH_HZ / RATE_HZ).exp();
        let mut state = [0.0, 0.0].map(|_: f64| random.sample::<f64, _>(StandardNormal));
        let mut envelope = Vec::new();
        for _ in 0..(SECONDS * RATE_HZ) as usize {
            envelope.push(state);
            let mut step = || (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
            state = state.map(|value| kept * value + step());
        }
        let waveform = |name: &str, time: f64| {
            let (sine, cosine) = (TAU * FREQUENCY_HZ * time).sin_cos();
            match name {
                "gyro_x" => {
                    let [a, b] = envelope[(time * RATE_HZ).round() as usize];
                    DEVIATION * (a * cosine + b * sine)
                }
                "gyro_z" => DEVIATION * SQRT_2 * sine,
                _ => 0.0,
            }
        };
        let report = analyze(&recorded(SECONDS, seed, &waveform));
        let of = |name: &str| {
            let channel = report.channels.iter().find(|of| of.name == name).expect("recorded");
            channel.effects.iter().map(|shown| shown.effect.name()).collect::<Vec<_>>()
        };
        assert_eq!((of("gyro_x"), of("gyro_z")), (vec!["resonance"], vec!["sinusoid"]), "seed {seed}");
    }
}

/// An angle from 0 to 2π that looks like chance, by the bits of the sample's number and of `salt`.
fn scrambled(time: f64, salt: u64) -> f64 {
    let mut bits = ((time * RATE_HZ).round() as u64 + (salt << 40)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    bits = (bits ^ (bits >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    TAU * ((bits ^ (bits >> 32)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[test]
fn a_bias_that_follows_the_strength_of_a_vibration_is_its_rectification() {
    // 240,000 samples, and 300,000, of which means of four are kept.
    [2400.0, 3000.0].into_iter().for_each(assert_rectification);
}

fn assert_rectification(seconds: f64) {
    // deg/s/g², and the vibration of accl_x in g rms: it runs up and down twice, the second time farther.
    let sensitivity = 0.4;
    let strength = |time: f64| 0.15 * (TAU * time / 1200.0).sin().powi(2) * (0.5 + time / seconds);
    let waveform = |name: &str, time: f64| match name {
        "accl_x" => SQRT_2 * strength(time) * scrambled(time, 1).cos(),
        "gyro_y" => sensitivity * strength(time).powi(2),
        "temp" => 25.0,
        _ => 0.0,
    };
    let report = analyze(&recorded(seconds, 4, &waveform));
    let finding = report.findings.iter().find(|of| of.effect.name() == "vibration_rectification");
    let finding = finding.unwrap_or_else(|| panic!("{:?}", kinds(&report)));
    assert_eq!(finding.channels, ["gyro_y"]);
    let found = &finding.effect.parameters()["sensitivity"];
    assert_eq!(found.unit, "deg/s/g^2");
    // Four standard deviations. White noise of 0.4 deg/s leaves 0.4/√240,000 of a mean and, of a course that moves by 0.01 g²,
    // some 0.08 of this sensitivity.
    let half = 4.0 * (found.high - found.low) / (2.0 * 1.96);
    assert!((found.value - sensitivity).abs() < half && half < 0.5, "{found:?}");
    let expected = shares(&|time| found.value * strength(time).powi(2), seconds);
    assert_near(stated_shares(finding, "gyro_y"), expected, 0.2, "gyro_y");
    // Nothing of it is left: neither a drift nor a walk is needed.
    let gyro = report.channels.iter().find(|of| of.name == "gyro_y").expect("recorded");
    assert_eq!(gyro.effects.len(), 1, "{:?}", kinds(&report));
}

#[test]
fn a_vibration_that_nothing_follows_and_a_knock_are_no_rectification() {
    let strength = |time: f64| if (700.0..703.0).contains(&time) { 0.3 } else { 0.05 * (time / 1200.0) };
    let waveform = |name: &str, time: f64| match name {
        "accl_x" => SQRT_2 * strength(time) * scrambled(time, 1).cos(),
        // A drift of the gyro that has nothing to do with it, and an impossible one: 300 deg/s over (18 g)² is 0.93 deg/s/g².
        "gyro_y" => 0.02 * (TAU * time / 500.0).sin(),
        "gyro_z" => 20.0 * strength(time).powi(2),
        "temp" => 25.0,
        _ => 0.0,
    };
    let report = analyze(&recorded(1200.0, 5, &waveform));
    assert!(report.findings.iter().all(|of| of.effect.name() != "vibration_rectification"), "{:?}", report.findings);
}

#[test]
fn a_sensitivity_far_beyond_the_data_sheet_is_a_shared_drift() {
    // 4.3 deg/s/g: 86 times the 0.05 deg/s/g of the data sheet.
    let drift = |time: f64| 0.05 * (TAU * time / 400.0).sin() + 0.03 * (TAU * time / 170.0).cos();
    let of = |ratio: f64| {
        let waveform = move |name: &str, time: f64| match name {
            "accl_x" => drift(time),
            "gyro_y" => ratio * drift(time),
            "temp" => 25.0,
            _ => 0.0,
        };
        let report = analyze(&recorded(1200.0, 3, &waveform));
        let gyro = report.channels.into_iter().find(|of| of.name == "gyro_y").expect("recorded");
        gyro.effects.into_iter().map(|shown| shown.effect.name()).collect::<Vec<_>>()
    };
    assert_eq!(of(-4.3), ["shared_drift"]);
    // Ten times the data sheet's is a sensitivity.
    assert_eq!(of(0.5), ["acceleration"]);
}

#[test]
fn a_chirp_is_not_a_resonance() {
    // From 8 to 14 Hz in ten minutes, the phase being the integral of the frequency.
    let chirp = |time: f64| 0.004 * (TAU * (8.0 * time + 0.5 * 6.0 / 600.0 * time * time)).sin();
    let waveform = |name: &str, time: f64| if name == "accl_y" { chirp(time) } else { 0.0 };
    let report = analyze(&recorded(600.0, 4, &waveform));
    assert!(report.findings.iter().all(|finding| finding.channels == ["accl_y"]), "{:?}", kinds(&report));
    assert!(report.findings.iter().all(|finding| finding.effect.name() != "resonance"), "{:?}", kinds(&report));
    let chirp = report.findings.iter().find_map(|finding| match &finding.effect {
        Effect::Chirp(chirp) => Some(*chirp),
        _ => None,
    });
    let chirp = chirp.unwrap_or_else(|| panic!("{:?}", kinds(&report)));
    let amplitude = chirp.amplitude.estimate();
    for (of, truth) in [(chirp.start_hz, 8.0), (chirp.end_hz, 14.0), (chirp.rate_hz_per_s, 0.01), (amplitude, 0.004)] {
        assert!((of.low..=of.high).contains(&truth), "{truth}: {of:?}");
        assert!((of.value / truth - 1.0).abs() < 0.3, "{truth}: {of:?}");
    }
}

#[test]
fn decaying_disturbances_are_shot_noise() {
    // One in 20 s on average, of 8 mg, that decays with 1.5 s: 14 standard deviations behind the matched filter, 8/5·√(150/2).
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut times = Vec::new();
    let mut time = 0.0;
    while time < 600.0 {
        time -= 20.0 * (1.0 - random.random::<f64>()).ln();
        times.push(time);
    }
    let disturbance = |time: f64| -> f64 {
        times.iter().filter(|start| **start <= time).map(|start| 0.008 * (-(time - start) / 1.5).exp()).sum()
    };
    let waveform = |name: &str, time: f64| if name == "accl_z" { disturbance(time) } else { 0.0 };
    let report = analyze(&recorded(600.0, 6, &waveform));
    let shot_noise = report.findings.iter().find_map(|finding| match &finding.effect {
        Effect::ShotNoise(of) => Some(*of),
        _ => None,
    });
    let shot_noise = shot_noise.unwrap_or_else(|| panic!("{:?}", kinds(&report)));
    let (size, deviation) = (shot_noise.size.estimate(), shot_noise.deviation.estimate());
    let rate = shot_noise.rate_per_hour;
    // The deviation is the root of λA²T/2.
    let truths = [
        (rate, 180.0),
        (size, 0.008),
        (shot_noise.time_constant_s, 1.5),
        (deviation, 0.008 * (0.5f64 * 1.5 / 20.0).sqrt()),
    ];
    for (of, truth) in truths {
        assert!((of.low..=of.high).contains(&truth), "{truth}: {of:?}");
    }
    let is_other = |finding: &Finding| ["telegraph", "markov", "unexplained"].contains(&finding.effect.name());
    assert!(!report.findings.iter().any(is_other), "{:?}", kinds(&report));
    // The model has the variance of them.
    let accl_z = report.channels.iter().find(|of| of.name == "accl_z").expect("recorded");
    assert!(accl_z.refitted.terms.iter().any(|of| of.term.kind.name() == "markov"), "{:?}", accl_z.refitted.terms);
}
