//! The loop on the device: one epoch fits a model, and the next one validates it on unseen data.

use adis16405_driver::Channel;
use embedded_hal::spi::SpiDevice;
use link::{
    ChannelMessage, Decoder, Health, LearnedMessage, Message, Received, ReportedRegressor, ReportedTerm,
    ValidationMessage,
};
use simulation::Device;
use virtual_sensor::{
    Environment, InjectedEffect, NoiseModel, OutputRegister, SensorScenario, TemperatureProfile, VirtualAdis16405,
};

const SECOND: u64 = 1_000_000;
const EPOCH_S: u64 = 100;
const SEED: u64 = 1;
/// Sensitivity of gyro x to the temperature, °/s/°C.
const SENSITIVITY: f64 = 0.05;

/// A part that warms up by 8 °C in a room with a temperature cycle of 20 s. If `with_effect`, its gyro x follows the
/// temperature.
fn part(with_effect: bool) -> VirtualAdis16405 {
    part_in_cycle(20.0, with_effect, SEED)
}

fn part_in_cycle(period_s: f64, with_effect: bool, seed: u64) -> VirtualAdis16405 {
    let temperature = TemperatureProfile { rise_c: 8.0, time_constant_s: 60.0, cycle_c: 3.0, period_s };
    let effect = InjectedEffect::Temperature { channel: OutputRegister::GyroX, sensitivity: SENSITIVITY };
    let environment = Environment { temperature, ..Environment::default() };
    let effects = if with_effect { vec![effect] } else { vec![] };
    VirtualAdis16405::with_scenario(&SensorScenario { environment, effects }, NoiseModel::paper(), seed)
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
    epochs_of(EPOCH_S, part, epochs)
}

fn epochs_of(epoch_s: u64, part: VirtualAdis16405, epochs: u64) -> (Device, Transcript) {
    let mut device = Device::new(part, Device::blank_memory());
    device.press(format!("i0\re{epoch_s}\r").as_bytes());
    let heard = Transcript::decode(&device.run_until((epochs * epoch_s + 1) * SECOND));
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
        // The part is at 36 °C and warms up.
        assert!((36.0..=36.0 + 8.0 + 3.0).contains(&cause.reference), "{cause:?}");
    }
    let of_gyro_x = |heard: &Transcript| heard.checked.iter().filter(|c| c.channel == 1).cloned().collect::<Vec<_>>();
    let learnt_gyro_x = heard.learnt.iter().filter(|learnt| learnt.channel == 1);
    for ((checked, twin), learnt) in of_gyro_x(&heard).iter().zip(&of_gyro_x(&twin)).zip(learnt_gyro_x) {
        assert_eq!(checked.epoch, learnt.epoch + 1);
        let relative_error = (learnt.regressors[0].high - learnt.regressors[0].low) / 2.0 / SENSITIVITY;
        for (drift, without) in checked.drift.iter().zip(&twin.drift) {
            println!("epoch {}, n = {}: {:.2e} -> {:.2e}", checked.epoch, drift.n, drift.raw, drift.compensated);
            // The compensated drift is at most the drift without the effect and the part of the effect within the
            // confidence interval, with a tenth more for the rounding of the temperature to 0.04 °C.
            assert!(drift.compensated <= 1.1 * without.raw + relative_error * drift.raw, "{drift:?}, {without:?}");
        }
        // A cycle of amplitude A has σ = A·sin²(πτ/T)/(πτ/T), 0.64·A at half the cycle: 0.095 deg/s for 0.05 times 3 degC. The gyro's own
        // noise at 10 s is √(0.0368²/10 + (0.664·0.0093)² + 0.0013²·10/3) = 0.0134.
        let half = checked.drift.iter().find(|drift| drift.n == 2048).expect("10 s of 100 s");
        assert!((half.raw / 0.095 - 1.0).abs() < 0.2, "{half:?}");
        assert!(half.raw > 4.0 * half.compensated, "{half:?}");
        // The gyro's own mean changes by 0.013 deg/s from one epoch to the next: K²·100 s·2/3 and the flicker noise.
        let shift = checked.shift.expect("means of both epochs");
        assert!(shift.compensated.abs() <= relative_error * shift.raw.abs() + 3.0 * 0.013, "{shift:?}");
    }
    let lines = {
        device.press(b"t");
        Transcript::decode(&device.run_until((3 * EPOCH_S + 2) * SECOND)).lines
    };
    let told = |line: &String| line.starts_with(" gyro x  temp ") && line.ends_with(" deg/s/degC");
    assert!(lines.iter().any(told), "{lines:#?}");
    assert!(lines.iter().all(|line| line.is_ascii() && line.len() <= 80), "{lines:#?}");
    // The table shows the errors before and after, beside the coefficients.
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

/// Epochs of a minute, as in the image. The octaves at τ = 1.25, 2.5, 5 and 10 s have the cycle's Allan variance, 9 °C²·sin⁴(πτ/T)/(πτ/T)²,
/// and 70, 35, 17 and 8 degrees of freedom of the gyro's noise. With T = 20 s the weighted regression has 18 degrees of freedom and a
/// standard error of 0.0022 °/s/°C: t = 23 is as improbable as 7.6 normal standard deviations, and 4.5 are required. With T = 50 s the
/// cycle's power is at 10 and 20 s with 7 degrees of freedom: t = 18 is as improbable as 4.7, so more than half of the epochs learn the
/// effect, but not all.
#[test]
fn an_effect_that_an_epoch_can_show_is_learned_in_every_epoch() {
    let learned = |period_s: f64| -> Vec<ReportedRegressor> {
        let of_seed = |seed| epochs_of(60, part_in_cycle(period_s, true, seed), 2).1.learnt;
        let learnt: Vec<_> = (1..=20).flat_map(of_seed).filter(|learnt| learnt.channel == 1).collect();
        assert_eq!(learnt.len(), 40);
        let causes: Vec<_> = learnt.into_iter().flat_map(|learnt| learnt.regressors).collect();
        println!("cycle of {period_s} s: learned in {} of 40 epochs", causes.len());
        causes
    };
    assert!((21..=40).contains(&learned(50.0).len()));
    let causes = learned(20.0);
    assert_eq!(causes.len(), 40);
    for cause in &causes {
        assert_eq!(cause.covariate, Channel::Temp as u8);
        let half_width = (cause.high - cause.low) / 2.0;
        assert!((0.5..2.0).contains(&(half_width / (1.96 * 0.0024))), "{cause:?}");
    }
    // More than 7 of 40 intervals of 95 % miss the truth once in a thousand cases.
    let missed = causes.iter().filter(|cause| !(cause.low..=cause.high).contains(&SENSITIVITY)).count();
    assert!(missed <= 7, "{missed} of 40 intervals miss the truth");
}

/// A process with a time constant of 0.2 s and a deviation of 0.4 °/s has an Allan deviation of up to 0.25 °/s at 0.38 s, four times that
/// of the white noise there. It is named in every epoch of a minute, and its model predicts the next epoch.
#[test]
fn a_gauss_markov_process_is_named_in_every_epoch() {
    let (mut named, mut foretold) = (0, 0);
    for seed in 1..=20 {
        let effects =
            vec![InjectedEffect::Markov { channel: OutputRegister::GyroY, time_constant_s: 0.2, deviation: 0.4 }];
        let scenario = SensorScenario { effects, ..SensorScenario::default() };
        let part = VirtualAdis16405::with_scenario(&scenario, NoiseModel::paper(), seed);
        let (_, heard) = epochs_of(60, part, 2);
        let gyro_y = heard.learnt.iter().filter(|learnt| learnt.channel == 2);
        let is_named = |learnt: &&LearnedMessage| matches!(&learnt.added_terms[..], [t] if t.coefficient.term == ReportedTerm::Markov);
        named += gyro_y.filter(is_named).count();
        let checked = heard.checked.iter().find(|checked| checked.channel == 2).expect("the second epoch");
        let (before, after) = (checked.before.expect("a model"), checked.after.expect("a model"));
        foretold += usize::from(before.deviance_per_point > 2.0 * after.deviance_per_point);
    }
    println!("named in {named} of 40 epochs, error halved in {foretold} of 20");
    assert_eq!((named, foretold), (40, 20));
}

/// SENS_AVG, lower byte, of the sensor's register map (data sheet Rev. B, Table 8): sixteen taps a stage.
const SIXTEEN_TAPS: [u8; 2] = [0xB8, 0x04];

/// The sensor's filter is not at the setting that the firmware has programmed and does not read again; it is named on the gyros. An
/// accelerometer's count of 3.33 mg is three times the deviation of its noise behind the filter, 0.34 mg·√s·√(204.8 Hz·0.0417) = 1.0 mg.
/// Rounding changes its curve, so a term that is named there must at least halve the error of the next epoch.
#[test]
fn another_filter_in_the_sensor_is_named() {
    let part = VirtualAdis16405::new(NoiseModel::paper(), SEED);
    let mut device = Device::new(part, Device::blank_memory());
    device.press(b"i0\re60\r");
    device.run_until(SECOND);
    let Ok(()) = device.bus().clone().write(&SIXTEEN_TAPS);
    device.press(b"clear\r");
    let heard = Transcript::decode(&device.run_until(123 * SECOND));
    device.press(b"t");
    let lines = Transcript::decode(&device.run_until(124 * SECOND)).lines;
    lines.iter().for_each(|line| println!("{line}"));
    for axis in ["x", "y", "z"] {
        let expected = format!(" gyro {axis}  filter of 16.0 taps ");
        assert!(lines.iter().any(|line| line.starts_with(&expected)), "{expected}: {lines:#?}");
    }
    assert_eq!(heard.checked.len(), 6);
    for checked in &heard.checked {
        let (before, after) = (checked.before.expect("a model"), checked.after.expect("a model"));
        println!("{}: {:.1} -> {:.2}", checked.channel, before.deviance_per_point, after.deviance_per_point);
        assert!(before.deviance_per_point > 2.0 * after.deviance_per_point, "{checked:?}");
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

/// A restart loses the covariances of the channels, so an epoch with a restart learns no sensitivity.
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
