//! The loop on the device: an epoch teaches, what was learnt is subtracted, and the next epoch shows what that was worth.

use crate::bench::{Outcome, Scenario, run};
use crate::decoded::Decoded;
use crate::sensor::Sensor;
use crate::{SCK_HZ, image};
use adis16405_driver::{BURST_BYTES, Burst, Channel, SamplePeriod};
use firmware::epoch::estimate_regressors;
use firmware::learner::{EpochFit, validate};
use firmware::{CHANNELS, Estimators, FIRST_CONFIG, FinishedEpoch, RetainedRam, Statistics, TimedBurst};
use link::{
    Decoder, LearnedMessage, Message, Received, ReportedDrift, ReportedParameter, ReportedTerm, ValidationMessage,
};
use simulation::Device;
use virtual_sensor::TemperatureProfile;
use virtual_sensor::{Environment, InjectedEffect, NoiseModel, OutputRegister, SensorScenario, VirtualAdis16405};

const EPOCH_S: f64 = 60.0;
const RATE_HZ: f64 = 204.8;
/// deg/s/°C of gyro x.
const SENSITIVITY: f64 = 0.05;
/// Of the line on gyro z.
const LINE_HZ: f64 = 20.5;

/// A part that warms up by 8 °C in a room that is heated in turns of 50 s; its gyro x follows if `effects` say so.
fn part(effects: Vec<InjectedEffect>) -> Sensor {
    let temperature = TemperatureProfile { rise_c: 8.0, time_constant_s: 60.0, cycle_c: 3.0, period_s: 50.0 };
    let surroundings = Environment { temperature, ..Environment::default() };
    let hidden = SensorScenario { environment: surroundings, effects };
    Sensor::new(VirtualAdis16405::with_scenario(&hidden, NoiseModel::paper(), 1), SCK_HZ)
}

/// What two epochs have brought.
struct Heard {
    /// From the first, by channel.
    learnt: Vec<LearnedMessage>,
    /// What the second says to it.
    checked: Vec<ValidationMessage>,
    /// Seconds that the first took to teach.
    taught_s: f64,
    /// Seconds that one channel took of it, at most.
    longest_s: f64,
    /// Seconds that a key press waited meanwhile.
    waited_s: f64,
}

fn two_epochs(effects: Vec<InjectedEffect>) -> Heard {
    const PRESSED_S: f64 = EPOCH_S + 5.0;
    let keys = vec![(0.5, format!("i 0\re {EPOCH_S}\r").into_bytes()), (PRESSED_S, b"v".to_vec())];
    let scenario = Scenario { sensor: Some(part(effects)), keys, seconds: 2.0 * EPOCH_S + 5.0, ..Scenario::default() };
    let Outcome { sensor, received, complaints, .. } = run(image(), scenario);
    assert_eq!(complaints, [""; 0]);
    let sensor = sensor.expect("the sensor hangs on the bus");
    assert_eq!(sensor.part.violations(), []);
    let decoded = Decoded::of(&received);
    assert_eq!((decoded.counters.missing, decoded.counters.bad_frames), (0, 0), "{:?}", decoded.counters);

    // Nothing was lost while the first epoch taught, and every sample is in one epoch or the other.
    let health = **decoded.healths().first().expect("the first epoch's report");
    assert_eq!((health.used, health.queue_full, health.lost_edges), (health.bursts, 0, 0), "{health:?}");
    assert!(health.stack_bytes + crate::INTERRUPTS_STACK < health.stack_size, "{health:?}");
    println!("stack {} of {} B", health.stack_bytes, health.stack_size);
    let samples: Vec<u64> = decoded.channels().iter().map(|report| report.samples).collect();
    let samples = &samples[..2 * CHANNELS.len()];

    let (mut learnt, mut checked) = (Vec::new(), Vec::new());
    for message in &decoded.messages {
        match message {
            Message::Learned(message) if message.epoch == 0 => learnt.push(message.clone()),
            Message::Validation(message) => checked.push(message.clone()),
            _ => {}
        }
    }
    let expected = on_host(&sensor.bursts, samples);
    assert_eq!((&learnt, &checked), (&expected.0, &expected.1), "bit for bit");
    let times = |wanted: fn(&Received) -> bool| -> Vec<f64> {
        let mut decoder = Decoder::new();
        let mut found = |byte: u8| decoder.push(byte).is_some_and(|received| wanted(&received));
        received.iter().filter(|(_, byte)| found(*byte)).map(|(at, _)| *at as f64 * 1e-9).collect()
    };
    let taught = times(|received| matches!(received, Received::Message { message: Message::Health(_), .. }));
    let lessons = times(|received| matches!(received, Received::Message { message: Message::Learned(_), .. }));
    let answered = times(|received| matches!(received, Received::Text(line) if line.contains("observatory")));
    let longest_s = lessons.windows(2).map(|pair| pair[1] - pair[0]).take(5).fold(0.0, f64::max);
    let (taught_s, waited_s) = (taught[0] - EPOCH_S, answered[0] - PRESSED_S);
    Heard { learnt, checked, taught_s, longest_s, waited_s }
}

/// The same from the bursts that the sensor sent; `samples` of both epochs, channel by channel.
fn on_host(bursts: &[(u64, [u8; BURST_BYTES])], samples: &[u64]) -> (Vec<LearnedMessage>, Vec<ValidationMessage>) {
    assert_eq!(FIRST_CONFIG.sample_period(), SamplePeriod::nearest(RATE_HZ).expect("a rate"));
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, FIRST_CONFIG);
    let at_us = |sample: u64| (sample as f64 * 1e6 / RATE_HZ) as u64;
    estimators.mark_probed(at_us(bursts[0].0));
    let mut bursts = bursts.iter();
    let mut epochs = Vec::new();
    for (number, samples) in (0..).zip(samples.chunks(CHANNELS.len())) {
        assert!(
            samples.iter().all(|other| *other == samples[0]),
            "all channels of an epoch have taken the same samples"
        );
        for (sample, bytes) in bursts.by_ref().take(samples[0] as usize) {
            let arrival = TimedBurst { at_us: at_us(*sample), dropped: 0, burst: Some(Burst::from_bytes(bytes)) };
            estimators.process(arrival, 0);
        }
        let mut epoch = FinishedEpoch::EMPTY;
        epoch.number = number;
        epoch.fill(&mut estimators, &mut RetainedRam::open(Device::blank_memory()));
        epochs.push(epoch);
    }
    let [first, second] = &epochs[..] else { panic!("two epochs") };
    let means = first.covariances().expect("no restart").means;
    let taught = |index: usize| {
        let mut taught = EpochFit::new(estimate_regressors(first, index, FIRST_CONFIG, &mut || true)?);
        taught.run(first, index, FIRST_CONFIG, &mut || true).then_some(taught)
    };
    let taught: Vec<EpochFit> = (0..6).map(|index| taught(index).expect("nobody says no")).collect();
    let check = |index: usize| validate(&taught[index].model(), Some(&means), second, index, FIRST_CONFIG);
    let learnt = taught.iter().enumerate().map(|(index, taught)| taught.message(index, first.number)).collect();
    (learnt, (0..6).filter_map(check).collect())
}

#[test]
fn a_hidden_temperature_effect_is_learnt_and_subtracted() {
    let Heard { learnt, checked, taught_s, longest_s, waited_s } = two_epochs(vec![
        InjectedEffect::Temperature { channel: OutputRegister::GyroX, sensitivity: SENSITIVITY },
        InjectedEffect::Sinusoid {
            channel: OutputRegister::GyroZ,
            frequency_hz: LINE_HZ,
            amplitude: 0.4,
            phase_rad: 0.0,
        },
    ]);
    println!("an epoch taught for {taught_s:.1} s, of one channel for {longest_s:.1} s at most");
    println!("a key press waited {waited_s:.2} s meanwhile");
    assert!(waited_s < 2.0, "an answer after {waited_s} s");
    for (learnt, checked) in learnt.iter().zip(&checked) {
        let gyro_x = learnt.channel == Channel::GyroX as u8;
        let causes: Vec<u8> = learnt.regressors.iter().map(|cause| cause.covariate).collect();
        assert_eq!(causes, if gyro_x { vec![Channel::Temp as u8] } else { vec![] }, "{learnt:?}");
        let same = checked.drift.iter().all(|drift| drift.raw == drift.compensated);
        assert_eq!(same, !gyro_x, "{checked:?}");
    }

    let cause = learnt[0].regressors[0];
    assert!((cause.low..=cause.high).contains(&SENSITIVITY), "{cause:?}");
    println!(
        "gyro x follows temp: {:.4} ({:.4} to {:.4}) deg/s/degC, truth {SENSITIVITY}",
        cause.value, cause.low, cause.high
    );
    for ReportedDrift { n, raw, compensated } in &checked[0].drift {
        println!("unseen, at {:5.1} s: {raw:.4} -> {compensated:.4} deg/s", *n as f64 / RATE_HZ);
    }
    // A cycle of amplitude A and period T has σ = A·sin²(πτ/T)/(πτ/T): 0.082 deg/s at 10 s. The noise of the gyro has
    // √(0.0368²/10 + (0.664·0.0093)² + 0.0013²·10/3) = 0.0134, half as much again at its worst (5 degrees of freedom), and
    // the interval of the sensitivity, 17 % of it, leaves 0.014: together less than 0.025.
    let ten = checked[0].drift.iter().find(|drift| drift.n == 2048).expect("10 s of 60");
    assert!((ten.raw / 0.082 - 1.0).abs() < 0.25, "{ten:?}");
    assert!(ten.compensated < 0.025 && ten.raw > 3.0 * ten.compensated, "{ten:?}");

    // The line on gyro z is no cause that could be subtracted; the model has it.
    let [line, ..] = &learnt[2].added_terms[..] else { panic!("{:?}", learnt[2]) };
    assert!(matches!(line.coefficient.term, ReportedTerm::Sinusoid | ReportedTerm::Resonance), "{line:?}");
    let ReportedParameter { value, low, high } = line.shape[0];
    println!("gyro z has a line at {value:.2} Hz ({low:.2} to {high:.2}), truth {LINE_HZ}");
    assert!((value / LINE_HZ - 1.0).abs() < 0.1, "octaves place a line to ten percent: {line:?}");
    let (before, after) = (checked[2].before.expect("a model"), checked[2].after.expect("a model"));
    println!("gyro z, unseen: deviance per point {:.1} -> {:.2}", before.deviance_per_point, after.deviance_per_point);
    assert!(before.deviance_per_point > 10.0 && after.deviance_per_point < 5.0, "{before:?}, {after:?}");
}

#[test]
fn where_nothing_is_hidden_nothing_is_subtracted() {
    let Heard { learnt, checked, .. } = two_epochs(vec![]);
    assert_eq!((learnt.len(), checked.len()), (6, 6));
    assert!(learnt.iter().all(|learnt| learnt.regressors.is_empty()), "{learnt:?}");
    assert!(
        checked.iter().flat_map(|checked| &checked.drift).all(|drift| drift.raw == drift.compensated),
        "{checked:?}"
    );
}
