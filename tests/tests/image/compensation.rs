//! Learning on the device: the model of one epoch is fitted, its covariates are subtracted, and the next epoch shows
//! the drift with and without the subtraction.

use crate::bench::{Event, Outcome, Scenario, assert_stack_suffices, image, run};
use crate::decoded::Decoded;
use crate::peripherals::Sensor;
use adis16405_driver::{BURST_BYTES, Burst, Channel, SamplePeriod};
use firmware::epoch::estimate_regressors;
use firmware::learner::{EpochFit, validate};
use firmware::{CHANNELS, Estimators, FIRST_CONFIG, FinishedEpoch, Statistics, TimedBurst};
use link::{
    Decoder, LearnedMessage, Message, Received, ReportedDeviations, ReportedParameter, ReportedTerm, ValidationMessage,
};
use virtual_sensor::{
    Environment, InjectedEffect, NoiseModel, OutputRegister, SensorScenario, TemperatureProfile, VirtualAdis16405,
};

const EPOCH_S: f64 = 60.0;
const RATE_HZ: f64 = 204.8;
/// Sensitivity of gyro x to temperature, deg/s/°C.
const SENSITIVITY: f64 = 0.05;
/// Frequency of the line on gyro z.
const LINE_HZ: f64 = 20.5;

/// A sensor with `effects` that warms up by 8 °C in a room whose temperature cycles with a period of 50 s.
fn warming_sensor(effects: Vec<InjectedEffect>) -> Sensor {
    let temperature = TemperatureProfile { rise_c: 8.0, time_constant_s: 60.0, cycle_c: 3.0, period_s: 50.0 };
    let environment = Environment { temperature, ..Environment::default() };
    let scenario = SensorScenario { environment, effects };
    Sensor::new(VirtualAdis16405::with_scenario(&scenario, NoiseModel::paper(), 1))
}

/// The results of two epochs.
struct Epochs {
    /// Models of the first, one per channel.
    learned: Vec<LearnedMessage>,
    /// Their validation on the second, one per channel.
    validated: Vec<ValidationMessage>,
    /// Time that the fit of all channels took, s.
    fit_s: f64,
    /// Longest time between the models of two channels, s.
    longest_channel_s: f64,
    /// Time from a key press during the fit to the answer, s.
    response_s: f64,
}

fn run_two_epochs(effects: Vec<InjectedEffect>) -> Epochs {
    const PRESSED_S: f64 = EPOCH_S + 5.0;
    let keys = vec![(0.5, format!("i 0\re {EPOCH_S}\r").into_bytes()), (PRESSED_S, b"v".to_vec())];
    let scenario =
        Scenario { sensor: Some(warming_sensor(effects)), keys, seconds: 2.0 * EPOCH_S + 5.0, ..Scenario::default() };
    let Outcome { sensor, received, diagnostics, .. } = run(image(), scenario);
    assert_eq!(diagnostics, [""; 0]);
    let sensor = sensor.expect("the sensor on the bus");
    assert_eq!(sensor.part.violations(), []);
    let decoded = Decoded::decode(&received);
    assert_eq!((decoded.counters.missing, decoded.counters.bad_frames), (0, 0), "{:?}", decoded.counters);

    // No sample was lost during the fit.
    let health = **decoded.healths().first().expect("the first epoch's report");
    assert_eq!((health.used, health.queue_full, health.lost_edges), (health.bursts, 0, 0), "{health:?}");
    assert_stack_suffices(&health);
    let samples: Vec<u64> = decoded.channels().iter().map(|report| report.samples).collect();
    let samples = &samples[..2 * CHANNELS.len()];

    let (mut learned, mut validated) = (Vec::new(), Vec::new());
    for message in &decoded.messages {
        match message {
            Message::Learned(message) if message.epoch == 0 => learned.push(message.clone()),
            Message::Validation(message) => validated.push(message.clone()),
            _ => {}
        }
    }
    let rates: Vec<Option<f64>> = decoded.hellos().iter().map(|hello| hello.measured_rate_hz).collect();
    let expected = on_host(&sensor.bursts, samples, &rates);
    assert_eq!((&learned, &validated), (&expected.0, &expected.1), "bit for bit");
    let times = |wanted: fn(&Received) -> bool| -> Vec<f64> {
        let mut decoder = Decoder::new();
        let mut completes = |byte: u8| decoder.push(byte).is_some_and(|received| wanted(&received));
        received.iter().filter(|(_, byte)| completes(*byte)).map(|(at, _)| *at as f64 * 1e-9).collect()
    };
    let reports = times(|received| matches!(received, Received::Message { message: Message::Health(_), .. }));
    let models = times(|received| matches!(received, Received::Message { message: Message::Learned(_), .. }));
    let answers = times(|received| matches!(received, Received::Text(line) if line.contains("observatory")));
    let longest_channel_s = models.windows(2).map(|pair| pair[1] - pair[0]).take(5).fold(0.0, f64::max);
    let (fit_s, response_s) = (reports[0] - EPOCH_S, answers[0] - PRESSED_S);
    Epochs { learned, validated, fit_s, longest_channel_s, response_s }
}

/// The same messages, computed on the host from the bursts that the sensor sent. `samples` are those of one epoch or two,
/// channel by channel, and `rates` the sample rates that the microcontroller has measured in each.
fn on_host(
    bursts: &[(u64, [u8; BURST_BYTES])],
    samples: &[u64],
    rates: &[Option<f64>],
) -> (Vec<LearnedMessage>, Vec<ValidationMessage>) {
    assert_eq!(FIRST_CONFIG.sample_period(), SamplePeriod::nearest(RATE_HZ).expect("a rate"));
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, FIRST_CONFIG);
    let at_us = |sample: u64| (sample as f64 * 1e6 / RATE_HZ) as u64;
    estimators.mark_probed(at_us(bursts[0].0));
    let mut bursts = bursts.iter();
    let mut epochs = Vec::new();
    for ((number, samples), rate_hz) in (0..).zip(samples.chunks(CHANNELS.len())).zip(rates) {
        assert!(
            samples.iter().all(|other| *other == samples[0]),
            "all channels of an epoch have taken the same samples"
        );
        // The first bursts after the start are not used: the filter settles.
        while estimators.channel(0).is_some_and(|estimator| estimator.len() < samples[0])
            && let Some((sample, bytes)) = bursts.next()
        {
            let arrival = TimedBurst { at_us: at_us(*sample), dropped: 0, burst: Some(Burst::from_bytes(bytes)) };
            estimators.process(arrival, 0);
        }
        let mut epoch = FinishedEpoch::EMPTY;
        epoch.number = number;
        epoch.fill(&mut estimators);
        epoch.measured_hz = *rate_hz;
        epochs.push(epoch);
    }
    let (first, second) = (&epochs[0], epochs.get(1));
    let means = first.covariances().expect("no restart").means;
    let scale = first.scale(FIRST_CONFIG);
    let fit = |index: usize| {
        let mut fit = EpochFit::new(estimate_regressors(first, index, scale, &mut || true)?);
        fit.run(first, index, scale, &mut || true).then_some(fit)
    };
    let fits: Vec<EpochFit> = (0..6).map(|index| fit(index).expect("a fit that is not cancelled")).collect();
    let validation = |index: usize| {
        let second = second?;
        validate(&fits[index].model(), Some(&means), second, index, second.scale(FIRST_CONFIG))
    };
    let learned = fits.iter().enumerate().map(|(index, fit)| fit.message(index, first.number)).collect();
    (learned, (0..6).filter_map(validation).collect())
}

#[test]
fn a_temperature_effect_is_learned_and_subtracted() {
    let Epochs { learned, validated, fit_s, longest_channel_s, response_s } = run_two_epochs(vec![
        InjectedEffect::Temperature { channel: OutputRegister::GyroX, sensitivity: SENSITIVITY },
        InjectedEffect::Sinusoid {
            channel: OutputRegister::GyroZ,
            frequency_hz: LINE_HZ,
            amplitude: 0.4,
            phase_rad: 0.0,
        },
    ]);
    println!("the fit of an epoch took {fit_s:.1} s, of one channel {longest_channel_s:.1} s at most");
    println!("a key press during the fit was answered after {response_s:.2} s");
    assert!(response_s < 2.0, "an answer after {response_s} s");
    for (learned, validated) in learned.iter().zip(&validated) {
        let gyro_x = learned.channel == Channel::GyroX as u8;
        let covariates: Vec<u8> = learned.regressors.iter().map(|regressor| regressor.covariate).collect();
        assert_eq!(covariates, if gyro_x { vec![Channel::Temp as u8] } else { vec![] }, "{learned:?}");
        let same = validated.drift.iter().all(|drift| drift.raw == drift.compensated);
        assert_eq!(same, !gyro_x, "{validated:?}");
    }

    let temperature = learned[0].regressors[0];
    assert!((temperature.low..=temperature.high).contains(&SENSITIVITY), "{temperature:?}");
    println!(
        "gyro x follows temp: {:.4} ({:.4} to {:.4}) deg/s/degC, truth {SENSITIVITY}",
        temperature.value, temperature.low, temperature.high
    );
    for ReportedDeviations { n, raw, compensated } in &validated[0].drift {
        println!("second epoch, at {:5.1} s: {raw:.4} -> {compensated:.4} deg/s", *n as f64 / RATE_HZ);
    }
    // A cycle of amplitude A and period T has σ = A·sin²(πτ/T)/(πτ/T): 0.082 deg/s at 10 s. The noise of the gyro has
    // √(0.0368²/10 + (0.664·0.0093)² + 0.0013²·10/3) = 0.0134 deg/s, up to 50 % more with 5 degrees of freedom. An
    // error of the sensitivity within its interval, 17 % of it, leaves 0.014 deg/s: together less than 0.025.
    let ten = validated[0].drift.iter().find(|drift| drift.n == 2048).expect("10 s of 60");
    assert!((ten.raw / 0.082 - 1.0).abs() < 0.25, "{ten:?}");
    assert!(ten.compensated < 0.025 && ten.raw > 3.0 * ten.compensated, "{ten:?}");

    // The line on gyro z has no covariate to subtract; it becomes a term of the model.
    let [line, ..] = &learned[2].added_terms[..] else { panic!("{:?}", learned[2]) };
    assert!(matches!(line.coefficient.term, ReportedTerm::Sinusoid | ReportedTerm::Resonance), "{line:?}");
    let ReportedParameter { value, low, high } = line.shape[0];
    println!("gyro z has a line at {value:.2} Hz ({low:.2} to {high:.2}), truth {LINE_HZ}");
    assert!((value / LINE_HZ - 1.0).abs() < 0.1, "a curve of octaves locates a line to 10 %: {line:?}");
    let (before, after) = (validated[2].before.expect("a model"), validated[2].after.expect("a model"));
    println!(
        "gyro z, second epoch: deviance per point {:.1} -> {:.2}",
        before.deviance_per_point, after.deviance_per_point
    );
    assert!(before.deviance_per_point > 10.0 && after.deviance_per_point < 5.0, "{before:?}, {after:?}");
}

#[test]
fn without_an_effect_nothing_is_subtracted() {
    let Epochs { learned, validated, .. } = run_two_epochs(vec![]);
    assert_eq!((learned.len(), validated.len()), (6, 6));
    assert!(learned.iter().all(|learned| learned.regressors.is_empty()), "{learned:?}");
    let mut drifts = validated.iter().flat_map(|validated| &validated.drift);
    assert!(drifts.all(|drift| drift.raw == drift.compensated), "{validated:?}");
}

/// The reset comes while the models are fitted to the finished epoch. Afterwards all of them are fitted, as without a reset,
/// and of the running epoch no more is lost than the second since its last checkpoint.
#[test]
fn a_reset_while_an_epoch_is_learned_from_costs_nothing() {
    const RESET_S: f64 = EPOCH_S + 6.0;
    let keys = vec![(0.5, format!("i 0\re {EPOCH_S}\r").into_bytes()), (RESET_S + 25.0, b"r".to_vec())];
    let events = vec![(RESET_S, Event::ResetPin)];
    let sensor = Some(warming_sensor(vec![]));
    let scenario = Scenario { sensor, keys, events, seconds: RESET_S + 28.0, ..Scenario::default() };
    let Outcome { sensor, received, .. } = run(image(), scenario);
    let bursts = sensor.expect("the sensor on the bus").bursts;
    let (before, after): (Vec<_>, Vec<_>) = received.into_iter().partition(|(at, _)| *at as f64 <= RESET_S * 1e9);
    let (before, after) = (Decoded::decode(&before), Decoded::decode(&after));
    let samples: Vec<u64> = before.channels().iter().map(|report| report.samples).collect();
    let learned = |decoded: &Decoded| -> Vec<LearnedMessage> {
        let learned = decoded.messages.iter();
        learned.filter_map(|m| if let Message::Learned(m) = m { Some(m.clone()) } else { None }).collect()
    };
    assert!(learned(&before).len() < 6, "the reset came too late");
    // The epoch was finished, and its rate measured, before the reset.
    let rates: Vec<Option<f64>> = before.hellos().iter().map(|hello| hello.measured_rate_hz).collect();
    assert_eq!(learned(&after), on_host(&bursts, &samples, &rates).0, "bit for bit");

    let running = after.channels()[after.channels().len() - CHANNELS.len()].samples as f64;
    let sampled_s = running / RATE_HZ;
    println!("{sampled_s:.2} s of samples, 31 s after the start of the epoch");
    assert!((29.3..31.1).contains(&sampled_s), "{sampled_s} s of samples");
}
