//! Generator, detection limit and score, compared with theory.

use super::channel_under_test::{
    ChannelUnderTest, RecordLength, baseline_density, filter_gain, markov_density, quantization_density,
    resonance_density,
};
use super::detection_limit::{
    ratio_of_spikes, ratio_of_telegraph, required_ratio, smallest_count, smallest_size, solve_size, strength,
    waveform_test,
};
use super::effect::{draw_unit, scaled, size};
use super::generator::Sampling;
use super::score::compare;
use super::truth::{TrueModelErrors, true_model_errors};
use super::{DrawnRecording, EffectKind, OutsideKind, RecordingGroup, TrueRecording, UndeclaredPlan};
use adis16405_driver::Channel;
use allan_core::NoiseTerm as Term;
use allan_core::term::{Markov, MovingAverageFilter, Resonance};
use clap::ValueEnum;
use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::effects::{
    ClockDeviation, CurveEvidence, DroppedSamples, Effect, LineEvidence, LineSource, MarkovEvidence, MarkovProcess,
    NoisyInterval, Observation, OutputFilter, ResonantLine, SinusoidalLine, Unexplained, UnexplainedPlace,
};
use noise_analysis::report::{
    ChannelEffect, ChannelReport, ModelErrorReport, ModelReport, PartReport, Report, SCHEMA, SlopeMethodReport,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use virtual_sensor::{ChannelNoise, InjectedEffect, NoiseModel, OutputRegister, SensorScenario};

const PERIOD_S: f64 = 1.0 / 204.8;
const RECORD: RecordLength = RecordLength { seconds: 1800.0, period_s: PERIOD_S };

fn gyro() -> ChannelNoise {
    *NoiseModel::paper().channel(OutputRegister::GyroX)
}

fn quiet(noise: NoiseModel) -> TrueRecording {
    let scenario = SensorScenario::default();
    let (sampling, outside) = (Sampling::adis16405(), Vec::new());
    TrueRecording { sampling, seconds: RECORD.seconds, seed: 1, noise, scenario, outside, host_clock_ratio: 1.0 }
}

#[test]
fn densities_are_those_of_the_terms() {
    let one = |n: f64, b: f64, k: f64| ChannelNoise {
        angle_random_walk: n,
        bias_instability: b,
        rate_random_walk: k,
        ..ChannelNoise::default()
    };
    for frequency in [0.01, 0.3, 5.0, 40.0, 99.0] {
        let baseline = |n, b, k| baseline_density(&one(n, b, k), 1.0, PERIOD_S, frequency);
        let pairs = [
            (baseline(1.0, 0.0, 0.0), Term::AngleRandomWalk),
            (baseline(0.0, 0.0, 1.0), Term::RateRandomWalk),
            (quantization_density(PERIOD_S, frequency), Term::Quantization),
            (markov_density(0.7, PERIOD_S, frequency), Term::Markov(Markov { time_constant: 0.7 })),
            (
                resonance_density(20.0, 2.0, PERIOD_S, frequency),
                Term::Resonance(Resonance { frequency: 20.0, bandwidth: 2.0 }),
            ),
            (filter_gain(3, PERIOD_S, frequency), Term::Filtered(MovingAverageFilter::bartlett(8))),
        ];
        for (ours, term) in pairs {
            let theirs = term.process().density(frequency, PERIOD_S);
            assert!((ours / theirs - 1.0).abs() < 1e-6, "{term:?} at {frequency} Hz: {ours:e}, {theirs:e}");
        }
    }
    // The aliases of flicker noise differ; far below the sample rate both densities are B²/(2πf).
    let flicker = baseline_density(&one(0.0, 1.0, 0.0), 1.0, PERIOD_S, 0.01);
    assert!((flicker / Term::BiasInstability.process().density(0.01, PERIOD_S) - 1.0).abs() < 0.01);
}

#[test]
fn noise_that_n_b_and_k_describe_has_no_likelihood_ratio() {
    let noise = gyro();
    let baseline = |frequency: f64| baseline_density(&noise, 1.0, PERIOD_S, frequency);
    let stronger = |frequency: f64| 2.0 * baseline(frequency);
    let (unfiltered, nothing) = (|_: f64| [1.0; 3], |_: f64| 0.0);
    assert!(RECORD.ratio_against_baseline(&noise, (unfiltered, nothing), None, stronger) < 1e-3);
    // The filter and the other noise are known.
    let filter = |frequency: f64| filter_gain(3, PERIOD_S, frequency);
    let known = |frequency: f64| 0.01 * markov_density(1.0, PERIOD_S, frequency);
    let truth = |frequency: f64| 2.0 * baseline(frequency) * filter(frequency) + known(frequency);
    assert!(RECORD.ratio_against_baseline(&noise, (|frequency| [filter(frequency); 3], known), None, truth) < 1e-3);
    // A Markov process with a time constant below a sample is white.
    let markov = |time_s: f64| {
        let truth = |frequency: f64| baseline(frequency) + 0.01 * markov_density(time_s, PERIOD_S, frequency);
        RECORD.ratio_against_baseline(&noise, (unfiltered, nothing), None, truth)
    };
    assert!(markov(1e-4) < 1e-3, "{}", markov(1e-4));
    assert!(markov(1.0) > 10.0, "{}", markov(1.0));
}

#[test]
fn likelihood_ratios_in_white_noise_equal_their_closed_forms() {
    assert!((required_ratio(1.0) - 0.5 * 2.326_348f64.powi(2)).abs() < 1e-4);
    assert!((solve_size(8.0, |size| 0.5 * size * size) - 4.0).abs() < 1e-6);

    let white = ChannelNoise { angle_random_walk: 0.5, ..ChannelNoise::default() };
    // The ratio of a sinusoid is half of A²·M/2/σ².
    let density = baseline_density(&white, 1.0, PERIOD_S, 10.0);
    assert!((RECORD.ratio_of_sinusoid(density) / (0.5 * 0.5 * 1800.0 / 0.25) - 1.0).abs() < 1e-9);
    // The waveform has a deviation of 0.1.
    let matched = RECORD.ratio_of_waveform(|_| 0.01 * PERIOD_S, |_| density);
    assert!((matched / (0.5 * 0.01 * 1800.0 / PERIOD_S / (0.25 / PERIOD_S)) - 1.0).abs() < 0.01, "{matched}");
}

/// A bias that alternates by block has the ratio `½·s²·M/σ²`, less some hundredths for a free N. A ramp of 30 is mostly
/// fitted by a walk.
#[test]
fn a_free_walk_takes_up_a_slow_drift_and_nothing_else() {
    let mut model = NoiseModel::paper();
    *model.channel_mut(OutputRegister::GyroX) = ChannelNoise { angle_random_walk: 0.5, ..ChannelNoise::default() };
    let recording = quiet(model);
    let test = waveform_test(&ChannelUnderTest::new(&recording, OutputRegister::GyroX, &[]));
    let rounding = 0.05f64.powi(2) / 12.0 * PERIOD_S / 0.25;
    let of = |ratio: f64, unit: fn(usize) -> f64| {
        let values: Vec<f64> = (0..128).map(unit).collect();
        let mean = values.iter().sum::<f64>() / 128.0;
        let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let size = (2.0 * ratio * 0.25 * (1.0 + rounding) / (RECORD.seconds / 128.0) / square).sqrt();
        test.ratio(&values.iter().map(|value| size * value).collect::<Vec<f64>>()) / ratio
    };
    let alternating = of(2.0, |block| if block % 2 == 0 { 1.0 } else { -1.0 });
    assert!((alternating - 1.0).abs() < 0.05, "{alternating}");
    let ramp = of(30.0, |block| block as f64);
    assert!(ramp > 0.0 && ramp < 0.7, "{ramp}");
}

/// The strength is checked for a process of few correlation times, and for events.
#[test]
fn the_strength_is_that_of_the_size_or_of_its_significance() {
    let (recording, channel) = (quiet(NoiseModel::paper()), OutputRegister::GyroX);
    let of = |effect: &InjectedEffect| strength(effect, &recording, &[]);
    let markov = |time_constant_s: f64, deviation: f64| InjectedEffect::Markov { channel, time_constant_s, deviation };
    let limit = |time_s: f64| smallest_size(&markov(time_s, 1.0), &recording, &[]);
    // With 1,800 correlation times the size determines the strength.
    assert!((of(&markov(1.0, 2.0 * limit(1.0))) - 2.0).abs() < 1e-6);
    // With fewer than four correlation times, only three frequencies distinguish it from a walk.
    assert!(of(&markov(500.0, 1e3)) < 2.0, "{}", of(&markov(500.0, 1e3)));
    // The limit is at ln 2 events.
    let dropped = |number: f64| InjectedEffect::DroppedSamples { fraction: number * PERIOD_S / RECORD.seconds };
    assert!((of(&dropped(9.0 * std::f64::consts::LN_2)) - 3.0).abs() < 1e-9);
    let spikes = InjectedEffect::Spikes { channel, rate_per_hour: 8.0 * std::f64::consts::LN_2, size: 1e3 };
    assert!((of(&spikes) - 2.0).abs() < 1e-9, "{}", of(&spikes));
}

#[test]
fn a_detection_limit_includes_the_other_effect() {
    let mut noise = NoiseModel::paper();
    *noise.channel_mut(OutputRegister::GyroX) = ChannelNoise { angle_random_walk: 0.5, ..ChannelNoise::default() };
    let recording = quiet(noise);
    let channel = OutputRegister::GyroX;
    let near = |ratio: f64, expected: f64| assert!((ratio / expected - 1.0).abs() < 0.01, "{ratio}, {expected}");
    let larger = |shape: &InjectedEffect, other: InjectedEffect| {
        smallest_size(shape, &recording, &[other]) / smallest_size(shape, &recording, &[])
    };

    // The densities add at the centre frequency.
    let line = InjectedEffect::Sinusoid { channel, frequency_hz: 20.0, amplitude: 1.0, phase_rad: 0.0 };
    let resonance = InjectedEffect::Resonance { channel, frequency_hz: 20.0, bandwidth_hz: 1.0, deviation: 2.0 };
    near(larger(&line, resonance), ((0.25 + 0.5 * 4.0 * 2.0 / (PI * 1.0)) / 0.25f64).sqrt());
    // The filter reduces both; the rounding behind it is 1 %.
    let rounding = |gain: f64| (0.25 + 0.05f64.powi(2) / 12.0 * PERIOD_S / gain) / 0.25;
    let gain = filter_gain(2, PERIOD_S, 20.0);
    near(larger(&line, InjectedEffect::FilterBandwidth { taps_log2: 2 }), (rounding(gain) / rounding(1.0)).sqrt());
    // The process has a white density of 2·σ²·T.
    let ramp = InjectedEffect::RateRamp { channel, slope: 1.0 };
    let markov = InjectedEffect::Markov { channel, time_constant_s: 0.5, deviation: 1.0 };
    near(larger(&ramp, markov), ((0.25 + 2.0 * 0.5) / 0.25f64).sqrt());
    // Spikes are white, and a known waveform changes nothing.
    let spikes = InjectedEffect::Spikes { channel, rate_per_hour: 3600.0, size: 10.0 };
    near(larger(&ramp, spikes.clone()), ((0.25 + 100.0 * PERIOD_S * PERIOD_S) / 0.25f64).sqrt());
    near(larger(&spikes, ramp), 1.0);
    near(
        larger(&line, InjectedEffect::Markov { channel: OutputRegister::GyroY, time_constant_s: 1.0, deviation: 9.0 }),
        1.0,
    );
}

#[test]
fn a_scaled_effect_has_the_scaled_size() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for kind in EffectKind::ALL {
        let unit = draw_unit(kind, OutputRegister::GyroY, RECORD, &mut random);
        assert!((size(&unit) - 1.0).abs() < 1e-12, "{unit:?}");
        let expected = if kind == EffectKind::FilterBandwidth { 1.0 } else { 0.25 };
        assert!((size(&scaled(unit, 0.25)) - expected).abs() < 1e-12, "{kind:?}");
    }
}

#[test]
fn both_effects_of_a_pair_are_above_twice_the_limit() {
    for seed in 0..40 {
        let pair = DrawnRecording::from_group(RecordingGroup::Pair, 450.0, seed);
        assert!(pair.strengths.iter().all(|strength| *strength >= 2.0), "{seed}: {:?}", pair.strengths);
    }
}

#[test]
fn the_ratio_of_rare_large_spikes_is_proportional_to_their_number() {
    // Each spike contributes s²/2 plus ln of the probability of its sample and sign.
    let (samples, probability, size) = (1e6, 1e-5f64, 12.0f64);
    let each = 0.5 * size * size + (0.5 * probability).ln();
    let expected = samples * probability * each - samples * probability;
    let ratio = ratio_of_spikes(samples, probability, size);
    assert!((ratio / expected - 1.0).abs() < 0.01, "{ratio}, {expected}");
    assert!(ratio_of_spikes(samples, probability, 0.1) < 1e-6);
    assert_eq!(smallest_count(0.0), std::f64::consts::LN_2);
}

#[test]
fn a_telegraph_signal_below_the_noise_is_not_distinguished_from_a_markov_process() {
    // The noise has a deviation of 1 over the correlation time.
    let ratio = |amplitude: f64| ratio_of_telegraph(amplitude, 1.0, 1.0, RECORD, 1);
    // The ratio falls with the eighth power of the amplitude; the simulation scatters.
    assert!(ratio(0.3).abs() < 1.0, "{}", ratio(0.3));
    assert!(ratio(3.0) > 10.0, "{}", ratio(3.0));
    assert!(ratio(30.0) > ratio(10.0) && ratio(10.0) > ratio(3.0));
}

#[test]
fn a_recording_depends_on_its_seed_only_and_no_seed_is_used_twice() {
    for kind in EffectKind::ALL {
        let drawn = DrawnRecording::from_group(RecordingGroup::Single(kind), 1800.0, 7);
        assert_eq!(drawn, DrawnRecording::draw(&[kind], 1800.0, 7));
        assert_eq!(drawn.simulation.scenario.effects[0].name(), kind.name());
        assert!(drawn.strengths[0] > 0.0, "{kind:?}");
        assert_ne!(drawn, DrawnRecording::from_group(RecordingGroup::Single(kind), 1800.0, 8));
    }
    let plan = |sealed| UndeclaredPlan {
        kinds: EffectKind::ALL.to_vec(),
        per_kind: 40,
        nothing: 200,
        pairs: 200,
        triples: 50,
        outside: 20,
        seconds: 1800.0,
        loss_percent: 0.0,
        seed: 0,
        sealed,
        jobs: 1,
    };
    let mut seeds: Vec<u64> =
        plan(false).recordings().into_iter().chain(plan(true).recordings()).map(|(_, seed)| seed).collect();
    assert_eq!(seeds.len(), 2 * (200 + 16 * 40 + 200 + 50 + 15 * 20));
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), 2 * (200 + 16 * 40 + 200 + 50 + 15 * 20), "no seed is used twice");
    let differ = |kinds: [EffectKind; 3]| kinds[0] != kinds[1] && kinds[1] != kinds[2] && kinds[0] != kinds[2];
    assert!((0..100).all(|seed| differ(DrawnRecording::several(seed))));
}

type Found = (Channel, Effect);

const CURVE: CurveEvidence = CurveEvidence { excess: 0.1, tau_s: 1.0, sigmas: 9.0, gain_sigmas: 9.0 };

fn within_a_tenth(value: f64) -> BoundedEstimate {
    BoundedEstimate::new(value, 0.9 * value, 1.1 * value)
}

fn markov() -> Effect {
    let deviation = within_a_tenth(0.1).in_unit("deg/s");
    MarkovProcess { deviation, time_constant_s: within_a_tenth(1.0), evidence: MarkovEvidence::Curve(CURVE) }.into()
}

fn output_filter() -> Effect {
    OutputFilter {
        taps: within_a_tenth(4.0),
        decimation: BoundedEstimate::exact(1.0),
        white_noise: within_a_tenth(0.05).in_unit("deg/s"),
        stages: 2,
        internal_rate_hz: 819.2,
        evidence: CURVE,
    }
    .into()
}

fn report(found: &[Found]) -> Report {
    let model = || ModelReport {
        terms: Vec::new(),
        adev: Vec::new(),
        fitted: ModelErrorReport::default(),
        unseen: ModelErrorReport::default(),
        unseen_excluding: None,
        events: None,
    };
    let effect = |(_, effect): &Found| ChannelEffect { effect: effect.clone(), finding: 0 };
    let channel = |channel: Channel| ChannelReport {
        name: channel.name().to_owned(),
        unit: channel.unit().to_owned(),
        samples: 0,
        missing: Default::default(),
        unseen_adev: Vec::new(),
        curve: Vec::new(),
        read_off: SlopeMethodReport { angle_random_walk: None, bias_instability: None, rate_random_walk: None },
        before: model(),
        assessment: Default::default(),
        effects: found.iter().filter(|(of, _)| *of == channel).map(effect).collect(),
        after: model(),
        first_half_curve: ModelErrorReport::default(),
        refitted: model(),
        nonstationarity: None,
        at_rest: Vec::new(),
        figure_data: Default::default(),
    };
    Report {
        schema: SCHEMA,
        quick: false,
        sample_rate_hz: 204.8,
        samples: 0,
        dropped: BTreeMap::new(),
        flagged: BTreeMap::new(),
        part: PartReport::default(),
        findings: Vec::new(),
        common_mode: None,
        longest_at_rest: None,
        channels: Channel::ALL.into_iter().map(channel).collect(),
    }
}

#[test]
fn an_effect_is_named_in_its_channel_and_a_false_alarm_in_another() {
    let mut case = DrawnRecording::draw(&[EffectKind::Sinusoid], 60.0, 1);
    case.simulation.scenario.environment.motion.deviation_g = 0.0;
    let (channel, frequency_hz, amplitude) = (OutputRegister::GyroY, 20.0, 0.5);
    case.simulation.scenario.effects =
        vec![InjectedEffect::Sinusoid { channel, frequency_hz, amplitude, phase_rad: 0.0 }];

    let line = || {
        Effect::from(SinusoidalLine {
            frequency_hz: within_a_tenth(20.1),
            amplitude: within_a_tenth(0.4).in_unit("deg/s"),
            multiples: None,
            evidence: LineEvidence { has_width: false, source: LineSource::Curve(CURVE) },
        })
    };
    let right = compare(&case, &report(&[(Channel::GyroY, line())]), 0.0);
    assert!(right.answers[0].named);
    assert_eq!(right.false_alarms, [""; 0]);
    let errors: Vec<f64> = right.estimates.iter().map(|estimate| estimate.relative_error).collect();
    assert!((errors[0] - 0.005).abs() < 1e-9 && (errors[1] - 0.2).abs() < 1e-9, "{errors:?}");

    let elsewhere = compare(&case, &report(&[(Channel::GyroX, line())]), 0.0);
    assert!(!elsewhere.answers[0].named);
    assert_eq!(elsewhere.false_alarms, ["gyro_x: sinusoid"]);

    let otherwise = compare(&case, &report(&[(Channel::GyroY, markov()), (Channel::Temp, markov())]), 0.0);
    assert_eq!(otherwise.answers[0].instead.as_deref(), Some("markov"));
    assert_eq!(otherwise.false_alarms, ["gyro_y: markov"]);

    case.simulation.scenario.environment.motion.deviation_g = 0.1;
    assert_eq!(compare(&case, &report(&[(Channel::AcclX, markov())]), 0.0).false_alarms, [""; 0]);
}

#[test]
fn an_effect_outside_the_vocabulary_is_reported_by_its_own_name_or_as_unexplained() {
    let quiet = |kind: OutsideKind| {
        let mut case = DrawnRecording::from_group(RecordingGroup::Outside(kind), 100.0, 2);
        case.simulation.scenario.environment.motion.deviation_g = 0.0;
        case
    };
    let told = |case: &DrawnRecording, channel: Channel, effect: Effect| {
        let score = compare(case, &report(&[(channel, effect)]), 0.0);
        let outside = score.outside.expect("an effect is hidden");
        (outside.unexplained, outside.named, score.false_alarms.is_empty())
    };
    let unexplained = || {
        let place = UnexplainedPlace::AveragingTime(within_a_tenth(1.0));
        let observation = Observation::PointOfCurve { p_value: 1e-9 };
        Effect::from(Unexplained { place, excess_percent: None, observation })
    };
    let resonance = || {
        let evidence = LineEvidence { has_width: true, source: LineSource::Curve(CURVE) };
        let (frequency_hz, deviation) = (within_a_tenth(20.0), within_a_tenth(0.1).in_unit("deg/s"));
        let bandwidth_hz = within_a_tenth(1.0);
        Effect::from(ResonantLine { frequency_hz, bandwidth_hz, deviation, multiples: None, evidence })
    };
    let band = quiet(OutsideKind::WanderingBand);
    let own = simulation::channel(band.simulation.outside[0].channels().next().expect("a channel"));
    let other = if own == Channel::GyroX { Channel::GyroY } else { Channel::GyroX };
    assert_eq!(told(&band, own, unexplained()), (true, false, true));
    assert_eq!(told(&band, own, resonance()), (false, true, true));
    assert_eq!(told(&band, own, markov()), (false, false, false));
    assert_eq!(told(&band, other, resonance()), (false, false, false));
    // A clock deviation is in all channels.
    let clock = ClockDeviation { rate_hz: within_a_tenth(200.0), nominal_hz: 204.8, sigmas: 9.0, change: None };
    assert_eq!(told(&quiet(OutsideKind::ClockStep), Channel::AcclZ, clock.into()), (false, true, true));
    let dropped = DroppedSamples { fraction: within_a_tenth(1e-3), missing: 10.0, samples: 1e4, gaps: 10 };
    assert_eq!(told(&quiet(OutsideKind::ClockStep), Channel::AcclZ, dropped.into()), (false, false, false));
    let knock = NoisyInterval {
        from_s: within_a_tenth(10.0),
        to_s: within_a_tenth(12.0),
        level: within_a_tenth(3.0),
        tau_s: 0.1,
        p_value: 1e-9,
        channels: vec!["accl_z"],
    };
    assert_eq!(told(&quiet(OutsideKind::Knock), Channel::AcclZ, knock.into()), (false, true, true));
}

/// The smallest strength is 2. The change is in counts, in time stamps or in both.
#[test]
fn every_effect_outside_the_vocabulary_changes_the_recording() {
    for &kind in OutsideKind::value_variants() {
        let case = DrawnRecording::from_group(RecordingGroup::Outside(kind), 100.0, 3);
        assert!(case.strengths[0] >= 2.0, "{kind:?}: {}", case.strengths[0]);
        let without = TrueRecording { outside: Vec::new(), ..case.simulation.clone() };
        assert_ne!(case.simulation.record(), without.record(), "{kind:?}");
    }
}

/// An accelerometer has noise of a count: 2 taps leave 0.6 of it, 64 taps a tenth.
#[test]
fn an_effect_of_all_channels_is_named_if_half_of_those_that_show_it_list_it() {
    let mut case = DrawnRecording::draw(&[EffectKind::FilterBandwidth], 60.0, 1);
    case.simulation.noise = NoiseModel::paper();
    case.simulation.scenario.environment.motion.deviation_g = 0.0;
    let mut listed = |taps_log2: u8, count: usize| {
        case.simulation.scenario.effects = vec![InjectedEffect::FilterBandwidth { taps_log2 }];
        let found: Vec<_> = Channel::INERTIAL[..count].iter().map(|&channel| (channel, output_filter())).collect();
        compare(&case, &report(&found), 0.0).answers[0].named
    };
    assert_eq!([2, 3, 6].map(|count| listed(1, count)), [false, true, true]);
    assert_eq!([1, 2].map(|count| listed(6, count)), [false, true]);
}

/// The mean deviance over eight seeds is 1 with a standard deviation of 0.2. A fit adds one point per parameter: less
/// than 1 for five.
#[test]
fn the_true_model_has_a_deviance_of_one_and_the_fitted_true_terms_below_two() {
    let channel = |case: &DrawnRecording| simulation::channel(case.simulation.scenario.effects[0].channels()[0]);
    let errors: Vec<_> = (0..8)
        .map(|seed| DrawnRecording::draw(&[EffectKind::Sinusoid], 60.0, seed))
        .map(|case| true_model_errors(&case, channel(&case)).unwrap())
        .collect();
    let mean = |of: fn(&TrueModelErrors) -> f64| errors.iter().map(of).sum::<f64>() / errors.len() as f64;
    let (model, fitted) = (mean(|error| error.model), mean(|error| error.fitted));
    assert!((model - 1.0).abs() < 0.6, "{errors:?}");
    assert!(fitted > model && fitted < 2.0 * model, "{errors:?}");
}

#[test]
fn a_small_run_does_not_depend_on_the_number_of_jobs() {
    let plan = |jobs| UndeclaredPlan {
        kinds: vec![EffectKind::DroppedSamples, EffectKind::Spikes],
        per_kind: 1,
        nothing: 1,
        pairs: 1,
        triples: 0,
        outside: 0,
        seconds: 20.0,
        loss_percent: 0.0,
        seed: 3,
        sealed: false,
        jobs,
    };
    let table = plan(2).run(|_, _| ()).unwrap();
    assert_eq!(table, plan(1).run(|_, _| ()).unwrap());
    assert_eq!(table.outcomes.len(), 4);
}
