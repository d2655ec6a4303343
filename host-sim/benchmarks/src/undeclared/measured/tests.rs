//! The measured-noise benchmark on generated noise instead of a recording.

use super::hide::{HiddenEffect, has_samples_read_again, hide};
use super::recording::part;
use super::*;
use crate::undeclared::effect::EffectKind;
use crate::undeclared::{DrawnRecording, RecordingGroup};
use measurement::Measurement;
use virtual_sensor::{InjectedEffect, OutputRegister, SensorScenario};

fn recorded(seconds: f64, seed: u64) -> NoiseRecording {
    let mut drawn = DrawnRecording::from_group(RecordingGroup::Nothing, seconds, seed);
    drawn.simulation.scenario = SensorScenario::default();
    let samples = recordings::time_base::measurement(&drawn.simulation.record(), None).expect("a time base");
    NoiseRecording { name: format!("noise {seed}"), samples }
}

fn sinusoid(amplitude: f64) -> HiddenEffect {
    let channel = OutputRegister::GyroY;
    let effect = InjectedEffect::Sinusoid { channel, frequency_hz: 20.0, amplitude, phase_rad: 0.3 };
    HiddenEffect::Known(EffectKind::Sinusoid, effect)
}

#[test]
fn an_effect_of_size_0_changes_no_count_and_a_larger_one_its_channel_alone() {
    let samples = recorded(20.0, 1).samples;
    assert_eq!(hide(&samples, &sinusoid(0.0), 7), samples);
    let changed = hide(&samples, &sinusoid(0.5), 7);
    for (before, after) in samples.channels.iter().zip(&changed.channels) {
        assert_eq!(before.counts == after.counts, before.profile.name != "gyro_y", "{}", before.profile.name);
    }
    let [before, after] = [&samples, &changed].map(|of| of.channels.iter().find(|of| of.profile.name == "gyro_y"));
    let (before, after) = (before.expect("gyro y"), after.expect("gyro y"));
    // 0.5 °/s are 10 counts with a mean square of ½·10² + 1/12; the dithers double the 1/12.
    let squares = before.counts.iter().zip(&after.counts).map(|(a, b)| f64::from(b - a).powi(2));
    let mean = squares.sum::<f64>() / before.counts.len() as f64;
    assert!((mean - 50.0).abs() < 1.0, "{mean}");
}

/// Repeated samples stay repeated; in a quiet channel samples equal by chance change.
#[test]
fn samples_that_were_read_twice_stay_so() {
    let mut samples = recorded(20.0, 4).samples;
    let is_read_again = |at: usize| at % 3 == 2;
    for channel in &mut samples.channels {
        (1..channel.counts.len())
            .filter(|&at| is_read_again(at))
            .for_each(|at| channel.counts[at] = channel.counts[at - 1]);
    }
    let gyro_y =
        |of: &Measurement| of.channels.iter().find(|of| of.profile.name == "gyro_y").expect("gyro y").counts.clone();
    let repeated =
        |counts: &[i32]| (1..counts.len()).filter(|&at| is_read_again(at) && counts[at] == counts[at - 1]).count();
    assert!(has_samples_read_again(&samples) && !has_samples_read_again(&recorded(20.0, 4).samples));
    let changed = gyro_y(&hide(&samples, &sinusoid(0.5), 7));
    assert_ne!(changed, gyro_y(&samples));
    assert_eq!(repeated(&changed), samples.len() / 3);
    samples.channels.iter_mut().flat_map(|channel| &mut channel.counts).for_each(|count| *count = 0);
    let changed = gyro_y(&hide(&samples, &sinusoid(0.5), 7));
    // Neighbours are equal near the turns of the sinusoid.
    assert!(repeated(&changed) < samples.len() / 12, "{}", repeated(&changed));
}

#[test]
fn a_part_has_its_own_periods_and_gaps() {
    let mut whole = recorded(20.0, 2).samples;
    whole.slots[1000..].iter_mut().for_each(|slot| *slot += 100);
    let cut = part(&whole, 900..1300);
    assert_eq!((cut.len(), cut.periods(), cut.dropped["gap"]), (300, 400, 100));
    assert_eq!(cut.channels[1].counts[0], whole.channels[1].counts[900]);
    assert_eq!(cut.channels[1].counts[299], whole.channels[1].counts[1199]);
    let changed = hide(&cut, &sinusoid(0.5), 3);
    assert_eq!(changed.slots, cut.slots);
}

#[test]
fn every_kind_is_hidden_in_every_stretch_or_counted() {
    let plan = MeasuredNoisePlan {
        recordings: Vec::new(),
        rate: None,
        stretches: 1,
        seconds: 40.0,
        samples: None,
        strength: 3.0,
        seed: 11,
        jobs: 2,
    };
    let table = plan.score(&[recorded(60.0, 3)], |_, _| ());
    assert_eq!(table.scores.len() + table.not_hidden.len(), HiddenKind::all().len());
    assert!(table.not_hidden.len() <= 3, "{:?}", table.not_hidden);
    assert!(table.scores.iter().all(|score| score.strength >= 0.95 * 3.0));
    let known = || table.scores.iter().filter(|score| matches!(score.kind, HiddenKind::Known(_)));
    assert!(2 * known().filter(|score| score.named).count() >= known().count(), "{:?}", table.scores);
}
