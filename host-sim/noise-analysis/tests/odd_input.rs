//! Recordings that a careless or unlucky user makes: what the analysis says of them is right, or it says nothing.
//!
//! White noise of 20 counts on a gyro at 100 Hz has N = 20·0.05 °/s·√0.01 s = 0.1 °/√s.

use measurement::adis16405::profile;
use measurement::{MeasuredChannel, Measurement};
use noise_analysis::analysis::analyze;
use noise_analysis::effects::Effect;
use noise_analysis::report::{ChannelEffect, ChannelReport, ModelReport, Parameter, Report};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// N of 20 counts, °/√s.
const N: f64 = 0.1;
const RATE_HZ: f64 = 100.0;

/// Counts of one channel at the sample periods `slots`.
fn recording(name: &str, rate_hz: f64, slots: Vec<u64>, counts: Vec<i32>) -> Measurement {
    let profile = profile(0.05);
    let channel = profile.channel(name).expect("a channel of the part");
    let missing = slots.last().map_or(0, |last| last + 1) - slots.len() as u64;
    Measurement {
        profile,
        sample_rate_hz: rate_hz,
        stated_rate_hz: Some(rate_hz),
        slots,
        times_s: None,
        channels: vec![MeasuredChannel::new(channel, counts)],
        dropped: if missing > 0 { BTreeMap::from([("gap", missing)]) } else { BTreeMap::new() },
        flagged: BTreeMap::new(),
    }
}

/// Without a gap, of a gyro at 100 Hz.
fn gyro(counts: Vec<i32>) -> Measurement {
    recording("gyro_x", RATE_HZ, (0..counts.len() as u64).collect(), counts)
}

/// Normal numbers of standard deviation 1.
fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    move || random.sample(StandardNormal)
}

/// White noise of so many counts.
fn white(seed: u64, samples: usize, counts: f64) -> Vec<i32> {
    let mut normal = normal(seed);
    (0..samples).map(|_| (counts * normal()).round() as i32).collect()
}

fn only(report: &Report) -> &ChannelReport {
    let [channel] = &report.channels[..] else { panic!("one channel was recorded") };
    channel
}

fn kinds(report: &Report) -> Vec<&str> {
    only(report).effects.iter().map(|shown| shown.effect.name()).collect()
}

fn coefficient(model: &ModelReport, kind: &str) -> Parameter {
    model.terms.iter().find(|term| term.kind() == kind).expect("a term of the baseline").coefficient()
}

/// Every interval of a report holds its value, and none that was estimated is without width.
fn assert_bounds_hold(report: &Report, what: &str) {
    let channel = only(report);
    let models = [&channel.before, &channel.after, &channel.refitted];
    let terms = models.into_iter().flat_map(|model| &model.terms);
    let of_terms = terms.flat_map(|term| term.parameters().into_iter().map(move |(name, of)| (term.kind(), name, of)));
    let of_effects = channel.effects.iter().flat_map(|shown| {
        let parameters = shown.effect.parameters().into_iter();
        parameters.map(|(name, of)| (shown.effect.name(), name, of))
    });
    for (kind, name, Parameter { value, low, high, .. }) in of_terms.chain(of_effects) {
        assert!(low <= value && value <= high, "{what}: {kind} {name}: {value} is not in [{low}, {high}]");
    }
}

/// Two minutes on, ten minutes off, and one gap as long as the record.
#[test]
fn long_gaps_are_no_lines() {
    for seed in 0..20 {
        let counts = white(seed, 60_000, 20.0);
        let on_and_off = (0..60_000).map(|i: u64| i + 60_000 * (i / 12_000)).collect();
        let halves = (0..60_000).map(|i: u64| if i < 30_000 { i } else { i + 60_000 }).collect();
        for (what, slots) in [("two minutes of twelve", on_and_off), ("a gap as long as the record", halves)] {
            let report = analyze(&recording("gyro_x", RATE_HZ, slots, counts.clone()));
            assert_eq!(kinds(&report), ["dropped_samples"], "{what}, seed {seed}");
            // 60,000 samples know N to 0.3 %.
            let of = coefficient(&only(&report).refitted, "angle_random_walk");
            assert!((of.value / N - 1.0).abs() < 0.02, "{what}, seed {seed}: {of:?}");
        }
    }
}

/// An offset is in no difference, in a record of which all samples are kept or only means. 100,000 samples know N to 0.3 %.
#[test]
fn an_offset_of_many_counts_changes_no_coefficient() {
    for samples in [100_000, 300_000] {
        for offset in [0, 150_000_000, 1_000_000_000] {
            let counts = white(1, samples, 20.0).into_iter().map(|count| offset + count).collect();
            let report = analyze(&gyro(counts));
            let what = format!("{samples} samples around {offset}");
            assert!(kinds(&report).is_empty(), "{what}: {:?}", only(&report).effects);
            let channel = only(&report);
            for model in [&channel.before, &channel.after, &channel.refitted] {
                let of = coefficient(model, "angle_random_walk");
                assert!((of.value / N - 1.0).abs() < 0.02, "{what}: {of:?}");
            }
        }
    }
}

/// So many that neighbouring gaps are closed with the same samples. Of 15 intervals of 95 %, 14 hold; fewer than 12 in one of 200 cases.
/// The lower bound of B is above 0 in one of 40.
#[test]
fn samples_lost_at_random_are_neither_a_filter_nor_flicker_noise() {
    let (mut held, mut with_flicker) = (0, 0);
    for lost in [0.3, 0.4, 0.5, 0.7, 0.85] {
        for seed in 0..3 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let slots: Vec<u64> = (0..60_000).filter(|slot| *slot == 0 || !random.random_bool(lost)).collect();
            let counts = white(100 + seed, slots.len(), 20.0);
            let report = analyze(&recording("gyro_x", RATE_HZ, slots, counts));
            let what = format!("{lost} lost, seed {seed}");
            assert_eq!(kinds(&report), ["dropped_samples"], "{what}: {:?}", only(&report).effects);
            let [n, b] =
                ["angle_random_walk", "bias_instability"].map(|kind| coefficient(&only(&report).refitted, kind));
            held += usize::from((n.low..=n.high).contains(&N));
            with_flicker += usize::from(b.low > 0.0);
        }
    }
    assert!(held >= 12, "{held} of 15 intervals of N hold it");
    assert!(with_flicker <= 2, "flicker noise in {with_flicker} of 15");
}

/// A quarter and a half of the samples, in a record of which all samples are kept or only means. 150,000 other samples know N to 0.3 %.
#[test]
fn an_output_that_stays_at_its_value_is_told_and_left_out() {
    for samples in [40_000, 300_000] {
        for part in [4, 2] {
            let mut counts = white(5, samples, 20.0);
            let (from, to) = (samples / 4, samples / 4 + samples / part);
            let value = counts[from];
            counts[from..to].fill(value);
            let report = analyze(&gyro(counts));
            let what = format!("one of {part} of {samples} samples");
            let [ChannelEffect { effect: Effect::StuckOutput(stuck), .. }] = &only(&report).effects[..] else {
                panic!("{what}: {:?}", only(&report).effects)
            };
            // A few before and behind may have the same count by chance.
            assert!((stuck.fraction.value * part as f64 - 1.0).abs() < 1e-3, "{what}: {stuck:?}");
            assert!((stuck.from_s.value - from as f64 / RATE_HZ).abs() < 0.1, "{what}: {stuck:?}");
            let of = |kind: &str| coefficient(&only(&report).refitted, kind);
            assert!((of("angle_random_walk").value / N - 1.0).abs() < 0.02, "{what}: {:?}", of("angle_random_walk"));
            assert_eq!((of("bias_instability").low, of("rate_random_walk").low), (0.0, 0.0), "{what}");
        }
    }
}

/// At half time, in a record of which all samples are kept or only means: told, and nothing else is.
#[test]
fn a_change_of_the_noise_level_is_told() {
    for samples in [40_000, 400_000] {
        for ratio in [1.5, 2.0, 3.0, 4.0, 0.25] {
            let counts = white(8, samples, 20.0);
            let change = |(at, count): (usize, &i32)| {
                if at < samples / 2 { *count } else { (ratio * f64::from(*count)).round() as i32 }
            };
            let report = analyze(&gyro(counts.iter().enumerate().map(change).collect()));
            let what = format!("{ratio} in {samples} samples");
            let [ChannelEffect { effect: Effect::LevelChange(change), .. }] = &only(&report).effects[..] else {
                panic!("{what}: {:?}", only(&report).effects)
            };
            // 20,000 samples know a deviation to 0.6 %, without the largest tenth of their differences, which are correlated, to 1.2 %.
            assert!((change.ratio.value / ratio - 1.0).abs() < 0.06, "{what}: {change:?}");
            let half_s = samples as f64 / 2.0 / RATE_HZ;
            assert!((change.time_s.value / half_s - 1.0).abs() < 0.01, "{what}: {change:?}");
        }
    }
}

/// By ±30 % within 20 s, in a record of which all samples are kept or only means: told, and nothing else is.
#[test]
fn a_noise_level_that_grows_and_falls_is_told() {
    for samples in [40_000, 400_000] {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let (kept, mut level) = ((-1.0 / (20.0 * RATE_HZ)).exp(), 0.0);
        let louder = |count: &i32| {
            level = kept * level + (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
            (f64::exp(0.3 * level) * f64::from(*count)).round() as i32
        };
        let report = analyze(&gyro(white(8, samples, 20.0).iter().map(louder).collect()));
        let [ChannelEffect { effect: Effect::WanderingLevel(level), .. }] = &only(&report).effects[..] else {
            panic!("{samples} samples: {:?}", only(&report).effects)
        };
        for (of, truth) in [(level.deviation, 0.3), (level.time_constant_s, 20.0)] {
            assert!((of.low..=of.high).contains(&truth), "{samples} samples: {level:?}");
        }
    }
}

/// Behind a filter over 64 samples neighbours are equal for long, and so are those of half a count.
#[test]
fn equal_neighbours_of_filtered_or_small_noise_are_not_stuck() {
    for seed in 0..4 {
        let noise = white(seed, 60_064, 20_000.0);
        for (what, deviation) in [("filtered", 2.0), ("filtered", 10.0)] {
            let average =
                |at: usize| noise[at..at + 64].iter().map(|of| f64::from(*of)).sum::<f64>() / (8.0 * 20_000.0);
            let counts = (0..60_000).map(|at| (deviation * average(at)).round() as i32).collect();
            assert!(!kinds(&analyze(&gyro(counts))).contains(&"stuck"), "{what}, {deviation} counts, seed {seed}");
        }
        let report = analyze(&gyro(white(seed, 60_000, 0.5)));
        assert!(!kinds(&report).contains(&"stuck"), "half a count, seed {seed}");
        // A quarter of a count behind a filter, around a bias that wanders by a count in 150 s: for seconds at one count where that is whole.
        let wandering = |at: usize| {
            let filtered = noise[at..at + 64].iter().map(|of| f64::from(*of)).sum::<f64>() / (8.0 * 20_000.0);
            (0.25 * filtered + 0.5 * (at as f64 / 5_000.0).sin()).round() as i32
        };
        let report = analyze(&gyro((0..60_000).map(wandering).collect()));
        assert!(!kinds(&report).contains(&"stuck"), "a quarter of a count, seed {seed}");
    }
}

/// The differences of an angle in steps of its own, behind two averages over 64 samples: neighbours are less often equal than samples
/// further away, because the error of rounding an angle makes one difference larger and the next one smaller.
#[test]
fn differences_of_a_rounded_angle_are_not_stuck() {
    let averaged = |of: &[f64]| -> Vec<f64> { of.windows(64).map(|of| of.iter().sum::<f64>() / 64.0).collect() };
    for seed in 0..4 {
        let rates: Vec<f64> = white(seed, 60_126, 20_000.0).into_iter().map(|of| f64::from(of) / 1_200.0).collect();
        let mut angle = 0.0;
        let angles: Vec<f64> = averaged(&averaged(&rates))
            .into_iter()
            .map(|rate| {
                angle += rate;
                angle
            })
            .collect();
        let counts = angles.windows(2).map(|of| (of[1].round() - of[0].round()) as i32).collect();
        assert!(!kinds(&analyze(&gyro(counts))).contains(&"stuck"), "seed {seed}");
    }
}

/// Fewer octaves than terms determine no term.
#[test]
fn a_few_samples_have_no_effect_and_no_narrow_bounds() {
    for seed in 0..20 {
        for samples in 4..=10 {
            let report = analyze(&gyro(white(seed, samples, 20.0)));
            let what = format!("{samples} samples, seed {seed}");
            assert_bounds_hold(&report, &what);
            assert!(kinds(&report).is_empty(), "{what}: {:?}", only(&report).effects);
            // A standard deviation from m samples has a relative error of 1/√(2(m − 1)), 24 % at m = 10: the interval of N
            // holds the truth, or N is not known at all.
            let of = coefficient(&only(&report).refitted, "angle_random_walk");
            assert!(of.high - of.low > 0.2 * of.value, "{what}: {of:?}");
            for kind in ["bias_instability", "rate_random_walk"] {
                let of = coefficient(&only(&report).refitted, kind);
                assert!(of.high > of.value && of.low == 0.0, "{what}: {kind} {of:?}");
            }
        }
    }
}

/// Stretches of two to five samples, ten sample periods apart.
#[test]
fn stretches_of_a_few_samples_have_no_effect_and_no_narrow_bounds() {
    for seed in 0..12 {
        for length in 2..=5 {
            let slots = (0..20_000).map(|i: u64| i / length * (length + 10) + i % length).collect();
            let report = analyze(&recording("gyro_x", RATE_HZ, slots, white(seed, 20_000, 20.0)));
            let what = format!("stretches of {length}, seed {seed}");
            assert_bounds_hold(&report, &what);
            assert_eq!(kinds(&report), ["dropped_samples"], "{what}");
            let of = coefficient(&only(&report).refitted, "angle_random_walk");
            assert!(of.low <= 1.02 * N && of.high >= 0.98 * N, "{what}: {of:?}");
            // So few samples give a walk no bounds, or bounds that include 0.
            let walk = only(&report).refitted.terms.iter().find(|term| term.kind() == "rate_random_walk");
            let is_wide = |of: Parameter| of.high > of.value && of.low == 0.0;
            assert!(walk.is_none_or(|term| is_wide(term.coefficient())), "{what}: {walk:?}");
        }
    }
}

#[test]
fn intervals_hold_their_value() {
    let steps = (0..198).map(|i| 1 + i / 30).collect();
    assert_bounds_hold(&analyze(&recording("gyro_x", 290.0, (0..198).collect(), steps)), "a staircase");
    for seed in 0..12 {
        let mut normal = normal(seed);
        let mut angle = 0.0;
        let walk: Vec<i32> = (0..10_000 << (seed % 3))
            .map(|_| {
                angle += 3.0 * normal();
                f64::round(angle) as i32
            })
            .collect();
        assert_bounds_hold(&analyze(&gyro(walk)), &format!("a walk, seed {seed}"));
    }
}

#[test]
fn a_channel_at_the_end_of_its_range_is_saturated() {
    for seed in 0..12 {
        // An accelerometer at the largest count of its 14 bits: half of the samples are cut off.
        let counts: Vec<i32> = white(seed, 30_000, 20.0).iter().map(|noise| (8191 + noise).min(8191)).collect();
        let at_end = counts.iter().filter(|&&count| count == 8191).count() as f64 / 30_000.0;
        let slots = || (0..30_000).collect();
        let report = analyze(&recording("accl_x", RATE_HZ, slots(), counts));
        let [ChannelEffect { effect: Effect::Saturation(saturation), .. }] = &only(&report).effects[..] else {
            panic!("seed {seed}: {:?}", kinds(&report))
        };
        assert!((saturation.fraction.value - at_end).abs() < 1e-3, "{saturation:?}");
        assert!((saturation.level.value - 8191.0 * 3.33e-3).abs() < 0.5, "{saturation:?}");
        // A gyro that something before the output clips at ±6000 counts.
        let mut normal = normal(seed);
        let wave = |i: i32| 6500.0 * (TAU * f64::from(i) / 5000.0).sin();
        let clipped = (0..30_000).map(|i| (wave(i) + 20.0 * normal()).round().clamp(-6000.0, 6000.0) as i32).collect();
        let report = analyze(&recording("gyro_x", RATE_HZ, slots(), clipped));
        assert!(kinds(&report).contains(&"saturated"), "seed {seed}: {:?}", kinds(&report));
        // Noise within the range is not saturated, whatever its largest count.
        let report = analyze(&recording("gyro_x", RATE_HZ, slots(), white(seed, 30_000, 20.0)));
        assert!(kinds(&report).is_empty(), "seed {seed}: {:?}", kinds(&report));
    }
}

/// The last tenth is three times as loud; or six seconds are thirty times as loud.
#[test]
fn a_change_of_the_noise_level_is_no_line() {
    for seed in 0..12 {
        let counts = white(seed, 60_000, 20.0);
        let louder: Vec<i32> = counts.iter().enumerate().map(|(i, n)| if i < 54_000 { *n } else { 3 * n }).collect();
        let knocked: Vec<i32> =
            counts.iter().enumerate().map(|(i, n)| if (30_000..30_600).contains(&i) { 30 * n } else { *n }).collect();
        for (what, counts) in [("a louder tenth", louder), ("six loud seconds", knocked)] {
            let report = analyze(&gyro(counts));
            let lines = ["sinusoid", "resonance", "telegraph", "markov", "square_wave"];
            let found = kinds(&report);
            assert!(!found.iter().any(|kind| lines.contains(kind)), "{what}, seed {seed}: {found:?}");
        }
    }
}

/// 100 counts are 5 °/s.
#[test]
fn a_slow_sinusoid_is_right_or_unnamed() {
    for frequency in [0.01, 0.005] {
        for seed in 0..12 {
            let mut normal = normal(seed);
            let wave = |i: i32| 100.0 * (TAU * frequency * f64::from(i) / RATE_HZ).sin();
            let report = analyze(&gyro((0..60_000).map(|i| (wave(i) + 20.0 * normal()).round() as i32).collect()));
            for ChannelEffect { effect, .. } in &only(&report).effects {
                let what = format!("{frequency} Hz, seed {seed}: {effect:?}");
                let line = match effect {
                    Effect::SinusoidalLine(line) => line,
                    Effect::Unexplained(_) => continue,
                    _ => panic!("{what}"),
                };
                // Beside three periods a line of less than a tenth of the wave may stand in its skirts.
                let is_skirt = frequency < 0.01 && line.amplitude.value < 0.5;
                if !is_skirt {
                    assert!((line.frequency_hz.value / frequency - 1.0).abs() < 0.02, "{what}");
                    assert!((line.amplitude.value / 5.0 - 1.0).abs() < 0.02, "{what}");
                }
            }
        }
    }
}

#[test]
fn noise_below_a_count_is_told() {
    for seed in 0..12 {
        let report = analyze(&gyro(white(seed, 30_000, 0.2)));
        assert_eq!(kinds(&report), ["noise_below_count"], "seed {seed}");
    }
    let report = analyze(&gyro(vec![17; 30_000]));
    assert_eq!(kinds(&report), ["noise_below_count"], "a constant channel");
    // N of half a count is right, and the report has nothing to say.
    let report = analyze(&gyro(white(1, 30_000, 0.5)));
    assert!(kinds(&report).is_empty(), "{:?}", kinds(&report));
}

/// 0.3 counts around 0.4 have 0.23 counts² after rounding, and around 0.5 0.25: N would be 60 to 67 % too large. It is told, and the
/// bounds of the noise hold it.
#[test]
fn noise_below_a_count_is_told_wherever_its_mean_is() {
    for (seed, mean, deviation) in [(0, 0.4, 0.3), (1, 0.5, 0.3), (2, 0.5, 0.25), (3, 0.45, 0.4), (4, 0.0, 0.4)] {
        let mut normal = normal(seed);
        let counts = (0..30_000).map(|_| f64::round(mean + deviation * normal()) as i32).collect();
        let report = analyze(&gyro(counts));
        let what = format!("{deviation} counts around {mean}");
        let [ChannelEffect { effect: Effect::NoiseBelowCount(noise), .. }] = &only(&report).effects[..] else {
            panic!("{what}: {:?}", kinds(&report))
        };
        let bounds = noise.deviation.low..=noise.deviation.high;
        assert!(bounds.contains(&(0.05 * deviation)), "{what}: {noise:?}");
    }
}

/// The line of 5 Hz is there; whatever else is named is no smaller than a thousandth of a count.
#[test]
fn a_sinusoid_without_noise_is_one_line() {
    let report = analyze(&gyro(
        (0..60_000).map(|i| (100.0 * (TAU * 5.0 * f64::from(i) / RATE_HZ).sin()).round() as i32).collect(),
    ));
    let effects = &only(&report).effects;
    let is_five = |shown: &ChannelEffect| match &shown.effect {
        Effect::SinusoidalLine(line) if (line.frequency_hz.value - 5.0).abs() < 0.01 => {
            assert!((line.amplitude.value / 5.0 - 1.0).abs() < 0.01, "{line:?}");
            true
        }
        _ => false,
    };
    assert!(effects.iter().any(is_five), "{effects:?}");
    for ChannelEffect { effect, .. } in effects {
        let parameters = effect.parameters();
        let size = ["amplitude", "deviation"].iter().find_map(|name| parameters.get(name));
        assert!(size.is_none_or(|size| size.value > 1e-3 * 0.05), "{effect:?}");
    }
}

#[test]
fn periodic_counts_and_silence_are_analysed_without_a_panic() {
    for period in [2, 8, 1024] {
        let counts = (0..40_000).map(|i| if period == 2 { i % 2 * 2 - 1 } else { i % period }).collect();
        assert_eq!(analyze(&gyro(counts)).samples, 40_000, "period {period}");
    }
    // Noise, then silence: no epoch of the silence has a variance.
    for silence in [1_000, 30_000, 300_000] {
        let report = analyze(&gyro([white(7, 160_000, 20.0), vec![0; silence]].concat()));
        if let Some(changes) = &only(&report).nonstationarity {
            let tracking = &changes.tracking;
            let all = [changes.beyond_drift, tracking.pooled, tracking.one_step, tracking.one_step_static];
            assert!(all.iter().all(|of| of.is_finite()), "{changes:?}");
            assert!(changes.epochs.iter().all(|epoch| epoch.white_noise_ratio.is_finite()), "{changes:?}");
        }
    }
}

/// A profile with a value that is not a number equals no profile, not even itself: each channel has the noise of its own samples all
/// the same.
#[test]
fn a_channel_has_its_own_noise_whatever_its_profile_says() {
    let samples = 20_000;
    let mut measurement = gyro(white(1, samples, 20.0));
    let sensor = measurement.profile.clone();
    for (name, counts) in [("gyro_y", 40.0), ("magn_x", 80.0)] {
        let mut channel = sensor.channel(name).expect("a channel of the part");
        channel.initial_bias_error = Some(f64::NAN);
        measurement.channels.push(MeasuredChannel::new(channel, white(counts as u64, samples, counts)));
    }
    let report = analyze(&measurement);
    for (channel, counts) in report.channels.iter().zip([20.0, 40.0, 80.0]) {
        let lsb = sensor.channel(&channel.name).expect("a channel of the part").lsb;
        // 20,000 samples know N to 0.5 %.
        for model in [&channel.before, &channel.after, &channel.refitted] {
            let of = coefficient(model, "angle_random_walk").value / (counts * lsb / RATE_HZ.sqrt());
            assert!((of - 1.0).abs() < 0.03, "{}: {of}", channel.name);
        }
    }
}
