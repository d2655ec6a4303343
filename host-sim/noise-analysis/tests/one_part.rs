//! A property that a sensor has once is the same in all its channels, and a channel has one N, B and K wherever its report shows them.

#[path = "support/simulated_part.rs"]
mod simulated_part;

use measurement::{MeasuredChannel, Measurement, adis16405};
use noise_analysis::analysis::analyze;
use noise_analysis::effects::Effect;
use noise_analysis::report::{ChannelReport, Parameter, PartNote, Report, TermReport};
use simulated_part::{RecordedChannel, read};
use std::collections::BTreeMap;

const CLOCK_HZ: f64 = 819.2;
const SAMPLES: usize = 1 << 17;
/// White noise of each channel, counts.
const DEVIATIONS: [(&str, f64); 4] = [("gyro_x", 10.0), ("gyro_y", 20.0), ("accl_x", 4.0), ("accl_y", 40.0)];

/// A part with a Bartlett window of `taps` values a stage, read at `rate_hz`, with time stamps where it `is_stamped`, and a
/// gyroscope that never changes.
fn recorded(taps: usize, rate_hz: f64, is_stamped: bool, seed: u64) -> Measurement {
    let profile = adis16405::profile(0.05);
    let channel = |name: &str| profile.channel(name).expect("a channel of the part");
    let noisy = (0..).zip(DEVIATIONS).map(|(index, (name, deviation))| {
        let decimation = CLOCK_HZ / rate_hz;
        let counts = RecordedChannel { taps, decimation, deviation, samples: SAMPLES, seed: 100 * seed + index };
        MeasuredChannel::new(channel(name), read(&counts))
    });
    let constant = MeasuredChannel::new(channel("gyro_z"), vec![3; SAMPLES]);
    let channels = noisy.chain([constant]).collect();
    Measurement {
        sample_rate_hz: rate_hz,
        stated_rate_hz: (!is_stamped).then_some(rate_hz),
        slots: (0..SAMPLES as u64).collect(),
        times_s: is_stamped.then(|| (0..SAMPLES).map(|at| at as f64 / rate_hz).collect()),
        channels,
        dropped: BTreeMap::new(),
        flagged: BTreeMap::new(),
        profile,
    }
}

/// Decimation and taps of the filter, by the model and by the effect.
fn filter_terms(channel: &ChannelReport) -> impl Iterator<Item = [Parameter; 2]> {
    let of_terms = channel.refitted.terms.iter().filter(|term| term.kind() == "filter_bandwidth");
    let of_effects = channel.effects.iter().filter_map(|shown| match &shown.effect {
        Effect::OutputFilter(of) => Some([of.decimation.parameter(""), of.taps.parameter("")]),
        _ => None,
    });
    of_terms.map(|term| ["decimation", "taps"].map(|name| term.parameters()[name].clone())).chain(of_effects)
}

fn noisy(report: &Report) -> impl Iterator<Item = &ChannelReport> {
    report.channels.iter().filter(|channel| channel.name != "gyro_z")
}

#[test]
fn all_channels_have_the_filter_and_the_clock_of_the_part() {
    for (taps, rate_hz, seed) in [(8, 91.8, 1), (16, 137.0, 2)] {
        let report = analyze(&recorded(taps, rate_hz, true, seed));
        let part = &report.part;
        assert_eq!(part.filter.as_deref(), Some("bartlett"), "{part:?}");
        let (clock, decimation) =
            (part.clock.as_ref().expect("a clock"), part.decimation.as_ref().expect("a decimation"));
        // Twice the half-width of the 95 % interval: one in ten thousand correct intervals is farther off.
        let reach = clock.high - clock.low;
        assert!((clock.value - CLOCK_HZ).abs() < reach && reach < 0.02 * CLOCK_HZ, "{clock:?}");
        for channel in noisy(&report) {
            assert_eq!(filter_terms(channel).count(), 2, "{}: {:?}", channel.name, channel.effects);
            for [of_channel, taps] in filter_terms(channel) {
                assert_eq!(of_channel, *decimation, "{}", channel.name);
                assert_eq!(taps.value, part.taps.as_ref().expect("taps").value, "{}", channel.name);
            }
        }
    }
}

/// The spectrum behind a filter of which each so many-th value is read is folded at half the sample rate, where it has a null.
#[test]
fn a_folded_spectrum_has_no_lines() {
    for (taps, rate_hz, seed) in [(4, CLOCK_HZ / 2.0, 5), (8, CLOCK_HZ / 4.0, 6)] {
        let report = analyze(&recorded(taps, rate_hz, false, seed));
        for channel in noisy(&report) {
            let kinds: Vec<&str> = channel.effects.iter().map(|shown| shown.effect.name()).collect();
            assert_eq!(kinds, ["filter_bandwidth"], "{taps} taps at {rate_hz} Hz: {}", channel.name);
        }
    }
}

/// N of the samples is the deviation times the root of the sample period: the filter passes low frequencies unchanged.
#[test]
fn one_channel_has_one_n() {
    let report = analyze(&recorded(8, 100.0, false, 3));
    assert_eq!(report.part.clock, None);
    assert!(matches!(report.part.notes[..], [PartNote::NoTimeStamps { .. }, ..]), "{:?}", report.part);
    for (channel, (name, deviation)) in noisy(&report).zip(DEVIATIONS) {
        assert_eq!(channel.name, name);
        let n = |terms: &[TermReport]| -> f64 {
            let white = terms.iter().filter(|term| ["filter_bandwidth", "angle_random_walk"].contains(&term.kind()));
            white.map(|term| term.term.value.powi(2)).sum::<f64>().sqrt()
        };
        let white =
            |of: &&noise_analysis::report::assessment::Coefficient| of.kind == "angle_random_walk" && !of.discrete;
        let coefficients: Vec<&Parameter> =
            channel.assessment.coefficients.iter().filter(white).map(|of| &of.value).collect();
        // Gyroscopes are in deg/sqrt(s), accelerometers in ug/sqrt(Hz).
        let (lsb, unit) = if name.starts_with("gyro") { (0.05, 1.0) } else { (3.33e-3, 1e6) };
        let used = coefficients[0];
        assert!((used.value / (unit * n(&channel.refitted.terms)) - 1.0).abs() < 1e-12, "{name}: {used:?}");
        // Each unit once.
        assert_eq!(coefficients.iter().filter(|of| of.unit == used.unit).count(), 1, "{name}");
        // 22 minutes of noise tell N to 1 %, and half of them to 1.4 times that. Where white noise after the filter (rounding, in
        // the channel of 4 counts) is a term of its own, the errors of the two count as independent, although their sum is known
        // better: 3 %.
        let truth = lsb * deviation / 10.0;
        let reach = (used.high - used.low) / unit;
        assert!((used.value / unit - truth).abs() < reach && reach < 0.06 * truth, "{name}: {used:?} of {truth}");
        assert!((n(&channel.after.terms) - truth).abs() < 1.5 * reach, "{name}: {:?} of {truth}", channel.after.terms);
    }
}

#[test]
fn white_noise_identifies_no_filter_and_a_constant_channel_no_coefficients() {
    let report = analyze(&recorded(1, CLOCK_HZ, true, 4));
    let part = &report.part;
    assert_eq!((part.clock.as_ref(), part.filter.as_ref(), part.taps.as_ref()), (None, None, None));
    assert!(matches!(part.notes[..], [PartNote::NotCorrelated { .. }]), "{part:?}");
    assert!(noisy(&report).all(|channel| filter_terms(channel).next().is_none()));
    let constant = report.channels.iter().find(|channel| channel.name == "gyro_z").expect("recorded");
    assert_eq!((constant.assessment.coefficients.len(), constant.assessment.record.len()), (0, 0));
    assert!(constant.assessment.coefficients_note.as_ref().is_some_and(|note| note.contains("never changes")));
    assert!([&constant.before, &constant.after, &constant.refitted].iter().all(|model| model.terms.is_empty()));
}
