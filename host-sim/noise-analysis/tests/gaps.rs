//! Gaps of single channels, and knocks, through the whole analysis.

use measurement::Measurement;
use noise_analysis::analysis::analyze;
use noise_analysis::effects::{Effect, NoisyInterval};
use noise_analysis::report::{ChannelEffect, ChannelReport, ModelReport, Parameter, Report};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use simulation::Simulation;

const SECONDS: f64 = 600.0;

/// Ten minutes of the paper's sensor, at 204.8 Hz.
fn recorded(seed: u64) -> Measurement {
    let recording = Simulation::paper(SECONDS, seed).run(|_| ()).expect("a simulation");
    recordings::time_base::measurement(&recording, None).expect("a time base")
}

fn channel<'a>(report: &'a Report, name: &str) -> &'a ChannelReport {
    report.channels.iter().find(|channel| channel.name == name).expect("a recorded channel")
}

fn coefficient(model: &ModelReport, kind: &str) -> Parameter {
    model.terms.iter().find(|term| term.kind() == kind).expect("a term of the baseline").coefficient()
}

/// Adds noise of `deviation` counts to some samples of a channel.
fn knock(measurement: &mut Measurement, name: &str, seconds: std::ops::Range<f64>, deviation: f64) {
    let mut random = ChaCha8Rng::seed_from_u64(99);
    let rate = measurement.sample_rate_hz;
    let channel = measurement.channels.iter_mut().find(|of| of.profile.name == name).expect("a recorded channel");
    for (slot, count) in measurement.slots.iter().zip(&mut channel.counts) {
        if seconds.contains(&(*slot as f64 / rate)) {
            *count += (deviation * random.sample::<f64, _>(StandardNormal)).round() as i32;
        }
    }
}

#[test]
fn a_knock_is_named_and_does_not_change_the_coefficients() {
    let quiet = recorded(1);
    let mut knocked = quiet.clone();
    // 20 s in the first half of two channels, 30 times and 5 times their noise.
    let noise = |name: &str| {
        let counts = &quiet.channels.iter().find(|of| of.profile.name == name).expect("a recorded channel").counts;
        let squares = counts.windows(2).map(|pair| f64::from(pair[1] - pair[0]).powi(2)).sum::<f64>();
        (0.5 * squares / counts.len() as f64).sqrt()
    };
    knock(&mut knocked, "accl_x", 100.0..120.0, 30.0 * noise("accl_x"));
    knock(&mut knocked, "gyro_z", 100.0..120.0, 5.0 * noise("gyro_z"));
    let (before, after) = (analyze(&quiet), analyze(&knocked));
    for of in &after.channels {
        let knock = |shown: &ChannelEffect| match &shown.effect {
            Effect::NoisyInterval(of) => Some(of.clone()),
            _ => None,
        };
        let knocks: Vec<NoisyInterval> = of.effects.iter().filter_map(knock).collect();
        if !["accl_x", "gyro_z"].contains(&of.name.as_str()) {
            assert!(knocks.is_empty(), "{}: {knocks:?}", of.name);
            assert!(!of.missing.refused.contains_key("knock"));
            continue;
        }
        let [knock] = &knocks[..] else { panic!("{}: {knocks:?}", of.name) };
        assert!((knock.from_s.value - 100.0).abs() < 0.5, "{knock:?}");
        assert!((knock.to_s.value - 120.0).abs() < 0.5, "{knock:?}");
        assert_eq!(knock.channels, ["gyro_z", "accl_x"]);
        let refused = of.missing.refused["knock"];
        assert!((4_000..4_400).contains(&refused), "{refused} of 4,096");
        assert_eq!(of.missing.replaced, refused + of.missing.refused.get("spikes").copied().unwrap_or(0));
        let without = channel(&before, &of.name);
        for kind in ["angle_random_walk", "bias_instability", "rate_random_walk"] {
            let Some(old) = without.after.terms.iter().find(|term| term.kind() == kind) else { continue };
            let (old, new) = (old.coefficient(), coefficient(&of.after, kind));
            assert!((old.low..=old.high).contains(&new.value), "{} {kind}: {old:?} {new:?}", of.name);
        }
        // The baseline is that of the record as it came: the knock is in it.
        let [raw, quiet] = [&of.before, &without.before].map(|model| coefficient(model, "angle_random_walk").value);
        assert!(raw > 1.2 * quiet, "{}: {raw} {quiet}", of.name);
    }
}

#[test]
fn a_knock_in_the_unseen_half_is_scored_with_and_without_it() {
    let mut knocked = recorded(2);
    knock(&mut knocked, "accl_y", 450.0..470.0, 100.0);
    let report = analyze(&knocked);
    let of = &channel(&report, "accl_y").after;
    let raw = of.unseen.deviance_per_point.expect("octaves");
    let excluding =
        of.unseen_excluding.as_ref().expect("a rule of the first half").deviance_per_point.expect("octaves");
    assert!(raw > 100.0 && excluding < 10.0, "{raw} {excluding}");
    assert!(channel(&report, "accl_z").after.unseen_excluding.is_none());
}

#[test]
fn samples_refused_in_one_channel_are_missing_there_alone() {
    let whole = recorded(3);
    let mut refused = whole.clone();
    let positions: Vec<usize> = (0..whole.len()).filter(|position| position % 100 == 50).collect();
    let count = positions.len() as u64;
    let own = refused.channels.iter_mut().find(|of| of.profile.name == "gyro_x").expect("a recorded channel");
    for &position in &positions {
        own.counts[position] = 8191;
    }
    own.refused.insert("x_sign", positions);
    let (before, after) = (analyze(&whole), analyze(&refused));
    for (before, after) in before.channels.iter().zip(&after.channels) {
        if after.name != "gyro_x" {
            // The samples of the others are the same, so their curves are, to the bit.
            assert_eq!(before.curve, after.curve, "{}", after.name);
            assert_eq!((after.missing.refused.get("x_sign"), after.missing.replaced), (None, before.missing.replaced));
            continue;
        }
        assert_eq!((after.missing.refused["x_sign"], after.missing.replaced), (count, count));
        // A hundredth of the samples costs no octave, and moves N by less than its interval.
        assert_eq!(before.curve.len(), after.curve.len());
        let [old, new] = [before, after].map(|of| coefficient(&of.before, "angle_random_walk"));
        assert!((old.low..=old.high).contains(&new.value), "{old:?} {new:?}");
    }
}
