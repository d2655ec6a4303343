//! Each effect against its definition: moments and covariances by textbook formulas, with fixed seeds.

use adis16405_driver::{Channel, Faults};
use recordings::recording::Recording;
use simulation::Simulation;
use virtual_sensor::{
    EffectSource, Environment, InjectedEffect, Motion, NoiseModel, NoiseSource, OutputRegister, SensorScenario,
    SupplyProfile, TemperatureProfile,
};

const PERIOD_S: f64 = 0.01;
const GYRO: OutputRegister = OutputRegister::GyroX;

/// `count` values of all channels with `effect` as the only disturbance.
fn values(effect: InjectedEffect, environment: Environment, seed: u64, count: usize) -> Vec<[f64; 12]> {
    let mut source = EffectSource::new(&SensorScenario { environment, effects: vec![effect] }, seed);
    (0..count)
        .map(|k| {
            let mut values = [0.0; 12];
            source.disturb(&mut values, k as f64 * PERIOD_S, PERIOD_S);
            values
        })
        .collect()
}

fn gyro(effect: InjectedEffect, count: usize) -> Vec<f64> {
    values(effect, Environment::default(), 1, count).iter().map(|all| all[GYRO as usize]).collect()
}

fn covariance(values: &[f64], lag: usize) -> f64 {
    values.iter().zip(&values[lag..]).map(|(a, b)| a * b).sum::<f64>() / (values.len() - lag) as f64
}

/// Simulates a part at rest, without noise or with that of the paper.
fn record(noise: NoiseModel, effects: Vec<InjectedEffect>, seconds: f64) -> Recording {
    let scenario = SensorScenario { effects, ..SensorScenario::default() };
    Simulation { noise, scenario, ..Simulation::paper(seconds, 5) }.run(|_| ()).unwrap()
}

fn counts(recording: &Recording, channel: OutputRegister) -> Vec<f64> {
    recording.samples.iter().map(|sample| f64::from(sample.counts.get(simulation::channel(channel)))).collect()
}

#[test]
fn deterministic_effects_follow_their_formulas() {
    let line =
        gyro(InjectedEffect::Sinusoid { channel: GYRO, frequency_hz: 3.0, amplitude: 2.0, phase_rad: 0.4 }, 1000);
    let ramp = gyro(InjectedEffect::RateRamp { channel: GYRO, slope: 0.5 }, 1000);
    let step = gyro(InjectedEffect::BiasStep { channel: GYRO, time_s: 4.0, size: -1.5 }, 1000);
    for k in 0..1000 {
        let time = k as f64 / 100.0;
        assert!((line[k] - 2.0 * (6.0 * std::f64::consts::PI * time + 0.4).sin()).abs() < 1e-12);
        assert!((ramp[k] - 0.5 * time).abs() < 1e-12);
        assert_eq!(step[k], if k < 400 { 0.0 } else { -1.5 });
    }
}

/// The standard error of a covariance over `count` samples of correlation time `T` is at most `σ²·√(2T/(count·dt))`
/// for a Gaussian process (Bartlett); six of them are allowed.
#[test]
fn random_effects_have_the_covariance_of_their_definition() {
    const COUNT: usize = 400_000;
    let (deviation, time_constant_s) = (0.7, 0.2);
    let tolerance = |time_s: f64| 6.0 * deviation * deviation * (2.0 * time_s / (COUNT as f64 * PERIOD_S)).sqrt();

    let markov = gyro(InjectedEffect::Markov { channel: GYRO, time_constant_s, deviation }, COUNT);
    let amplitude = 2.0 * deviation;
    let telegraph = gyro(InjectedEffect::Telegraph { channel: GYRO, time_constant_s, amplitude }, COUNT);
    let bandwidth_hz = 1.0 / (std::f64::consts::PI * time_constant_s);
    let resonance =
        gyro(InjectedEffect::Resonance { channel: GYRO, frequency_hz: 7.0, bandwidth_hz, deviation }, COUNT);
    for lag in [0, 3, 10, 20, 50] {
        let time = lag as f64 * PERIOD_S;
        let decay = deviation * deviation * (-time / time_constant_s).exp();
        assert!((covariance(&markov, lag) - decay).abs() < tolerance(time_constant_s), "Markov, lag {lag}");
        assert!((covariance(&telegraph, lag) - decay).abs() < tolerance(time_constant_s), "telegraph, lag {lag}");
        let ringing = decay * (2.0 * std::f64::consts::PI * 7.0 * time).cos();
        assert!((covariance(&resonance, lag) - ringing).abs() < tolerance(time_constant_s), "resonance, lag {lag}");
    }
    assert!(telegraph.iter().all(|value| value.abs() == deviation), "two levels");
}

#[test]
fn spikes_are_single_and_as_frequent_as_they_say() {
    let spikes = gyro(InjectedEffect::Spikes { channel: GYRO, rate_per_hour: 3600.0, size: 4.0 }, 400_000);
    let up = spikes.iter().filter(|value| **value == 4.0).count() as f64;
    let down = spikes.iter().filter(|value| **value == -4.0).count() as f64;
    // Spikes come once a second: a Poisson number of mean 4000, less the 0.5 % that coincide. The tolerance is six
    // deviations.
    assert!((up + down - 3980.0).abs() < 6.0 * 4000f64.sqrt(), "{up} up, {down} down");
    assert!((up - down).abs() < 6.0 * 4000f64.sqrt());
    assert_eq!(up as usize + down as usize + spikes.iter().filter(|value| **value == 0.0).count(), spikes.len());
}

#[test]
fn sensitivities_multiply_what_the_outputs_show() {
    let environment = Environment {
        temperature: TemperatureProfile { rise_c: 6.0, cycle_c: 1.0, ..Default::default() },
        supply: SupplyProfile { load_v: 0.1, cycle_v: 0.02, ..Default::default() },
        motion: Motion { deviation_g: 0.3, ..Default::default() },
    };
    let sensitivity = [0.2, -0.1, 0.05];
    let warm = values(InjectedEffect::Temperature { channel: GYRO, sensitivity: 0.03 }, environment, 2, 50_000);
    let fed = values(InjectedEffect::Supply { channel: GYRO, sensitivity: -2.0 }, environment, 2, 50_000);
    let moved = values(InjectedEffect::Acceleration { channel: GYRO, sensitivity }, environment, 2, 50_000);
    for ((warm, fed), moved) in warm.iter().zip(&fed).zip(&moved) {
        let gyro = GYRO as usize;
        assert!((warm[gyro] - 0.03 * warm[OutputRegister::Temp as usize]).abs() < 1e-12);
        assert!((fed[gyro] + 2.0 * fed[OutputRegister::Supply as usize]).abs() < 1e-12);
        let force = &moved[OutputRegister::AcclX as usize..=OutputRegister::AcclZ as usize];
        let expected: f64 = force.iter().zip(sensitivity).map(|(force, per_g)| force * per_g).sum();
        assert!((moved[gyro] - expected).abs() < 1e-12);
    }
    // Time 500 s is in a warm-up of 600 s, and 5/9 of the room's cycle of 900 s.
    let expected = 6.0 * (1.0 - (-499.99f64 / 600.0).exp()) + (2.0 * std::f64::consts::PI * 499.99 / 900.0).sin();
    assert!((warm[49_999][OutputRegister::Temp as usize] - expected).abs() < 1e-9);
}

#[test]
fn a_common_mode_is_the_same_in_every_channel() {
    let channels = vec![OutputRegister::GyroX, OutputRegister::GyroZ];
    let effect = InjectedEffect::CommonMode { channels, time_constant_s: 1.0, deviation: 0.5 };
    for all in values(effect, Environment::default(), 3, 1000) {
        assert_eq!(all[OutputRegister::GyroX as usize], all[OutputRegister::GyroZ as usize]);
        assert_eq!(all[OutputRegister::GyroY as usize], 0.0);
    }
}

#[test]
fn a_quantized_angle_has_the_allan_variance_of_quantization_noise() {
    // White noise dithers the angle: its step per sample is half a quantum.
    let coefficient = 0.2 * PERIOD_S;
    let quantum = 12f64.sqrt() * coefficient;
    let mut noise = NoiseModel::noiseless();
    noise.channel_mut(GYRO).angle_random_walk = 0.5 * quantum / PERIOD_S.sqrt();
    let mut source = NoiseSource::new(&noise, 4, PERIOD_S);
    let mut scenario = EffectSource::new(
        &SensorScenario {
            effects: vec![InjectedEffect::Quantization { channel: GYRO, coefficient }],
            ..SensorScenario::default()
        },
        4,
    );
    let (mut error, mut errors) = (0.0, Vec::new());
    for _ in 0..200_000 {
        let rate = source.sample()[GYRO as usize];
        let shown = scenario.digitize(GYRO, rate, PERIOD_S);
        let angle = shown * PERIOD_S / quantum;
        assert!((angle - angle.round()).abs() < 1e-9, "whole steps");
        assert_eq!(scenario.digitize(OutputRegister::GyroY, rate, PERIOD_S), rate);
        error += (shown - rate) * PERIOD_S;
        errors.push(error);
    }
    // σ² = 3Q²/τ² is that of a white angle error with variance Q². At a step of half a quantum the lag-1 correlation is
    // 6/π²·exp(−2π²/4) = 0.4 %.
    let tolerance = 6.0 * coefficient * coefficient / (errors.len() as f64).sqrt();
    assert!((covariance(&errors, 0) / (coefficient * coefficient) - 1.0).abs() < 0.01);
    assert!((covariance(&errors, 1) / (coefficient * coefficient) - 0.0044).abs() < tolerance.max(0.014));
}

#[test]
fn an_effect_does_not_change_the_noise() {
    let step = InjectedEffect::BiasStep { channel: GYRO, time_s: 5.0, size: 10.0 };
    let plain = record(NoiseModel::paper(), Vec::new(), 10.0);
    let stepped = record(NoiseModel::paper(), vec![step.clone()], 10.0);
    assert_eq!(stepped, record(NoiseModel::paper(), vec![step], 10.0));
    assert_eq!(counts(&plain, OutputRegister::GyroY), counts(&stepped, OutputRegister::GyroY));
    let moved: Vec<f64> =
        counts(&stepped, GYRO).iter().zip(counts(&plain, GYRO)).map(|(stepped, plain)| stepped - plain).collect();
    // 10 deg/s are 200 counts of 0.05 deg/s.
    assert_eq!((moved[0], moved[2047]), (0.0, 200.0));
    assert_eq!(moved.iter().filter(|moved| **moved == 0.0 || **moved == 200.0).count(), 2048);
}

#[test]
fn the_filter_reduces_the_variance_as_a_triangle_does() {
    let filtered = record(NoiseModel::paper(), vec![InjectedEffect::FilterBandwidth { taps_log2: 2 }], 200.0);
    let plain = record(NoiseModel::paper(), Vec::new(), 200.0);
    let difference_variance = |recording: &Recording| {
        let counts = counts(recording, GYRO);
        counts.windows(9).map(|window| (window[8] - window[0]).powi(2)).sum::<f64>() / (counts.len() - 8) as f64
    };
    // Two averages of 4 have the weights 1 2 3 4 3 2 1 over 16, whose squares sum to 44/256. Samples 8 apart share no
    // input.
    let ratio = difference_variance(&filtered) / difference_variance(&plain);
    assert!((ratio / (44.0 / 256.0) - 1.0).abs() < 0.05, "{ratio}");
}

#[test]
fn samples_go_missing_repeat_and_come_at_another_rate() {
    const SAMPLES: f64 = 204.8 * 200.0;
    let missing = record(NoiseModel::paper(), vec![InjectedEffect::DroppedSamples { fraction: 0.01 }], 200.0);
    let lost = SAMPLES - missing.samples.len() as f64;
    assert!((lost - 0.01 * SAMPLES).abs() < 6.0 * (0.01 * SAMPLES).sqrt(), "{lost}");

    let stale = record(NoiseModel::paper(), vec![InjectedEffect::RepeatedSamples { fraction: 0.01 }], 200.0);
    let repeated = stale.samples.iter().filter(|sample| sample.faults.contains(Faults::REPEATED)).count() as f64;
    assert!((repeated - 0.01 * SAMPLES).abs() < 6.0 * (0.01 * SAMPLES).sqrt(), "{repeated}");
    assert!(stale.samples.iter().all(|sample| !sample.faults.contains(Faults::NO_NEW_DATA)));

    let fast = record(NoiseModel::noiseless(), vec![InjectedEffect::SampleClock { ratio: 1.001 }], 20.0);
    let time = |at: usize| fast.samples[at].time_stamp.time_s.unwrap();
    assert!(((time(4095) - time(0)) * 204.8 * 1.001 / 4095.0 - 1.0).abs() < 1e-8);
}

#[test]
fn each_output_register_is_the_channel_of_the_same_name() {
    for (index, output) in OutputRegister::ALL.into_iter().enumerate() {
        assert_eq!(format!("{output:?}"), format!("{:?}", simulation::channel(output)));
        assert_eq!(simulation::output_register(Channel::ALL[index]), output);
    }
}
