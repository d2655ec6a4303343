//! The loop on the device: one epoch fits a model, the next one checks it on data that the fit has not seen.

use adis16405_driver::Channel;
use link::{ChannelMessage, Decoder, Health, LearnedMessage, Message, Received, ValidationMessage};
use simulation::Device;
use virtual_sensor::{
    Environment, InjectedEffect, NoiseModel, OutputRegister, SensorScenario, TemperatureProfile, VirtualAdis16405,
};

const SECOND: u64 = 1_000_000;
const EPOCH_S: u64 = 100;
const SEED: u64 = 1;
/// Sensitivity of gyro x to the temperature, °/s/°C.
const SENSITIVITY: f64 = 0.05;

/// A part that warms up by 8 °C in a room with a temperature cycle of 80 s; with `with_effect` its gyro x follows it.
fn part(with_effect: bool) -> VirtualAdis16405 {
    let temperature = TemperatureProfile { rise_c: 8.0, time_constant_s: 60.0, cycle_c: 3.0, period_s: 80.0 };
    let effect = InjectedEffect::Temperature { channel: OutputRegister::GyroX, sensitivity: SENSITIVITY };
    let environment = Environment { temperature, ..Environment::default() };
    let effects = if with_effect { vec![effect] } else { vec![] };
    VirtualAdis16405::with_scenario(&SensorScenario { environment, effects }, NoiseModel::paper(), SEED)
}

#[derive(Default)]
struct Transcript {
    checked: Vec<ValidationMessage>,
    learnt: Vec<LearnedMessage>,
    channels: Vec<ChannelMessage>,
    health: Option<Health>,
    lines: Vec<String>,
}

impl Transcript {
    fn decode(bytes: &[u8]) -> Self {
        let (mut decoder, mut heard) = (Decoder::new(), Self::default());
        for received in bytes.iter().filter_map(|&byte| decoder.push(byte)) {
            match received {
                Received::Message { message: Message::Validation(checked), .. } => heard.checked.push(checked),
                Received::Message { message: Message::Learned(learnt), .. } => heard.learnt.push(learnt),
                Received::Message { message: Message::Channel(report), .. } => heard.channels.push(report),
                Received::Message { message: Message::Health(health), .. } => heard.health = Some(health),
                Received::Message { .. } => {}
                Received::Text(line) => heard.lines.push(line.as_str().to_owned()),
            }
        }
        assert_eq!((decoder.counters().bad_frames, decoder.counters().missing), (0, 0));
        heard
    }
}

/// Runs a device for some epochs; returns it and what it sent.
fn epochs(part: VirtualAdis16405, epochs: u64) -> (Device, Transcript) {
    let mut device = Device::new(part, Device::blank_memory());
    device.press(format!("i0\re{EPOCH_S}\r").as_bytes());
    let heard = Transcript::decode(&device.run_until((epochs * EPOCH_S + 1) * SECOND));
    (device, heard)
}

#[test]
fn an_injected_temperature_effect_is_subtracted_in_the_next_epoch() {
    let (mut device, heard) = epochs(part(true), 3);
    let (_, twin) = epochs(part(false), 3);
    assert_eq!((heard.learnt.len(), heard.checked.len()), (18, 12), "the first epoch has nothing to check");
    for learnt in &heard.learnt {
        if learnt.channel != Channel::GyroX as u8 {
            assert_eq!(learnt.regressors, [], "{learnt:?}");
            continue;
        }
        let [cause] = learnt.regressors[..] else { panic!("{learnt:?}") };
        assert_eq!(cause.covariate, Channel::Temp as u8);
        assert!((cause.low..=cause.high).contains(&SENSITIVITY), "{cause:?}");
        // The part is at 36 °C and warms.
        assert!((36.0..=36.0 + 8.0 + 3.0).contains(&cause.reference), "{cause:?}");
    }
    let of_gyro_x = |heard: &Transcript| heard.checked.iter().filter(|c| c.channel == 1).cloned().collect::<Vec<_>>();
    let learnt_gyro_x = heard.learnt.iter().filter(|learnt| learnt.channel == 1);
    for ((checked, twin), learnt) in of_gyro_x(&heard).iter().zip(&of_gyro_x(&twin)).zip(learnt_gyro_x) {
        assert_eq!(checked.epoch, learnt.epoch + 1);
        let relative_error = (learnt.regressors[0].high - learnt.regressors[0].low) / 2.0 / SENSITIVITY;
        for (drift, without) in checked.drift.iter().zip(&twin.drift) {
            println!("epoch {}, n = {}: {:.2e} -> {:.2e}", checked.epoch, drift.n, drift.raw, drift.compensated);
            // At most the drift without the effect, and the part of the effect that the confidence interval leaves open; a
            // tenth more for the rounding of the temperature, 0.04 °C.
            assert!(drift.compensated <= 1.1 * without.raw + relative_error * drift.raw, "{drift:?}, {without:?}");
        }
        // A cycle of amplitude A has σ = A·sin²(πτ/T)/(πτ/T), 0.64·A at a quarter of the cycle: 0.095 deg/s of 0.05 times
        // 3 degC. The gyro's own noise has there, at 20 s, √(0.0368²/20 + (0.664·0.0093)² + 0.0013²·20/3) = 0.011.
        let quarter = checked.drift.iter().find(|drift| drift.n == 4096).expect("20 s of 100 s");
        assert!((quarter.raw / 0.095 - 1.0).abs() < 0.2, "{quarter:?}");
        assert!(quarter.raw > 4.0 * quarter.compensated, "{quarter:?}");
        // The gyro's own mean moves by 0.013 deg/s from one epoch to the next: K²·100 s·2/3 and the flicker noise.
        let shift = checked.shift.expect("means of both epochs");
        assert!(shift.compensated.abs() <= relative_error * shift.raw.abs() + 3.0 * 0.013, "{shift:?}");
    }
    let lines = {
        device.press(b"t");
        Transcript::decode(&device.run_until((3 * EPOCH_S + 2) * SECOND)).lines
    };
    for expected in
        [" 1  gyro x       The bias follows the temperature: 5", "                 Subtracted, unseen epoch: "]
    {
        assert!(lines.iter().any(|line| line.starts_with(expected)), "{expected}: {lines:#?}");
    }
    assert!(lines.iter().all(|line| line.is_ascii() && line.len() <= 80), "{lines:#?}");
    // The errors before and after, beside the coefficients.
    assert!(lines.iter().any(|line| line.starts_with(" x     ") && line.contains(" -> ")), "{lines:#?}");
}

#[test]
fn without_an_effect_nothing_is_subtracted() {
    let (_, heard) = epochs(part(false), 3);
    assert!(heard.learnt.iter().all(|learnt| learnt.regressors.is_empty()));
    for checked in &heard.checked {
        assert!(checked.drift.iter().all(|drift| drift.raw == drift.compensated), "{checked:?}");
        assert!(checked.shift.is_some_and(|shift| shift.raw == shift.compensated), "{checked:?}");
    }
}

#[test]
fn every_used_sample_is_in_exactly_one_epoch() {
    let (mut device, mut heard) = epochs(part(false), 3);
    device.press(b"r");
    let last = Transcript::decode(&device.run_until((3 * EPOCH_S + 2) * SECOND));
    heard.channels.extend(last.channels);
    let gyro_x = heard.channels.iter().filter(|report| report.channel == 1);
    let samples: u64 = gyro_x.map(|report| report.samples).sum();
    assert_eq!(samples, u64::from(last.health.expect("a report").used));
}

/// A restart loses the covariances of the channels, so the epoch that contains it learns no sensitivity.
#[test]
fn an_epoch_with_a_restart_in_it_subtracts_nothing() {
    let memory = Device::blank_memory();
    let mut device = Device::new(part(true), memory);
    device.press(format!("i0\re{EPOCH_S}\r").as_bytes());
    device.run_until(EPOCH_S / 2 * SECOND);
    let part = device.bus().part().clone();
    let start_us = part.now() / 1000;
    let mut restarted = Device::new(part, memory);
    let heard = Transcript::decode(&restarted.run_until(start_us + (2 * EPOCH_S + 1) * SECOND));
    let causes: Vec<usize> = heard.learnt.iter().filter(|l| l.channel == 1).map(|l| l.regressors.len()).collect();
    assert_eq!(causes, [0, 1], "{:?}", heard.learnt);
}
