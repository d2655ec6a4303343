//! Every detector on recordings of the virtual sensor, with and without the effect.

use super::bias::{self, BiasChanges};
use super::effective_lsb;
use super::spikes::SpikeRule;
use crate::bounds::Parameter;
use crate::distributions::{poisson_bounds, poisson_tail, quantile, upper_tail};
use crate::effects::findings::{Correction, Detection};
use crate::effects::{Effect, RateChange};
use crate::record::sampling_faults;
use crate::samples::series::Series;
use adis16405_driver::Channel;
use measurement::Measurement;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Exp1, StandardNormal, StudentT};
use simulation::{HostClock, Simulation};
use std::f64::consts::TAU;
use std::ops::Range;
use virtual_sensor::{Environment, InjectedEffect, OutputRegister, SensorScenario, TemperatureProfile};

const GYRO: Channel = Channel::GyroY;
const SENSED_GYRO: OutputRegister = OutputRegister::GyroY;

/// At 204.8 Hz with the paper's N and rounding to 0.05 deg/s.
fn white() -> f64 {
    (0.0368f64.powi(2) * 204.8 + 0.05f64.powi(2) / 12.0).sqrt()
}

fn find_spikes(series: &Series, louder: &[Range<u64>]) -> Option<Detection> {
    SpikeRule::fit(series)?.detect(series, louder)
}

struct Case {
    measurement: Measurement,
}

impl Case {
    fn hiding(effects: Vec<InjectedEffect>, seconds: f64, seed: u64) -> Self {
        Self::of(Simulation {
            scenario: SensorScenario { effects, environment: Environment::default() },
            host: HostClock { latency_s: 30e-6, clock_ratio: 1.0 },
            ..Simulation::paper(seconds, seed)
        })
    }

    fn of(simulation: Simulation) -> Self {
        let recording = simulation.run(|_| ()).unwrap();
        Self { measurement: recordings::time_base::measurement(&recording, None).unwrap() }
    }

    fn series(&self, channel: Channel) -> Series {
        let channel = self.measurement.named(channel.name()).expect("a recorded channel");
        Series::from_measurement(&self.measurement, channel)
    }

    fn detections(&self) -> Vec<Detection> {
        let channels = Channel::INERTIAL.into_iter().flat_map(|channel| {
            let series = self.series(channel);
            let BiasChanges { step, ramp, .. } = bias_changes(&series);
            [find_spikes(&series, &[]), step, ramp]
        });
        let common = [
            sampling_faults::lost_samples_of(&self.measurement),
            sampling_faults::repeated_samples(&self.measurement),
            sampling_faults::sample_clock(&self.measurement),
        ];
        channels.chain(common).flatten().collect()
    }
}

fn bias_changes(series: &Series) -> BiasChanges {
    bias::find(series, &[], &[], &|| 0.0)
}

fn value_of(detection: &Detection, name: &str) -> Parameter {
    detection.effect.parameters()[name].clone()
}

fn assert_covers(detection: &Detection, name: &str, truth: f64) {
    let parameter = value_of(detection, name);
    assert!(parameter.low <= truth && truth <= parameter.high, "{name}: {truth} outside {parameter:?}");
    assert!(parameter.low <= parameter.value && parameter.value <= parameter.high, "{name}: {parameter:?}");
}

#[test]
fn nothing_is_detected_in_pure_noise() {
    for seed in 0..4 {
        assert_eq!(Case::hiding(Vec::new(), 400.0, seed).detections(), []);
    }
}

#[test]
fn a_strong_random_walk_is_no_step() {
    for seed in 10..13 {
        let mut simulation = Simulation::paper(400.0, seed);
        for channel in OutputRegister::INERTIAL {
            simulation.noise.channel_mut(channel).rate_random_walk *= 10.0;
        }
        assert_eq!(Case::of(simulation).detections(), []);
    }
}

#[test]
fn spikes_are_counted_measured_and_removed() {
    let size = 9.0 * white();
    let case =
        Case::hiding(vec![InjectedEffect::Spikes { channel: SENSED_GYRO, rate_per_hour: 300.0, size }], 600.0, 2);
    let series = case.series(GYRO);
    let detection = find_spikes(&series, &[]).unwrap();
    assert_eq!(detection.effect.name(), "spikes");
    assert_covers(&detection, "rate", 300.0);
    assert_covers(&detection, "size", size);
    assert!((value_of(&detection, "size").value / size - 1.0).abs() < 0.05);

    let corrected = series.clone().corrected(detection.correction.as_ref().unwrap());
    let Some(Correction::Exclude(positions)) = &detection.correction else { panic!("{:?}", detection.correction) };
    assert_eq!(corrected.values.len(), series.values.len() - positions.len());
    assert_eq!(corrected.slots.last(), series.slots.last());
    assert_eq!(find_spikes(&corrected, &[]), None);
    assert_eq!(find_spikes(&case.series(Channel::GyroX), &[]), None);
    assert_eq!(bias_changes(&series).step, None);
}

#[test]
fn a_spike_of_1_7_sigma_is_found_in_filtered_noise() {
    // Behind the filter, so added to the recorded samples.
    let case = Case::hiding(vec![InjectedEffect::FilterBandwidth { taps_log2: 3 }], 200.0, 3);
    let mut series = case.series(GYRO);
    assert_eq!(find_spikes(&series, &[]), None);
    // Two averages of 8 leave 0.29 of the white noise: 1.7 σ of the samples, far more than the interpolation error.
    series.values_mut()[20_000] += 0.5 * white();
    let detection = find_spikes(&series, &[]).unwrap();
    assert_eq!(detection.correction, Some(Correction::Exclude(vec![20_000])));
}

/// Two averages of two samples leave half of a spike in its sample and a quarter in either neighbour.
#[test]
fn spikes_before_the_filter_are_counted() {
    let spikes = InjectedEffect::Spikes { channel: SENSED_GYRO, rate_per_hour: 300.0, size: 25.0 * white() };
    let case = Case::hiding(vec![InjectedEffect::FilterBandwidth { taps_log2: 1 }, spikes], 600.0, 5);
    assert_covers(&find_spikes(&case.series(GYRO), &[]).expect("50 spikes"), "rate", 300.0);
}

/// 4 standard deviations of the interpolation error, 7.8 of the prediction error.
#[test]
fn a_prediction_shows_spikes_that_an_interpolation_does_not() {
    let spikes = InjectedEffect::Spikes { channel: SENSED_GYRO, rate_per_hour: 300.0, size: 9.0 * white() };
    let case = Case::hiding(vec![InjectedEffect::FilterBandwidth { taps_log2: 1 }, spikes], 600.0, 7);
    let detection = find_spikes(&case.series(GYRO), &[]).expect("50 spikes");
    assert_covers(&detection, "rate", 300.0);
    // The first changed sample has a quarter of it.
    assert_covers(&detection, "size", 0.25 * 9.0 * white());
    for (taps_log2, seed) in (1..=3).flat_map(|taps_log2| (10..15).map(move |seed| (taps_log2, seed))) {
        let case = Case::hiding(vec![InjectedEffect::FilterBandwidth { taps_log2 }], 200.0, seed);
        assert_eq!(find_spikes(&case.series(GYRO), &[]), None);
    }
}

/// A blow that rings at 6.4 Hz and decays within 0.1 s, and a half sine of 0.3 s.
#[test]
fn a_blow_is_not_interpolated_from_its_own_samples() {
    let rings = |since_s: f64| (-10.0 * since_s).exp() * (TAU * 6.4 * since_s).sin();
    let pushes = |since_s: f64| (TAU * since_s / 0.6).sin().max(0.0) * f64::from(u8::from(since_s < 0.3));
    for (seed, blow) in [(6, &rings as &dyn Fn(f64) -> f64), (7, &pushes)] {
        let mut series = Case::hiding(Vec::new(), 400.0, seed).series(GYRO);
        for (at, value) in series.values_mut()[40_000..].iter_mut().enumerate() {
            *value += 30.0 * white() * blow(at as f64 / 204.8);
        }
        let rule = SpikeRule::fit(&series).expect("samples that change");
        let (_, disturbances) = rule.separate(rule.find(&series), series.values.len() as u64);
        let [found] = disturbances.as_slice() else { panic!("{disturbances:?}") };
        // Six times the noise after 2 or 4 samples, less after 32 or 57.
        assert!((40_000..40_010).contains(&found.certain.start), "{found:?}");
        assert!((40_020..40_062).contains(&found.certain.end), "{found:?}");
    }
}

#[test]
fn loud_noise_has_no_spikes_and_spikes_stand_out_of_it() {
    let mut series = Case::hiding(Vec::new(), 400.0, 9).series(GYRO);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let kept = (-1.0f64 / 100.0).exp();
    let mut level = 0.0;
    for value in series.values_mut() {
        let [normal, step]: [f64; 2] = [(); 2].map(|()| random.sample(StandardNormal));
        level = kept * level + (1.0 - kept * kept).sqrt() * step;
        *value += white() * 2f64.powf(level) * normal;
    }
    assert_eq!(find_spikes(&series, &[]), None);
    let spikes = [10_000, 30_000, 50_000];
    spikes.iter().for_each(|&at| series.values_mut()[at] += 60.0 * white());
    assert_eq!(
        find_spikes(&series, &[]).unwrap().correction,
        Some(Correction::Exclude(spikes.map(|at| at as u64).into()))
    );
}

/// More than fifty of 200 louder samples are beyond the limit, and a few beyond that of the noise around them.
#[test]
fn other_spikes_make_no_spikes_of_louder_noise() {
    let mut series = Case::hiding(Vec::new(), 400.0, 9).series(GYRO);
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for value in &mut series.values_mut()[20_000..20_200] {
        *value += 6.0 * white() * random.sample::<f64, _>(StandardNormal);
    }
    let spikes: Vec<u64> = (0..100).map(|number| 25_000 + 400 * number).collect();
    spikes.iter().for_each(|&at| series.values_mut()[at as usize] += 60.0 * white());
    let found = find_spikes(&series, &[]).expect("spikes");
    let (louder, others): (Vec<u64>, Vec<u64>) = found.excluded().iter().partition(|slot| **slot < 21_000);
    assert_eq!(others, spikes);
    assert!(louder.len() < 8, "{louder:?}");
}

/// Exponential, Laplace and Student noise, and ten samples beyond 30,000 exponential ones.
#[test]
fn noise_with_heavy_tails_has_no_spikes() {
    let noise = |kind: &str, seed: u64| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let student = StudentT::new(5.0).expect("degrees of freedom");
        let values = (0..30_000).map(|_| match kind {
            "exponential" => random.sample::<f64, _>(Exp1),
            "Laplace" => random.sample::<f64, _>(Exp1) * if random.random() { 1.0 } else { -1.0 },
            _ => random.sample(student),
        });
        let values: Vec<f64> = values.collect();
        Series {
            slots: (0..30_000).collect(),
            values: values.into(),
            span: 0..30_000,
            period_s: 0.01,
            resolution: 1e-5,
            unit: "deg/s",
        }
    };
    for kind in ["exponential", "Laplace", "Student"] {
        let found = (0..20).filter(|seed| find_spikes(&noise(kind, *seed), &[]).is_some()).count();
        assert_eq!(found, 0, "{kind}");
    }
    let mut with_spikes = noise("exponential", 30);
    (0..10).for_each(|number| with_spikes.values_mut()[1500 + 2500 * number] += 200.0);
    let found = find_spikes(&with_spikes, &[]).expect("ten spikes");
    assert_eq!(found.effect.parameters()["size"].value.round(), 200.0);
    assert_eq!(found.excluded().len(), 10);
}

#[test]
fn a_step_is_located_measured_and_removed() {
    let step = InjectedEffect::BiasStep { channel: SENSED_GYRO, time_s: 333.0, size: -0.15 };
    let case = Case::hiding(vec![step], 600.0, 4);
    let series = case.series(GYRO);
    let detection = bias_changes(&series).step.unwrap();
    assert_covers(&detection, "time", 333.0);
    assert_covers(&detection, "size", -0.15);
    assert!((value_of(&detection, "size").value / -0.15 - 1.0).abs() < 0.2);
    assert_eq!(find_spikes(&series, &[]), None);
    assert_eq!(bias_changes(&series.corrected(detection.correction.as_ref().unwrap())).step, None);
    assert_eq!(bias_changes(&case.series(Channel::GyroZ)).step, None);
}

/// A bias that drifts over the middle between two counts, in noise of an eighth of one.
#[test]
fn where_the_noise_is_below_a_count_neighbouring_counts_are_no_step() {
    let series = |counts: f64| {
        let mut series = Case::hiding(Vec::new(), 600.0, 23).series(GYRO);
        let mut random = ChaCha8Rng::seed_from_u64(24);
        let (resolution, half) = (series.resolution, series.values.len() / 2);
        for (at, value) in series.values_mut().iter_mut().enumerate() {
            let bias = 0.3 + if at < half { 0.0 } else { counts };
            *value = (bias + random.sample::<f64, _>(StandardNormal) / 8.0).round() * resolution;
        }
        series
    };
    let found = |series: &Series, least_counts: f64| {
        bias::find(series, &[], &[], &|| least_counts * series.resolution).step.is_some()
    };
    let (near, far) = (series(0.4), series(3.0));
    assert!(found(&near, 0.0) && !found(&near, 1.5));
    assert!(found(&far, 0.0) && found(&far, 1.5));
}

#[test]
fn a_ramp_that_others_explain_is_none() {
    const SAMPLES: usize = 60_000;
    let series = |values: Vec<f64>| Series {
        slots: (0..SAMPLES as u64).collect(),
        values: values.into(),
        span: 0..SAMPLES as u64,
        period_s: 0.01,
        resolution: 1e-6,
        unit: "deg/s",
    };
    let time = |at: usize| at as f64 / SAMPLES as f64;
    let drifting = |turns: f64| (0..SAMPLES).map(|at| time(at) + 0.03 * (TAU * turns * time(at)).sin()).collect();
    let regressors: [Vec<f64>; 3] = [3.0, 5.0, 7.0].map(drifting);
    let mut random = ChaCha8Rng::seed_from_u64(61);
    let sum = |at: usize| regressors.iter().map(|of| of[at]).sum::<f64>();
    let bias = series((0..SAMPLES).map(|at| sum(at) + 0.1 * random.sample::<f64, _>(StandardNormal)).collect());
    let regressors = regressors.map(series);
    let BiasChanges { ramp, sensitivities, .. } = bias::find(&bias, &regressors.each_ref(), &[], &|| 0.0);
    assert_eq!((ramp, sensitivities.len()), (None, 3));
    for (_, of) in sensitivities {
        assert!((of.sensitivity - 1.0).abs() < 4.0 * of.error, "{of:?}");
    }
}

#[test]
fn a_small_step_hides_no_large_one() {
    let step = |time_s: f64, size: f64| InjectedEffect::BiasStep { channel: SENSED_GYRO, time_s, size };
    let found = |second: f64| {
        let case = Case::hiding(vec![step(333.0, -3.0), step(480.0, second)], 600.0, 4);
        bias_changes(&case.series(GYRO)).step
    };
    let step = found(0.2).expect("a step");
    assert!((value_of(&step, "time").value - 333.0).abs() < 0.1, "{step:?}");
    assert!((value_of(&step, "size").value / -3.0 - 1.0).abs() < 0.03, "{step:?}");
    assert_eq!(found(2.9), None);
}

#[test]
fn ramps_telegraph_noise_and_temperature_are_no_steps() {
    let ramp = InjectedEffect::RateRamp { channel: SENSED_GYRO, slope: 1e-3 };
    assert_eq!(bias_changes(&Case::hiding(vec![ramp], 600.0, 5).series(GYRO)).step, None);

    let telegraph = InjectedEffect::Telegraph { channel: SENSED_GYRO, time_constant_s: 20.0, amplitude: 0.3 };
    assert_eq!(bias_changes(&Case::hiding(vec![telegraph], 600.0, 6).series(GYRO)).step, None);

    let mut simulation = Simulation::paper(600.0, 7);
    simulation.scenario.effects = vec![InjectedEffect::Temperature { channel: SENSED_GYRO, sensitivity: 0.05 }];
    simulation.scenario.environment.temperature =
        TemperatureProfile { rise_c: 6.0, time_constant_s: 60.0, ..TemperatureProfile::default() };
    let case = Case::of(simulation);
    assert_eq!(bias::find(&case.series(GYRO), &[&case.series(Channel::Temp)], &[], &|| 0.0).step, None);
}

#[test]
fn a_ramp_is_measured_and_is_no_step() {
    let case = Case::hiding(vec![InjectedEffect::RateRamp { channel: SENSED_GYRO, slope: -1e-3 }], 600.0, 14);
    let series = case.series(GYRO);
    let detection = bias_changes(&series).ramp.unwrap();
    assert_covers(&detection, "slope", -1e-3);
    assert!((value_of(&detection, "slope").value / -1e-3 - 1.0).abs() < 0.2);
    let per_slot = value_of(&detection, "slope").value * series.period_s;
    let mut levelled = series;
    let slots = levelled.slots.clone();
    for (value, &slot) in levelled.values_mut().iter_mut().zip(slots.iter()) {
        *value -= per_slot * slot as f64;
    }
    assert_eq!(bias_changes(&levelled).ramp, None);

    let step = InjectedEffect::BiasStep { channel: SENSED_GYRO, time_s: 300.0, size: 0.3 };
    assert_eq!(bias_changes(&Case::hiding(vec![step], 600.0, 15).series(GYRO)).ramp, None);
}

#[test]
fn a_ramp_and_a_step_are_found_together() {
    let effects = vec![
        InjectedEffect::RateRamp { channel: SENSED_GYRO, slope: 1e-3 },
        InjectedEffect::BiasStep { channel: SENSED_GYRO, time_s: 200.0, size: 0.3 },
    ];
    let BiasChanges { step, ramp, .. } = bias_changes(&Case::hiding(effects, 600.0, 16).series(GYRO));
    assert_covers(&ramp.unwrap(), "slope", 1e-3);
    let step = step.unwrap();
    assert_covers(&step, "size", 0.3);
    // The sensor starts a little before the record.
    assert!((value_of(&step, "time").value - 200.0).abs() < 1.0, "{step:?}");
}

#[test]
fn dependence_on_temperature_is_no_ramp() {
    let warming = |effect: InjectedEffect, rise_c: f64, seed: u64| {
        let mut simulation = Simulation::paper(600.0, seed);
        simulation.scenario.effects = vec![effect];
        simulation.scenario.environment.temperature =
            TemperatureProfile { rise_c, time_constant_s: 100.0, ..TemperatureProfile::default() };
        Case::of(simulation)
    };
    let case = warming(InjectedEffect::Temperature { channel: SENSED_GYRO, sensitivity: -0.05 }, 8.0, 17);
    let follows =
        |case: &Case, channel: Channel| bias::find(&case.series(channel), &[&case.series(Channel::Temp)], &[], &|| 0.0);
    let BiasChanges { ramp, sensitivities, .. } = follows(&case, GYRO);
    assert_eq!(ramp, None);
    let (0, sensitivities) = sensitivities[0] else { panic!("{sensitivities:?}") };
    assert!((sensitivities.sensitivity + 0.05).abs() < 3.0 * sensitivities.error, "{sensitivities:?}");
    assert!(sensitivities.error < 0.005, "{sensitivities:?}");
    assert_eq!(follows(&case, Channel::GyroX), BiasChanges::default());
    // A temperature that stays within half a count of 0.14 °C is no regressor.
    let still = warming(InjectedEffect::Temperature { channel: SENSED_GYRO, sensitivity: -5.0 }, 0.07, 17);
    assert_eq!(follows(&still, GYRO).sensitivities, []);

    let BiasChanges { ramp, sensitivities, .. } =
        follows(&warming(InjectedEffect::RateRamp { channel: SENSED_GYRO, slope: 1e-3 }, 8.0, 18), GYRO);
    assert!(ramp.is_some() && sensitivities.is_empty(), "{ramp:?} {sensitivities:?}");
}

#[test]
fn values_of_twelve_bits_have_an_lsb_of_four_counts() {
    let series = Case::hiding(Vec::new(), 60.0, 19).series(GYRO);
    assert_eq!(effective_lsb::find(&series), None);
    let count = 0.05;
    let values = series.values.iter().map(|value| (value / count / 4.0).round() * 4.0 * count).collect();
    let coarse = Series { values, slots: series.slots.clone(), ..series };
    let detection = effective_lsb::find(&coarse).unwrap();
    assert_eq!(detection.effect.name(), "quantization");
    assert!((value_of(&detection, "step").value - 0.2).abs() < 1e-9);
    let values = (0..coarse.values.len()).map(|at| if at % 5_000 < 2_500 { 0.0 } else { 0.2 }).collect();
    assert_eq!(effective_lsb::find(&Series { values, slots: coarse.slots.clone(), ..coarse }), None);
}

#[test]
fn lost_and_repeated_samples_are_counted() {
    let lossy = Case::hiding(vec![InjectedEffect::DroppedSamples { fraction: 2e-3 }], 200.0, 8);
    let detection = sampling_faults::lost_samples_of(&lossy.measurement).unwrap();
    assert_covers(&detection, "fraction", 2e-3);
    assert_eq!(sampling_faults::repeated_samples(&lossy.measurement), None);

    // A long filter makes neighbours equal often.
    let slow = Case::hiding(vec![InjectedEffect::FilterBandwidth { taps_log2: 4 }], 100.0, 11);
    assert_eq!(sampling_faults::repeated_samples(&slow.measurement), None);

    let stale = Case::hiding(vec![InjectedEffect::RepeatedSamples { fraction: 2e-3 }], 200.0, 9);
    let detection = sampling_faults::repeated_samples(&stale.measurement).unwrap();
    assert_covers(&detection, "fraction", 2e-3);
    assert_eq!(sampling_faults::lost_samples_of(&stale.measurement), None);
    let Some(Correction::Exclude(positions)) = &detection.correction else { panic!("{:?}", detection.correction) };
    let values = stale.series(GYRO).values;
    assert!(positions.iter().all(|&slot| values[slot as usize] == values[slot as usize - 1]));
}

#[test]
fn a_deviating_sample_clock_is_distinguished_from_a_deviating_host_clock() {
    let simulation = |effects: Vec<InjectedEffect>, clock_ratio: f64| Simulation {
        scenario: SensorScenario { effects, ..SensorScenario::default() },
        host: HostClock { latency_s: 30e-6, clock_ratio },
        ..Simulation::paper(100.0, 10)
    };
    let find = |case: Case| sampling_faults::sample_clock(&case.measurement);
    // Tolerance of the data sheet: percent; of a host's clock: 10⁻⁵.
    let off = find(Case::of(simulation(vec![InjectedEffect::SampleClock { ratio: 0.997 }], 1.0 + 20e-6))).unwrap();
    assert_covers(&off, "rate_hz", 204.8 * 0.997);
    assert_eq!(find(Case::of(simulation(Vec::new(), 1.0 + 40e-6))), None);
}

/// 40,000 stamps at 204.8 Hz, jitter in s; `ratio` is the clock's rate over nominal.
fn stamped(jitter_s: f64, ratio: impl Fn(f64) -> f64) -> Option<Effect> {
    let mut case = Case::of(Simulation::paper(200.0, 12));
    let samples = case.measurement.len();
    let mut random = ChaCha8Rng::seed_from_u64(13);
    let mut time_s = 0.0;
    let stamps = (0..samples).map(|at| {
        time_s += 1.0 / (204.8 * ratio(at as f64 / samples as f64));
        time_s + jitter_s * random.sample::<f64, _>(StandardNormal)
    });
    case.measurement.times_s = Some(stamps.collect());
    sampling_faults::sample_clock(&case.measurement).map(|found| found.effect)
}

#[test]
fn a_clock_that_changes_its_rate_is_told_from_one_that_drifts() {
    for jitter_s in [0.0, 30e-6] {
        let stepping = stamped(jitter_s, |part| if part < 0.3 { 1.0 } else { 0.999 });
        let Some(Effect::ClockDeviation(clock)) = stepping else { panic!("{jitter_s}: {stepping:?}") };
        let RateChange { time_s, before_hz, after_hz, .. } = clock.change.expect("50 times an ordinary host's error");
        assert!(time_s.low <= 60.0 && 60.0 <= time_s.high, "{time_s:?}");
        for (found, rate_hz) in [(before_hz, 204.8), (after_hz, 204.8 * 0.999)] {
            assert!(found.low < rate_hz && rate_hz < found.high, "{found:?} {rate_hz}");
        }
    }
    let drifting = stamped(30e-6, |part| 1.0 - 0.001 * part);
    assert!(!matches!(drifting, Some(Effect::ClockDeviation(of)) if of.change.is_some()), "{drifting:?}");
    assert_eq!(stamped(30e-6, |_| 1.0), None);
}

#[test]
fn tail_probabilities_agree_with_tables() {
    for (z, probability) in [(1.0, 0.158_655_25), (1.959_964, 0.025), (5.0, 2.866_516e-7)] {
        assert!((upper_tail(z) / probability - 1.0).abs() < 1e-6);
        assert!((quantile(probability) - z).abs() < 1e-5);
    }
    // 1 − e⁻²(1 + 2 + 2) for three or more of mean 2.
    assert!((poisson_tail(3, 2.0) - 0.323_323_58).abs() < 1e-8);
    assert!((poisson_tail(2, 2.0) - 0.593_994_15).abs() < 1e-8);
    assert_eq!((poisson_tail(0, 2.0), poisson_tail(1, 0.0)), (1.0, 0.0));
    // Far from the mean, where terms vanish.
    assert_eq!((poisson_tail(2_000, 50_000.0), poisson_tail(50_000, 2_000.0)), (1.0, 0.0));
    // Exact (Garwood) bounds of a count of 10.
    let (low, high) = poisson_bounds(10.0);
    assert!((low - 4.795).abs() < 0.02 && (high - 18.390).abs() < 0.02, "{low} {high}");
}
