//! Recordings that are condensed because they are too long to be kept: what is found in them is what was put in, and the curves are
//! those of the same samples in memory.

use measurement::adis16405::profile;
use measurement::{MeasuredChannel, Measurement, RecordingDescription};
use noise_analysis::analysis::{analyze, analyze_condensed, analyze_samples};
use noise_analysis::record::long_record::LongRecordReader;
use noise_analysis::report::{ChannelReport, Parameter, Report, Validation};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

const RATE_HZ: f64 = 204.8;
/// 49 min: means of two samples.
const PERIODS: u64 = 600_000;
/// White noise of 10 counts of 0.05 °/s at 204.8 Hz, °/√s.
const N: f64 = 0.034_94;
/// Slower than the means show, and faster: Hz.
const SLOW_LINE_HZ: f64 = 0.371;
const FAST_LINE_HZ: f64 = 77.3;
/// °/s/°C.
const SENSITIVITY: f64 = 0.02;
const SPIKES: u64 = 30;

/// Three gyros and the temperature: a slow line and spikes in x, a fast line in y, a bias that follows the temperature in z. A part in
/// 500 of the samples is lost, and 4,000 in a row.
fn recorded() -> Measurement {
    let profile = profile(0.05);
    let mut random = ChaCha8Rng::seed_from_u64(31);
    let channel = |name: &str| profile.channel(name).expect("a channel of the part");
    let mut channels =
        ["gyro_x", "gyro_y", "gyro_z", "temp"].map(|name| MeasuredChannel::new(channel(name), Vec::new()));
    let mut slots = Vec::new();
    for slot in 0..PERIODS {
        let time = slot as f64 / RATE_HZ;
        let mut white = || 10.0 * random.sample::<f64, _>(StandardNormal);
        let temperature = 10.0 * (TAU * time / 1500.0).sin() + 3.0 * (TAU * time / 611.0).cos();
        let counts = [
            white() + 0.4 * (TAU * SLOW_LINE_HZ * time).sin(),
            white() + 2.0 * (TAU * FAST_LINE_HZ * time).sin(),
            white() + SENSITIVITY * temperature / 0.05,
            temperature / 0.14 + 0.1 * white(),
        ];
        let is_spike = slot % (PERIODS / SPIKES) == 777;
        if random.random_bool(0.002) || (400_000..404_000).contains(&slot) {
            continue;
        }
        slots.push(slot);
        for (channel, count) in channels.iter_mut().zip(counts) {
            channel.counts.push(count.round() as i32);
        }
        if is_spike {
            *channels[0].counts.last_mut().expect("the sample") += 200;
        }
    }
    let missing = PERIODS - slots.len() as u64;
    Measurement {
        profile,
        sample_rate_hz: RATE_HZ,
        stated_rate_hz: Some(RATE_HZ),
        slots,
        times_s: None,
        channels: channels.into(),
        dropped: BTreeMap::from([("gap", missing)]),
        flagged: BTreeMap::new(),
    }
}

/// Spikes of gyro x that were not lost.
fn spikes(measurement: &Measurement) -> u64 {
    measurement.channels[0].counts.iter().filter(|count| **count > 100).count() as u64
}

/// The report of a measurement that is read in blocks of `rows`.
fn condensed(measurement: &Measurement, rows: usize) -> Report {
    let mut reader = LongRecordReader::new(RecordingDescription::from(measurement), measurement);
    measurement.blocks(rows).for_each(|block| reader.push(&block));
    analyze_condensed(&reader.finish(), &|_| {})
}

fn channel<'a>(report: &'a Report, name: &str) -> &'a ChannelReport {
    report.channels.iter().find(|channel| channel.name == name).expect("a recorded channel")
}

fn parameter(report: &Report, name: &str, kind: &str, parameter: &str) -> Parameter {
    let effects = &channel(report, name).effects;
    let effect =
        effects.iter().find(|shown| shown.effect.name() == kind).unwrap_or_else(|| panic!("{name}: no {kind}"));
    effect.effect.parameters()[parameter].clone()
}

#[test]
fn a_condensed_recording_has_the_curves_and_the_findings_of_its_samples() {
    let measurement = recorded();
    let (whole, long) = (analyze_samples(&measurement), condensed(&measurement, 5_000));
    assert_eq!((whole.samples, &whole.dropped), (long.samples, &long.dropped));
    for (of_whole, of_long) in whole.channels.iter().zip(&long.channels) {
        let name = &of_whole.name;
        let curve = |of: &ChannelReport| of.curve.iter().map(|point| (point.n, point.adev)).collect::<Vec<_>>();
        assert_eq!(curve(of_whole), curve(of_long), "{name}");
        assert_eq!(of_whole.missing.lost, of_long.missing.lost);
        // The models are fitted to the same curves up to 16 samples, and to those of means behind them.
        let n = |of: &ChannelReport| of.refitted.terms.iter().find(|term| term.kind() == "angle_random_walk").cloned();
        let (Some(a), Some(b)) = (n(of_whole), n(of_long)) else { panic!("{name} has no white noise") };
        let (a, b) = (a.coefficient(), b.coefficient());
        assert!((a.value - b.value).abs() < 0.25 * (a.high - a.low), "{name}: {a:?} {b:?}");
        if name != "temp" {
            assert!((b.low..=b.high).contains(&N), "{name}: {b:?}");
        }
    }
    // A periodogram knows the frequency of a line to a part of one over the length, 0.34 mHz, or of a stretch of 2¹⁶ samples, 3 mHz; the
    // clock to 10⁻⁴.
    for report in [&whole, &long] {
        let slow = parameter(report, "gyro_x", "sinusoid", "frequency");
        assert!((slow.value - SLOW_LINE_HZ).abs() < 0.34e-3, "{slow:?}");
        let fast = parameter(report, "gyro_y", "sinusoid", "frequency");
        assert!((fast.value - FAST_LINE_HZ).abs() < 3e-3 + 1e-4 * FAST_LINE_HZ, "{fast:?}");
        let sensitivity = parameter(report, "gyro_z", "temperature", "sensitivity");
        assert!((sensitivity.low..=sensitivity.high).contains(&SENSITIVITY), "{sensitivity:?}");
        let size = parameter(report, "gyro_x", "spikes", "size");
        assert!((size.low..=size.high).contains(&10.0), "{size:?}");
        assert_eq!(channel(report, "gyro_x").missing.refused["spikes"], spikes(&measurement));
        let kinds: Vec<&str> = report.findings.iter().map(|finding| finding.effect.name()).collect();
        let mut sorted = kinds.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, ["dropped_samples", "sinusoid", "sinusoid", "spikes", "temperature"], "{kinds:?}");
    }
    // The spikes are as frequent and as large in either half.
    let spikes = long.findings.iter().find(|finding| finding.effect.name() == "spikes").expect("spikes");
    assert_eq!(spikes.validated, Validation::Yes);
}

/// A fan that is switched on after ten minutes and a half: the samples at the start of the recording do not show its line.
#[test]
fn a_fast_line_that_begins_later_is_found() {
    const BEGINS: u64 = 1 << 17;
    const AMPLITUDE: f64 = 1.0;
    let mut measurement = recorded();
    measurement.channels.truncate(1);
    let mut random = ChaCha8Rng::seed_from_u64(47);
    for (count, &slot) in measurement.channels[0].counts.iter_mut().zip(&measurement.slots) {
        let line = if slot < BEGINS { 0.0 } else { AMPLITUDE * (TAU * FAST_LINE_HZ * slot as f64 / RATE_HZ).sin() };
        // Rounded up or down by chance, so that the line does not depend on the count that it is added to.
        *count += (line + random.random::<f64>()).floor() as i32;
    }
    let report = condensed(&measurement, 1 << 14);
    let effects = &channel(&report, "gyro_x").effects;
    let lines: Vec<f64> = effects.iter().filter_map(|of| of.effect.frequency_hz()).map(|of| of.value).collect();
    // The slow line, and this one to 10⁻⁴, as the clock is known, and a part of the resolution of a stretch of 2¹⁶ samples, 3 mHz.
    assert!(
        lines.len() == 2 && lines.iter().any(|of| (of - FAST_LINE_HZ).abs() < 3e-3 + 1e-4 * FAST_LINE_HZ),
        "{lines:?}"
    );
}

/// A fan that is switched on in the second half: the first half has no line of it to compare.
#[test]
fn a_fast_line_of_the_second_half_is_not_validated() {
    let mut measurement = recorded();
    measurement.channels.truncate(1);
    let mut random = ChaCha8Rng::seed_from_u64(48);
    for (count, &slot) in measurement.channels[0].counts.iter_mut().zip(&measurement.slots) {
        let line = if slot < PERIODS / 2 { 0.0 } else { (TAU * FAST_LINE_HZ * slot as f64 / RATE_HZ).sin() };
        *count += (line + random.random::<f64>()).floor() as i32;
    }
    let report = condensed(&measurement, 1 << 14);
    let is_fast = |frequency_hz: f64| (frequency_hz - FAST_LINE_HZ).abs() < 0.1;
    let line = report.findings.iter().find(|of| of.effect.frequency_hz().is_some_and(|of| is_fast(of.value)));
    assert_eq!(line.expect("the line").validated, Validation::Untestable);
}

/// Ten seconds of noise that is five times as large, which the samples show in pieces and the means as one stretch.
#[test]
fn a_long_knock_is_one() {
    let mut measurement = recorded();
    measurement.channels.truncate(2);
    for channel in measurement.channels.iter_mut() {
        let loud =
            channel.counts.iter_mut().zip(&measurement.slots).filter(|(_, slot)| (300_000..302_048).contains(*slot));
        loud.for_each(|(count, _)| *count *= 5);
    }
    let report = condensed(&measurement, 1 << 14);
    for name in ["gyro_x", "gyro_y"] {
        let knocks = channel(&report, name).effects.iter().filter(|of| of.effect.name() == "knock");
        assert_eq!(knocks.count(), 1, "{name}");
    }
}

#[test]
fn the_size_of_the_blocks_does_not_matter() {
    let mut measurement = recorded();
    measurement.channels.truncate(1);
    let [large, small] = [1 << 16, 777].map(|rows| format!("{:?}", condensed(&measurement, rows)));
    // Each is a megabyte of text.
    assert!(large == small);
}

/// A gyro that reaches the end of its range after most of an hour, in a manoeuvre: the samples at the start do not show it.
#[test]
fn a_channel_that_is_cut_off_later_is_told() {
    const BEGINS: u64 = 500_000;
    const LASTS: u64 = 3_000;
    let mut measurement = recorded();
    measurement.channels.truncate(1);
    let channel_range = measurement.channels[0].profile.range.expect("the data sheet has one");
    let limit = (channel_range / measurement.channels[0].profile.lsb).round() as i32;
    let turns = |slot: u64| (BEGINS..BEGINS + LASTS).contains(&slot);
    let mut cut_off = 0;
    for (count, _) in
        measurement.channels[0].counts.iter_mut().zip(&measurement.slots).filter(|(_, slot)| turns(**slot))
    {
        *count = limit;
        cut_off += 1;
    }
    let report = condensed(&measurement, 1 << 14);
    let share = parameter(&report, "gyro_x", "saturated", "share");
    assert_eq!(share.value, f64::from(cut_off) / measurement.len() as f64);
    let level = f64::from(limit) * measurement.channels[0].profile.lsb;
    assert_eq!(parameter(&report, "gyro_x", "saturated", "level").value, level);
}

/// White noise of which a tenth of the samples is lost: means of fewer samples than the others are no second noise.
#[test]
fn lost_samples_are_no_noise() {
    let mut measurement = recorded();
    let mut random = ChaCha8Rng::seed_from_u64(53);
    let channel = &mut measurement.channels[1];
    (channel.counts, measurement.slots) = (0..400_000_u64)
        .filter_map(|slot| {
            let (is_lost, value) = (random.random_bool(0.1), random.sample::<f64, _>(StandardNormal));
            (!is_lost).then(|| ((10.0 * value).round() as i32, slot))
        })
        .unzip();
    measurement.channels = vec![measurement.channels.swap_remove(1)];
    let missing = measurement.periods() - measurement.len() as u64;
    measurement.dropped = BTreeMap::from([("gap", missing)]);
    let report = analyze(&measurement);
    let kinds: Vec<&str> = report.findings.iter().map(|finding| finding.effect.name()).collect();
    assert_eq!(kinds, ["dropped_samples"]);
}
