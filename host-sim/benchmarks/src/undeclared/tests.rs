//! The generator against itself and against theory; how well the analysis does is the benchmark's question.

use super::examine::score;
use super::limit::chain::telegraph_from_markov;
use super::limit::spectrum::{self, Record};
use super::limit::{events, needed, size, smallest, waveform};
use super::place::{Place, Scene};
use super::shape;
use super::{Case, Group, Kind, Plan, case, truth};
use adis16405_driver::Channel;
use allan_core::NoiseTerm as Term;
use allan_core::term::{Markov, MovingAverageFilter, Resonance};
use noise_analysis::report::{
    ChannelReport, Effect as Reported, ModelError, ModelReport, Parameter, ReadOff, Report, SCHEMA,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use virtual_sensor::{ChannelNoise, Environment, InjectedEffect, NoiseModel, OutputRegister};

const PERIOD_S: f64 = 1.0 / 204.8;
const RECORD: Record = Record { seconds: 1800.0, period_s: PERIOD_S };

fn gyro() -> ChannelNoise {
    *NoiseModel::paper().channel(OutputRegister::GyroX)
}

/// The densities of the generator and of the terms of the fit were written down apart from each other.
#[test]
fn densities_are_those_of_the_terms() {
    let one = |n: f64, b: f64, k: f64| ChannelNoise {
        angle_random_walk: n,
        bias_instability: b,
        rate_random_walk: k,
        ..ChannelNoise::default()
    };
    for frequency in [0.01, 0.3, 5.0, 40.0, 99.0] {
        let declared = |n, b, k| spectrum::declared(&one(n, b, k), PERIOD_S, frequency);
        let pairs = [
            (declared(1.0, 0.0, 0.0), Term::AngleRandomWalk),
            (declared(0.0, 0.0, 1.0), Term::RateRandomWalk),
            (spectrum::quantization(PERIOD_S, frequency), Term::Quantization),
            (spectrum::markov(0.7, PERIOD_S, frequency), Term::Markov(Markov { time_constant: 0.7 })),
            (
                spectrum::resonance(20.0, 2.0, PERIOD_S, frequency),
                Term::Resonance(Resonance { frequency: 20.0, bandwidth: 2.0 }),
            ),
            (spectrum::filter(3, PERIOD_S, frequency), Term::Filtered(MovingAverageFilter::bartlett(8))),
        ];
        for (ours, term) in pairs {
            let theirs = term.process().density(frequency, PERIOD_S);
            assert!((ours / theirs - 1.0).abs() < 1e-6, "{term:?} at {frequency} Hz: {ours:e}, {theirs:e}");
        }
    }
    // Flicker aliases differently in each; far below the sample rate both are B²/(2πf).
    let flicker = spectrum::declared(&one(0.0, 1.0, 0.0), PERIOD_S, 0.01);
    assert!((flicker / Term::BiasInstability.process().density(0.01, PERIOD_S) - 1.0).abs() < 0.01);
}

#[test]
fn what_noise_can_explain_is_no_effect() {
    let noise = gyro();
    let declared = |frequency: f64| spectrum::declared(&noise, PERIOD_S, frequency);
    let stronger = |frequency: f64| 2.0 * declared(frequency);
    let (unfiltered, nothing) = (|_: f64| 1.0, |_: f64| 0.0);
    assert!(RECORD.against_declared(&noise, (unfiltered, nothing), None, stronger) < 1e-3);
    // Nor is what is known: here noise behind a filter, with something on top.
    let filter = |frequency: f64| spectrum::filter(3, PERIOD_S, frequency);
    let known = |frequency: f64| 0.01 * spectrum::markov(1.0, PERIOD_S, frequency);
    let truth = |frequency: f64| 2.0 * declared(frequency) * filter(frequency) + known(frequency);
    assert!(RECORD.against_declared(&noise, (filter, known), None, truth) < 1e-3);
    // A Markov process that forgets within a sample is white; one of a second is not.
    let markov = |time_s: f64| {
        let truth = |frequency: f64| declared(frequency) + 0.01 * spectrum::markov(time_s, PERIOD_S, frequency);
        RECORD.against_declared(&noise, (unfiltered, nothing), None, truth)
    };
    assert!(markov(1e-4) < 1e-3, "{}", markov(1e-4));
    assert!(markov(1.0) > 10.0, "{}", markov(1.0));
}

/// White noise alone, where every limit can be written down.
#[test]
fn limits_in_white_noise_are_those_of_the_textbook() {
    // The normal law's 1 % point.
    assert!((needed(1.0) - 0.5 * 2.326_348f64.powi(2)).abs() < 1e-4);
    assert!((size(8.0, |size| 0.5 * size * size) - 4.0).abs() < 1e-6);

    let white = ChannelNoise { angle_random_walk: 0.5, ..ChannelNoise::default() };
    // A step in the middle of M samples of deviation σ: half of s²·M/4/σ².
    let step: Vec<f64> = (0..128).map(|block| if block < 64 { 0.0 } else { 1.0 }).collect();
    let expected = 0.5 * 1800.0 / 4.0 / 0.25;
    let mut model = NoiseModel::paper();
    *model.channel_mut(OutputRegister::GyroX) = white;
    let scene = Scene { noise: &model, surroundings: Environment::default(), record: RECORD, seed: 1 };
    // Rounding adds a thousandth of the noise.
    let rounding = 0.05f64.powi(2) / 12.0 * PERIOD_S / 0.25;
    let place = Place::of(&scene, OutputRegister::GyroX, &[]);
    assert!((waveform::ratio(&step, &place) / expected - 1.0).abs() < 1e-3 + rounding);
    // A sinusoid of M samples: half of A²·M/2/σ².
    let density = spectrum::declared(&white, PERIOD_S, 10.0);
    assert!((RECORD.line(density) / (0.5 * 0.5 * 1800.0 / 0.25) - 1.0).abs() < 1e-9);
    // A white waveform of deviation 0.1 matched in white noise.
    let matched = RECORD.matched(|_| 0.01 * PERIOD_S, |_| density);
    assert!((matched / (0.5 * 0.01 * 1800.0 / PERIOD_S / (0.25 / PERIOD_S)) - 1.0).abs() < 0.01, "{matched}");
}

/// What the other effect of a pair does to a limit, where that can be written down.
#[test]
fn a_limit_knows_the_other_effect() {
    let mut noise = NoiseModel::paper();
    *noise.channel_mut(OutputRegister::GyroX) = ChannelNoise { angle_random_walk: 0.5, ..ChannelNoise::default() };
    let scene = Scene { noise: &noise, surroundings: Environment::default(), record: RECORD, seed: 1 };
    let channel = OutputRegister::GyroX;
    let near = |ratio: f64, expected: f64| assert!((ratio / expected - 1.0).abs() < 0.01, "{ratio}, {expected}");
    let larger = |shape: &InjectedEffect, other: InjectedEffect| {
        smallest(shape, &scene, &[other]) / smallest(shape, &scene, &[])
    };

    // A line in the middle of a resonance stands in both densities.
    let line = InjectedEffect::Sinusoid { channel, frequency_hz: 20.0, amplitude: 1.0, phase_rad: 0.0 };
    let resonance = InjectedEffect::Resonance { channel, frequency_hz: 20.0, bandwidth_hz: 1.0, deviation: 2.0 };
    near(larger(&line, resonance), ((0.25 + 0.5 * 4.0 * 2.0 / (PI * 1.0)) / 0.25f64).sqrt());
    // A filter takes as much off the noise as off the line: only rounding, 1 % of the noise here and there, is left.
    let rounding = |gain: f64| (0.25 + 0.05f64.powi(2) / 12.0 * PERIOD_S / gain) / 0.25;
    let gain = spectrum::filter(2, PERIOD_S, 20.0);
    near(larger(&line, InjectedEffect::FilterBandwidth { taps_log2: 2 }), (rounding(gain) / rounding(1.0)).sqrt());
    // For a ramp, a process that forgets within a block is white noise of the density 2·σ²·T.
    let ramp = InjectedEffect::RateRamp { channel, slope: 1.0 };
    let markov = InjectedEffect::Markov { channel, time_constant_s: 0.5, deviation: 1.0 };
    near(larger(&ramp, markov), ((0.25 + 2.0 * 0.5) / 0.25f64).sqrt());
    // Spikes are more white noise, and a known waveform is nothing.
    let spikes = InjectedEffect::Spikes { channel, rate_per_hour: 3600.0, size: 10.0 };
    near(larger(&ramp, spikes.clone()), ((0.25 + 100.0 * PERIOD_S * PERIOD_S) / 0.25f64).sqrt());
    near(larger(&spikes, ramp), 1.0);
    // What shows elsewhere is nothing either.
    near(
        larger(&line, InjectedEffect::Markov { channel: OutputRegister::GyroY, time_constant_s: 1.0, deviation: 9.0 }),
        1.0,
    );
}

#[test]
fn sizes_scale() {
    let scene = Scene { noise: &NoiseModel::paper(), surroundings: Environment::default(), record: RECORD, seed: 1 };
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for kind in Kind::ALL {
        let unit = shape::draw(kind, OutputRegister::GyroY, &scene, &mut random);
        assert!((shape::size(&unit) - 1.0).abs() < 1e-12, "{unit:?}");
        let expected = if kind == Kind::FilterBandwidth { 1.0 } else { 0.25 };
        assert!((shape::size(&shape::scaled(unit, 0.25)) - expected).abs() < 1e-12, "{kind:?}");
    }
}

#[test]
fn effects_of_a_pair_are_strong_beside_each_other() {
    for seed in 0..40 {
        let pair = case(Group::Pair, 450.0, seed);
        assert!(pair.strengths.iter().all(|strength| *strength >= 2.0), "{seed}: {:?}", pair.strengths);
    }
}

#[test]
fn rare_gross_spikes_count_one_by_one() {
    // Each is worth s²/2 less what it costs that it could be any sample and either sign.
    let (samples, probability, size) = (1e6, 1e-5f64, 12.0f64);
    let each = 0.5 * size * size + (0.5 * probability).ln();
    let expected = samples * probability * each - samples * probability;
    let ratio = events::spikes(samples, probability, size);
    assert!((ratio / expected - 1.0).abs() < 0.01, "{ratio}, {expected}");
    assert!(events::spikes(samples, probability, 0.1) < 1e-6);
    assert_eq!(events::count(0.0), std::f64::consts::LN_2);
}

#[test]
fn a_telegraph_signal_below_the_noise_cannot_be_told_from_a_markov_process() {
    // White noise over a correlation time of 1 s has a deviation of 1.
    let ratio = |amplitude: f64| telegraph_from_markov(amplitude, 1.0, 1.0, PERIOD_S, 1800.0, 1);
    // Differences of the fourth order vanish with the eighth power of the amplitude; the path is a sample of 1000 s.
    assert!(ratio(0.3).abs() < 1.0, "{}", ratio(0.3));
    assert!(ratio(3.0) > 10.0, "{}", ratio(3.0));
    assert!(ratio(30.0) > ratio(10.0) && ratio(10.0) > ratio(3.0));
}

#[test]
fn a_seed_says_everything_and_sealed_seeds_are_others() {
    for kind in Kind::ALL {
        let drawn = case(Group::Single(kind), 1800.0, 7);
        assert_eq!(drawn, Case::draw(&[kind], 1800.0, 7));
        assert_eq!(drawn.simulation.scenario.effects[0].name(), kind.name());
        assert!(drawn.strengths[0] > 0.0, "{kind:?}");
        assert_ne!(drawn, case(Group::Single(kind), 1800.0, 8));
    }
    let plan = |sealed| Plan {
        kinds: Kind::ALL.to_vec(),
        per_kind: 40,
        empty: 200,
        pairs: 200,
        seconds: 1800.0,
        seed: 0,
        sealed,
        jobs: 1,
    };
    let mut seeds: Vec<u64> =
        plan(false).recordings().into_iter().chain(plan(true).recordings()).map(|(_, seed)| seed).collect();
    assert_eq!(seeds.len(), 2 * (200 + 16 * 40 + 200));
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), 2 * (200 + 16 * 40 + 200), "no seed is used twice");
    assert!((0..100).all(|seed| Case::pair(seed)[0] != Case::pair(seed)[1]));
}

/// A channel, a kind and its parameters.
type Found<'a> = (Channel, &'a str, &'a [(&'a str, f64)]);

fn report(found: &[Found<'_>]) -> Report {
    let model = || ModelReport {
        terms: Vec::new(),
        adev: Vec::new(),
        fitted: ModelError { deviance_per_point: None, rms_percent: None },
        unseen: ModelError { deviance_per_point: None, rms_percent: None },
    };
    let effect = |&(_, kind, parameters): &Found<'_>| Reported {
        kind: kind.to_owned(),
        parameters: parameters
            .iter()
            .map(|&(name, value)| {
                let unit = String::new();
                (name.to_owned(), Parameter { value, low: 0.9 * value, high: 1.1 * value, unit })
            })
            .collect::<BTreeMap<_, _>>(),
        evidence: String::new(),
    };
    let channel = |channel: Channel| ChannelReport {
        name: channel.name().to_owned(),
        unit: channel.unit().to_owned(),
        samples: 0,
        curve: Vec::new(),
        read_off: ReadOff { angle_random_walk: None, bias_instability: None, rate_random_walk: None },
        before: model(),
        practice: Default::default(),
        effects: found.iter().filter(|(of, ..)| *of == channel).map(effect).collect(),
        after: model(),
    };
    Report {
        schema: SCHEMA,
        sample_rate_hz: 204.8,
        samples: 0,
        dropped: BTreeMap::new(),
        flagged: BTreeMap::new(),
        channels: Channel::ALL.into_iter().map(channel).collect(),
    }
}

#[test]
fn an_answer_counts_where_the_effect_is_and_a_false_alarm_everywhere() {
    let mut case = Case::draw(&[Kind::Sinusoid], 60.0, 1);
    case.simulation.scenario.environment.motion.deviation_g = 0.0;
    let (channel, frequency_hz, amplitude) = (OutputRegister::GyroY, 20.0, 0.5);
    case.simulation.scenario.effects =
        vec![InjectedEffect::Sinusoid { channel, frequency_hz, amplitude, phase_rad: 0.0 }];

    let parameters: &[_] = &[("frequency", 20.1), ("amplitude", 0.4)];
    let right = score(&case, &report(&[(Channel::GyroY, "sinusoid", parameters)]), 0.0);
    assert!(right.answers[0].named);
    assert_eq!(right.false_alarms, [""; 0]);
    let errors: Vec<f64> = right.estimates.iter().map(|estimate| estimate.relative_error).collect();
    assert!((errors[0] - 0.005).abs() < 1e-9 && (errors[1] - 0.2).abs() < 1e-9, "{errors:?}");

    let elsewhere = score(&case, &report(&[(Channel::GyroX, "sinusoid", parameters)]), 0.0);
    assert!(!elsewhere.answers[0].named);
    assert_eq!(elsewhere.false_alarms, ["gyro_x: sinusoid"]);

    let otherwise = score(&case, &report(&[(Channel::GyroY, "markov", &[]), (Channel::Temp, "markov", &[])]), 0.0);
    assert_eq!(otherwise.answers[0].instead.as_deref(), Some("markov"));
    assert_eq!(otherwise.false_alarms, ["gyro_y: markov"]);

    // What a moved accelerometer shows is the motion.
    case.simulation.scenario.environment.motion.deviation_g = 0.1;
    assert_eq!(score(&case, &report(&[(Channel::AcclX, "markov", &[])]), 0.0).false_alarms, [""; 0]);
}

#[test]
fn a_common_effect_needs_half_of_its_channels() {
    let mut case = Case::draw(&[Kind::FilterBandwidth], 60.0, 1);
    case.simulation.scenario.environment.motion.deviation_g = 0.0;
    let listed = |count: usize| {
        let found: Vec<_> =
            Channel::INERTIAL[..count].iter().map(|&channel| (channel, "filter_bandwidth", &[][..])).collect();
        score(&case, &report(&found), 0.0).answers[0].named
    };
    assert_eq!([listed(2), listed(3), listed(6)], [false, true, true]);
}

/// The true model scores 1 on any data, give or take 0.5 by some ten octaves that hang together: 0.2 for the mean of
/// eight. What is fitted to as much data as it is judged on errs by as much again for each of its parameters: of five
/// beside ten octaves, less than twice the true model's error on average.
#[test]
fn the_truth_scores_one_and_its_terms_fitted_little_more() {
    let channel = |case: &Case| simulation::channel(case.simulation.scenario.effects[0].channels()[0]);
    let errors: Vec<_> = (0..8)
        .map(|seed| Case::draw(&[Kind::Sinusoid], 60.0, seed))
        .map(|case| truth::unseen_error(&case, channel(&case)).unwrap().unwrap())
        .collect();
    let mean = |of: fn(&truth::UnseenError) -> f64| errors.iter().map(of).sum::<f64>() / errors.len() as f64;
    let (model, fitted) = (mean(|error| error.model), mean(|error| error.fitted));
    assert!((model - 1.0).abs() < 0.6, "{errors:?}");
    assert!(fitted > model && fitted < 2.0 * model, "{errors:?}");
}

#[test]
fn a_small_run_goes_through_and_does_not_depend_on_the_number_of_jobs() {
    let plan = |jobs| Plan {
        kinds: vec![Kind::DroppedSamples, Kind::Spikes],
        per_kind: 1,
        empty: 1,
        pairs: 1,
        seconds: 40.0,
        seed: 3,
        sealed: false,
        jobs,
    };
    let table = plan(2).run(|_, _| ()).unwrap();
    assert_eq!(table, plan(1).run(|_, _| ()).unwrap());
    assert_eq!(table.outcomes.len(), 4);
    let mut text = Vec::new();
    table.write(&mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    for title in ["Named, by strength", "Confusion", "Parameters", "unseen data", "both effects of a pair"] {
        assert!(text.contains(title), "{title}\n{text}");
    }
}
