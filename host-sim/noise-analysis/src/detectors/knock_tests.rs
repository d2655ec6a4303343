//! The detector of knocks on simulated channels: false alarms and detections.

use super::knock_search::{KnockSearch, SearchedChannel};
use super::knocks::{BlockSize, Knock, KnockRule, find_by};
use super::noise_levels::tests::samples_read;
use crate::effects::Effect;
use crate::effects::findings::SIGNIFICANCE;
use crate::parallel::in_parallel;
use crate::samples::series::Series;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

const PERIOD_S: f64 = 0.01;
const SAMPLES: usize = 60_000;
/// Sample periods of a record without a knock.
const QUIET: u64 = 40_000;
const DITHERED: f64 = 0.2;

fn series(seed: u64, mut next: impl FnMut(&mut ChaCha8Rng, usize) -> f64) -> Series {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    Series {
        slots: (0..SAMPLES as u64).collect(),
        values: (0..SAMPLES).map(|at| (4.0 * next(&mut random, at)).round() / 4.0).collect(),
        span: 0..SAMPLES as u64,
        period_s: PERIOD_S,
        resolution: 0.25,
        unit: "g",
    }
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    random.sample(StandardNormal)
}

fn white(seed: u64, level: impl Fn(usize) -> f64) -> Series {
    series(seed, |random, at| level(at) * normal(random))
}

/// White noise of deviation 1 behind two cascaded averages over `taps` samples.
fn filtered(taps: usize) -> impl FnMut(&mut ChaCha8Rng, usize) -> f64 {
    let mut memory = vec![0.0; 2 * taps - 1];
    // A triangle of 1 … taps … 1; its sum of squares is taps·(2·taps² + 1)/3.
    let weight = (3.0 / (taps * (2 * taps * taps + 1)) as f64).sqrt();
    move |random, _| {
        memory.rotate_right(1);
        memory[0] = normal(random);
        let triangle = |(at, value): (usize, &f64)| ((taps - at.abs_diff(taps - 1)) as f64) * value;
        weight * memory.iter().enumerate().map(triangle).sum::<f64>()
    }
}

fn walking(step: f64) -> impl FnMut(&mut ChaCha8Rng, usize) -> f64 {
    let mut level = 0.0;
    move |random, _| {
        level += step * normal(random);
        level + normal(random)
    }
}

/// Flicker noise as a sum of Markov processes an octave apart, in white noise of deviation 0.3.
fn flickering() -> impl FnMut(&mut ChaCha8Rng, usize) -> f64 {
    let mut states = [0.0; 16];
    move |random, _| {
        for (octave, state) in states.iter_mut().enumerate() {
            let kept = (-(0.5_f64).powi(octave as i32)).exp();
            *state = kept * *state + (1.0 - kept * kept).sqrt() * normal(random);
        }
        states.iter().sum::<f64>() + 0.3 * normal(random)
    }
}

/// A resonance at a twentieth of the sample rate in white noise, whose amplitude changes within 1/`width` samples.
fn resonating(width: f64, deviation: f64) -> impl FnMut(&mut ChaCha8Rng, usize) -> f64 {
    let (mut a, mut b) = (0.0, 0.0);
    let kept = (-width).exp();
    let (sine, cosine) = (TAU / 20.0).sin_cos();
    move |random, _| {
        let drive = (1.0 - kept * kept).sqrt();
        (a, b) = (
            kept * (a * cosine - b * sine) + drive * normal(random),
            kept * (a * sine + b * cosine) + drive * normal(random),
        );
        deviation * a + normal(random)
    }
}

/// A resonance in white noise; ln amplitude is a Markov process of deviation ln 2, correlation time in samples.
fn wandering(deviation: f64, time: f64) -> impl FnMut(&mut ChaCha8Rng, usize) -> f64 {
    let (mut a, mut b, mut level) = (0.0, 0.0, 0.0);
    let (kept, level_kept) = ((-0.1_f64).exp(), (-1.0 / time).exp());
    let (sine, cosine) = (TAU / 20.0).sin_cos();
    let drive = |kept: f64| (1.0 - kept * kept).sqrt();
    move |random, _| {
        level = level_kept * level + drive(level_kept) * normal(random);
        (a, b) = (
            kept * (a * cosine - b * sine) + drive(kept) * normal(random),
            kept * (a * sine + b * cosine) + drive(kept) * normal(random),
        );
        deviation * 2_f64.powf(level) * a + normal(random)
    }
}

/// Telegraph noise with levels `amplitude` apart and correlation time `time_s` in white noise.
fn telegraph(amplitude: f64, time_s: f64) -> impl FnMut(&mut ChaCha8Rng, usize) -> f64 {
    let mut up = false;
    move |random, _| {
        up ^= random.random_bool(0.5 * PERIOD_S / time_s);
        normal(random) + if up { amplitude } else { 0.0 }
    }
}

const RECORDS: u64 = 40;

/// Chance gives a record a knock with a probability of 2·10⁻⁴; more than one of 40 has one once in 30,000 times.
fn assert_quiet(name: &str, record: impl Fn(u64) -> Series + Sync) {
    let found = records_with_a_knock(record);
    assert!(found <= 1, "{name}: {found} of {RECORDS} records, {} expected", RECORDS as f64 * SIGNIFICANCE);
}

fn find(channels: &[Series]) -> Vec<Vec<Knock>> {
    let searched = |series: &Series| SearchedChannel { series: series.clone(), can_show_spikes: true };
    let channels: Vec<SearchedChannel> = channels.iter().map(searched).collect();
    let (_, found) = KnockSearch::fit(&channels, &[], DITHERED);
    found.into_iter().map(|of| of.knocks).collect()
}

fn records_with_a_knock(record: impl Fn(u64) -> Series + Sync) -> usize {
    let is_found = |seed: &u64| !find(&[record(*seed).before(QUIET)])[0].is_empty();
    in_parallel(&(0..RECORDS).collect::<Vec<u64>>(), is_found).into_iter().filter(|found| *found).count()
}

#[test]
fn a_long_knock_is_one() {
    const SAMPLES: usize = 1 << 18;
    let (first, last) = (SAMPLES / 2, SAMPLES / 2 + 2000);
    for seed in 0..3 {
        let channel = |number: u64| {
            let mut random = ChaCha8Rng::seed_from_u64(100 * seed + number);
            let level = |at: usize| if (first..last).contains(&at) { 5.0 } else { 1.0 };
            let values: Vec<f64> = (0..SAMPLES).map(|at| level(at) * normal(&mut random)).collect();
            let slots = 0..SAMPLES as u64;
            Series {
                slots: slots.clone().collect(),
                values: values.into(),
                span: slots,
                period_s: 0.005,
                resolution: 1e-4,
                unit: "deg/s",
            }
        };
        for knocks in find(&[channel(0), channel(1)]) {
            let [knock] = &knocks[..] else { panic!("{seed}: {knocks:?}") };
            let common = knock.slots.end.min(last as u64) - knock.slots.start.max(first as u64);
            assert!(common >= 1900 && knock.slots.end - knock.slots.start < 3000, "{seed}: {knock:?}");
        }
    }
}

#[test]
fn white_and_filtered_noise_have_no_knock() {
    assert_quiet("white", |seed| white(seed, |_| 1.0));
    assert_quiet("8 taps", |seed| series(seed, filtered(8)));
    assert_quiet("32 taps", |seed| series(seed, filtered(32)));
}

#[test]
fn drifting_noise_has_no_knock() {
    assert_quiet("weak walk", |seed| series(seed, walking(0.01)));
    assert_quiet("strong walk", |seed| series(seed, walking(1.0)));
    assert_quiet("flicker", |seed| series(seed, flickering()));
}

#[test]
fn lines_and_resonances_have_no_knock() {
    assert_quiet("sinusoid", |seed| series(seed, |random, at| 3.0 * (TAU * 0.123 * at as f64).sin() + normal(random)));
    for width in [0.1, 0.01, 0.001] {
        assert_quiet(&format!("resonance of width {width}"), |seed| series(seed, resonating(width, 1.0)));
    }
}

#[test]
fn vibrations_whose_level_wanders_have_no_knock() {
    // Noise that hides its movements, or has few blocks: at most 1 in 100 of 240 records.
    let vibrations = [0.3, 1.0, 3.0].into_iter().flat_map(|deviation| [500.0, 2000.0].map(|time| (deviation, time)));
    let found: Vec<usize> = vibrations
        .map(|(deviation, time)| records_with_a_knock(|seed| series(seed, wandering(deviation, time))))
        .collect();
    assert!(found.iter().sum::<usize>() <= 2, "{found:?}");
}

#[test]
fn a_noise_level_that_follows_the_temperature_has_no_knock() {
    // A factor of 1.5 over two minutes, and a cycle of ±5 % in ten minutes, as √T of ±30 °C.
    let minute = 60.0 / PERIOD_S;
    assert_quiet("warming", |seed| white(seed, |at| 1.0 + 0.5 * (1.0 - (-(at as f64) / (2.0 * minute)).exp())));
    assert_quiet("cycle", |seed| white(seed, |at| 1.0 + 0.05 * (TAU * at as f64 / (10.0 * minute)).sin()));
    assert_quiet("a level that changes once", |seed| white(seed, |at| if at < SAMPLES / 3 { 1.0 } else { 1.5 }));
}

#[test]
fn jumps_of_the_bias_are_no_knock() {
    for (amplitude, time_s) in [(5.0, 0.1), (5.0, 1.0), (20.0, 3.0), (100.0, 10.0), (100.0, 60.0)] {
        assert_quiet(&format!("telegraph {amplitude} {time_s}"), |seed| series(seed, telegraph(amplitude, time_s)));
    }
}

/// More than one record has a knock by chance in one of a thousand cases.
#[test]
fn single_samples_are_no_knock() {
    let found = [0.0005, 0.002, 0.005].map(|rate| {
        let spikes = |random: &mut ChaCha8Rng| if random.random_bool(rate) { 20.0 } else { 0.0 };
        let behind_filter = |seed: u64| {
            let (mut noise, mut last) = (filtered(2), [0.0; 3]);
            series(seed, move |random, at| {
                last = [spikes(random), last[0], last[1]];
                noise(random, at) + 0.25 * last[0] + 0.5 * last[1] + 0.25 * last[2]
            })
        };
        let white = |seed: u64| series(seed, |random, _| spikes(random) + normal(random));
        records_with_a_knock(white) + records_with_a_knock(behind_filter)
    });
    assert!(found.iter().sum::<usize>() <= 1, "{found:?}");
}

#[test]
fn random_losses_are_no_knock() {
    for share in [0.005, 0.05] {
        assert_quiet(&format!("{share} lost"), |seed| {
            let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
            let lost: Vec<bool> = (0..SAMPLES).map(|_| random.random_bool(share)).collect();
            series(seed, filtered(8)).filtered(|slot| !lost[slot as usize])
        });
    }
    // Losses in one half minute: every second sample.
    assert_quiet("a burst of losses", |seed| {
        white(seed, |_| 1.0).filtered(|slot| !(20_000..23_000).contains(&slot) || slot % 2 == 0)
    });
}

#[test]
fn noise_below_a_count_has_no_knock() {
    // The bias drifts from the middle of a count to its edge and back.
    assert_quiet("undithered", |seed| {
        series(seed, |random, at| 0.03 * normal(random) + 0.125 * (TAU * at as f64 / 20_000.0).sin())
    });
}

/// Length in s and level of knocks that are found with certainty.
const KNOCKS: [(f64, f64); 5] = [(1.0, 5.0), (3.0, 3.0), (10.0, 2.0), (30.0, 1.5), (40.0, 1.3)];

#[test]
fn knocks_of_seconds_to_minutes_are_found_measured_and_excluded() {
    assert_knocks_are_found(0.0);
}

#[test]
fn knocks_are_found_and_measured_where_samples_are_lost() {
    assert_knocks_are_found(0.02);
}

fn assert_knocks_are_found(lost: f64) {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let kept: Vec<bool> = (0..SAMPLES).map(|_| !random.random_bool(lost)).collect();
    let start_s = 200.0;
    let (mut covered, mut all) = (0, 0);
    for (seed, (length_s, level)) in KNOCKS.into_iter().enumerate() {
        let inside = |at: usize| (start_s..start_s + length_s).contains(&(at as f64 * PERIOD_S));
        let record = white(50 + seed as u64, |at| if inside(at) { level } else { 1.0 });
        let record = record.filtered(|slot| kept[slot as usize]);
        let found = find(std::slice::from_ref(&record)).remove(0);
        let [knock] = &found[..] else { panic!("{length_s} s at {level}: {found:?}") };
        let effect = Effect::from(knock.interval(PERIOD_S, &["accl_x"]));
        assert_eq!(effect.name(), "knock");
        for (name, truth) in [("from", start_s), ("to", start_s + length_s), ("level", level)] {
            let parameter = &effect.parameters()[name];
            println!("{length_s} s at {level}: {name} {truth}: {parameter:?}");
            covered += usize::from((parameter.low..=parameter.high).contains(&truth));
            all += 1;
        }
        let excluded = |slot: f64| knock.slots.contains(&(slot as u64));
        let samples = (0..SAMPLES).filter(|&at| inside(at));
        let share = samples.clone().filter(|&at| excluded(at as f64)).count() as f64 / samples.count() as f64;
        let outside = (0..SAMPLES).filter(|&at| !inside(at) && excluded(at as f64)).count() as f64 * PERIOD_S;
        assert!(share > 0.9, "{length_s} s at {level}: {share}");
        assert!(outside < 0.5 + 0.3 * length_s, "{length_s} s at {level}: {outside} s too many");
    }
    // In 15 intervals of 95 %, more than three miss once in 200 times.
    assert!(covered >= all - 3, "{covered} of {all}");
}

/// A mount rings at an 18th of the sample rate, with 30 deviations of the filtered noise, and decays in ten samples.
#[test]
fn a_knock_of_a_few_samples_is_found_behind_a_filter() {
    let begin = |seed: u64| 20_000 + 7 * seed as usize;
    let record = |seed: u64| {
        let mut noise = filtered(4);
        series(seed, |random, at| {
            let since = at as f64 - begin(seed) as f64;
            let ringing = if since < 0.0 { 0.0 } else { 30.0 * (-since / 10.0).exp() * (TAU * since / 18.0).sin() };
            ringing + noise(random, at)
        })
    };
    for seed in 0..20 {
        let found = find(&[record(seed)]).remove(0);
        let [knock] = &found[..] else { panic!("{seed}: {found:?}") };
        let (begin, slots) = (begin(seed) as u64, &knock.slots);
        assert!(slots.start <= begin + 4 && slots.start + 40 > begin, "{seed}: {begin}, {knock:?}");
        assert!((begin + 15..begin + 80).contains(&slots.end), "{seed}: {begin}, {knock:?}");
    }
}

#[test]
fn a_decaying_shock_is_left_out_to_its_end() {
    let record = white(70, |at| {
        let since = at as f64 * PERIOD_S - 300.0;
        if since < 0.0 { 1.0 } else { 1.0 + 100.0 * (-since / 2.0).exp() }
    });
    let found = find(std::slice::from_ref(&record)).remove(0);
    assert_eq!(found.len(), 1, "{found:?}");
    // The noise is back within 20 % of its level after 2·ln(100/0.2) = 12.4 s.
    assert!(found[0].slots.start.abs_diff(30_000) < 100, "{found:?}");
    assert!((31_000..31_600).contains(&found[0].slots.end), "{found:?}");
}

#[test]
fn a_shock_is_found_in_every_channel_that_shows_it_and_in_no_other() {
    let inside = |at: usize| (25_000..25_500).contains(&at);
    // Without the other channel, 1.35 times the noise over five seconds is no knock.
    let channels =
        [6.0, 1.35, 1.0].map(|level| white((100.0 * level) as u64, |at| if inside(at) { level } else { 1.0 }));
    assert!(find(&channels[1..]).iter().all(Vec::is_empty));
    let found = find(&channels);
    assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [1, 1, 0], "{found:?}");
}

/// A knock of 3 s at 200 s, and the same record with a pause of 10¹² sample periods at 300 s.
fn knock_before_a_pause(level: f64) -> [Series; 2] {
    const PAUSE: u64 = 1_000_000_000_000;
    let record = white(80, |at| if (20_000..20_300).contains(&at) { level } else { 1.0 });
    let later = |slot: u64| if slot < 30_000 { slot } else { slot + PAUSE };
    let slots = record.slots.iter().map(|slot| later(*slot)).collect();
    [record.clone(), Series { slots, span: 0..SAMPLES as u64 + PAUSE, ..record }]
}

/// An array of 10¹² sample periods would not be allocated.
#[test]
fn a_long_pause_takes_no_memory_and_changes_no_knock_before_it() {
    let [of_record, of_paused] = knock_before_a_pause(3.0).map(|record| find(&[record]).remove(0));
    assert_eq!((of_record.len(), of_paused.len()), (1, 1), "{of_record:?} {of_paused:?}");
    assert_eq!(of_record[0].slots, of_paused[0].slots);
}

/// Seven lengths of the knock on either side give the level around it; six averaging times read twice as many, and their ends.
#[test]
fn a_known_time_is_looked_up_near_it_alone() {
    let [record, paused] = knock_before_a_pause(1.35);
    let rule = KnockRule::fit(&record, DITHERED);
    let known = find(&knock_before_a_pause(6.0)[..1]).remove(0).remove(0);
    let before = samples_read();
    let found = rule.at_known_time(&record, &known);
    let read = samples_read() - before;
    assert!(found.is_some() && found == rule.at_known_time(&paused, &known), "{found:?}");
    let length = known.slots.end - known.slots.start;
    assert!(read < 6 * 20 * length, "{read} samples for a knock of {length}");
}

#[test]
fn rules_of_one_half_are_applied_to_the_other() {
    let record = white(90, |at| if (45_000..46_000).contains(&at) { 3.0 } else { 1.0 });
    let (first, second) = (record.before(30_000), record.from(30_000));
    let rules = [KnockRule::fit(&first, DITHERED)];
    assert!(find_by(&rules, &[first], BlockSize::Many)[0].is_empty());
    let found = find_by(&rules, &[second], BlockSize::Many).remove(0);
    assert_eq!(found.len(), 1);
    assert!(found[0].slots.start.abs_diff(45_000) < 50 && found[0].slots.end.abs_diff(46_000) < 50, "{found:?}");
}

#[test]
fn short_and_constant_records_have_no_knock() {
    let short = white(1, |_| 1.0).before(300);
    assert!(find(&[short])[0].is_empty());
    assert!(find(&[series(1, |_, _| 0.0)])[0].is_empty());
    assert!(find(&[white(1, |_| 1.0).before(0)])[0].is_empty());
}
