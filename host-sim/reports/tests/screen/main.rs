//! The screen against the files beside this one: after a wanted change, delete the file, run the test, and read.

use crate::fixture;
use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::effects::{
    CurveEvidence, Effect, LineEvidence, LineSource, MotionInterval, MotionScale, NoisyInterval, Observation,
    OutputFilter, SinusoidalLine, Unexplained, UnexplainedPlace,
};
use noise_analysis::report::assessment::{Innovations, RecordLength};
use noise_analysis::report::{
    BiasOverTime, ChannelReport, Finding, ModelErrorReport, PartNote, Report, Stretch, Validation,
};
use reports::terminal::{MOST_LINES, Screen};
use std::collections::BTreeMap;
use std::path::Path;

fn estimate(value: f64, half_width: f64) -> BoundedEstimate {
    BoundedEstimate::new(value, value - half_width, value + half_width)
}

const CURVE: CurveEvidence = CurveEvidence { excess: 0.1, tau_s: 1.0, sigmas: 9.0, gain_sigmas: 9.0 };

fn finding(effect: impl Into<Effect>, channels: &[&str], share: f64) -> Finding {
    Finding {
        effect: effect.into(),
        channels: channels.iter().map(|name| (*name).to_owned()).collect(),
        clearest: 0,
        validated: Validation::Yes,
        share_percent: BTreeMap::from([(channels[0].to_owned(), share)]),
        minute_percent: BTreeMap::new(),
    }
}

fn line(frequency_hz: f64) -> SinusoidalLine {
    SinusoidalLine {
        frequency_hz: estimate(frequency_hz, 0.1),
        amplitude: estimate(0.27, 0.01).in_unit("deg/s"),
        multiples: None,
        evidence: LineEvidence { has_width: false, source: LineSource::Curve(CURVE) },
    }
}

fn departure(tau_s: BoundedEstimate, excess_percent: BoundedEstimate) -> Unexplained {
    Unexplained {
        place: UnexplainedPlace::AveragingTime(tau_s),
        excess_percent: Some(excess_percent),
        observation: Observation::PointOfCurve { p_value: 1e-9 },
    }
}

/// Lower bounds relative to N, B, K; an upper limit for K with 0.
fn limit(channel: &mut ChannelReport, low: [f64; 3]) {
    for (term, low) in channel.refitted.terms.iter_mut().zip(low) {
        term.term.low = term.term.low.min(low * term.term.value);
    }
}

fn report() -> Report {
    let mut report = fixture::report();
    report.part.name = "ADIS16405".to_owned();
    for channel in &mut report.channels {
        channel.at_rest = vec![Stretch { from_s: 0.0, to_s: 10_002.15 }];
        // B is wider than ±20 %, K has a limit.
        limit(channel, [1.0, 0.6, 0.0]);
    }
    let error = &mut report.channels[4].after.unseen;
    (error.worst_sigma, error.worst_tau_s, error.worst_ratio) = (Some(8.2), Some(81.92), Some(0.8));
    error.deviance_per_point = Some(33.1);
    let filter = OutputFilter {
        taps: BoundedEstimate::exact(8.0),
        decimation: estimate(8.95, 0.02),
        white_noise: estimate(0.05, 0.001).in_unit("deg/s"),
        stages: 2,
        internal_rate_hz: 819.2,
        evidence: CURVE,
    };
    report.findings = vec![
        finding(filter, &["gyro_x", "gyro_y", "gyro_z", "accl_x", "accl_y", "accl_z"], 12.0),
        finding(line(20.7), &["gyro_z", "accl_x"], 62.0),
        finding(departure(estimate(80.0, 1.0), estimate(9.0, 2.0)), &["gyro_z"], 9.0),
    ];
    report
}

fn plain(report: &Report, columns: usize) -> Vec<String> {
    let strip = |line: String| {
        let mut text = String::new();
        let mut is_style = false;
        for letter in line.chars() {
            match (letter, is_style) {
                ('\u{1b}', _) => is_style = true,
                ('m', true) => is_style = false,
                (_, true) => {}
                (letter, false) => text.push(letter),
            }
        }
        text
    };
    Screen { report, source: Some("run1.csv.gz"), columns }.lines().into_iter().map(strip).collect()
}

#[test]
fn the_screen_is_as_it_was_read() {
    for columns in [80, 120] {
        let screen = plain(&report(), columns).join("\n") + "\n";
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/screen/{columns}.txt"));
        match std::fs::read_to_string(&file) {
            Ok(expected) => assert_eq!(screen, expected, "{columns} columns"),
            Err(_) => {
                std::fs::write(&file, &screen).expect("the snapshot");
                panic!("{} was missing and is written: read it", file.display());
            }
        }
    }
}

#[test]
fn the_screen_keeps_to_its_lines_and_columns() {
    for columns in [10, 80, 97, 120, 200, 1000] {
        let mut crowded = report();
        for number in 0..60 {
            let channels = ["gyro_x", "gyro_z", "accl_y", "magn_x", "magn_y"];
            crowded.findings.push(finding(line(20.0 + f64::from(number)), &channels, 3.0));
        }
        for report in [report(), crowded, fixture::report(), fixture::empty()] {
            let lines = plain(&report, columns);
            assert!(lines.len() <= MOST_LINES, "{} lines at {columns}", lines.len());
            for line in &lines {
                assert!(line.chars().count() <= columns.clamp(80, 200), "{columns}: {line}");
            }
        }
    }
}

/// A vibration averages out within a minute, a slow drift does not.
#[test]
fn findings_are_in_the_order_of_what_they_cost_after_a_minute() {
    let mut report = report();
    let costs = |frequency_hz: f64, largest: f64, after_minute: f64| Finding {
        minute_percent: BTreeMap::from([("gyro_z".to_owned(), after_minute)]),
        ..finding(line(frequency_hz), &["gyro_z"], largest)
    };
    report.findings = vec![costs(20.0, 90.0, 0.1), costs(0.01, 40.0, 30.0), costs(30.0, 95.0, 0.1)];
    let (texts, _) = reports::summary::findings(&report);
    let weights: Vec<&str> = texts.iter().map(|text| text.weight.split(';').next().unwrap_or_default()).collect();
    assert_eq!(weights, ["up to 40 % of σ², 30 % around τ = 1 min", "up to 95 % of σ²", "up to 90 % of σ²"]);
}

#[test]
fn the_screen_has_one_value_of_a_coefficient() {
    let mut report = report();
    let term = &mut report.channels[0].refitted.terms[0].term;
    (term.value, term.low, term.high) = (0.05, 0.0495, 0.0505);
    let screen = plain(&report, 80).join("\n");
    // 0.05 deg/√s are 3 deg/√h.
    assert!(screen.contains("3.00 ± 0.03"), "{screen}");
}

#[test]
fn what_is_not_known_is_not_claimed() {
    let mut report = fixture::report();
    for channel in &mut report.channels {
        channel.at_rest.clear();
        channel.assessment.record.clear();
    }
    let screen = plain(&report, 80).join("\n");
    assert!(!screen.contains("rest throughout") && !screen.contains("For ±20 %"), "{screen}");
    report.channels[0].at_rest = vec![Stretch { from_s: 9418.5, to_s: 10018.9 }];
    let moved = "It moved for up to 2 h 37 min; for the longest part at rest, add --from 9418.5 --to 10018.9.";
    let sentences = reports::summary::record_sentences(&report);
    assert!(sentences.iter().any(|sentence| sentence == moved), "{sentences:#?}");
    assert_eq!(reports::summary::time_options(0.0, 51.13), "--from 0 --to 51.1");
}

#[test]
fn a_condition_has_moved_where_rounding_and_noise_do_not_explain_it() {
    let told = |adev: f64, mean: [f64; 4], n: f64| {
        let mut channel = fixture::channel("temp", "degC");
        channel.curve.iter_mut().for_each(|point| point.adev = adev);
        channel.refitted.terms.retain(|term| term.kind() == "angle_random_walk");
        let term = &mut channel.refitted.terms[0].term;
        (term.value, term.low, term.high) = (n, n, n);
        let time_s = vec![8.0, 24.0, 40.0, 56.0];
        let bias = BiasOverTime { block_s: 16.0, followed: Vec::new(), time_s, mean: mean.to_vec() };
        channel.figure_data.bias_over_time = Some(bias);
        let mut report = report();
        report.channels.push(channel);
        reports::summary::conditions(&report).remove(0)
    };
    let residue = [1.243e-14, 1.243e-14, 0.0, 1.243e-14];
    assert_eq!(told(0.0, residue, 0.0), "temperature did not change");
    assert_eq!(told(0.01, [0.0; 4], 0.01), "temperature did not change");
    // Means of 16 s scatter by 0.01 °C; the highest of four is above 3.02 of these in half a per cent.
    let half = 0.0302;
    assert_eq!(told(0.01, [0.0, 0.99 * half, -0.99 * half, 0.0], 0.04), "temperature constant within its noise");
    assert_eq!(told(0.01, [0.0, 1.01 * half, -1.01 * half, 0.0], 0.04), "temperature moved by 0.061 °C");
}

/// A magnetometer with this N, in gauss/√Hz, and deviance on the unseen half.
fn magnetometer(name: &str, [n, low, high]: [f64; 3], deviance: f64) -> ChannelReport {
    let mut channel = fixture::channel(name, "gauss");
    channel.refitted.terms.retain(|term| term.kind() == "angle_random_walk");
    let term = &mut channel.refitted.terms[0].term;
    (term.value, term.low, term.high) = (n, low, high);
    channel.after.unseen.deviance_per_point = Some(deviance);
    channel
}

#[test]
fn magnetometers_have_their_digits_and_a_prefix_and_those_whose_model_fails_have_no_noise() {
    let mut report = report();
    report.channels.extend([
        magnetometer("magn_x", [47.776e-6, 47.695e-6, 47.857e-6], 0.6),
        magnetometer("magn_y", [0.0, 0.0, 1.44e-6], 1.8),
        magnetometer("magn_z", [0.0, 0.0, 1.04e-6], 414.0),
    ]);
    let conditions = reports::summary::conditions(&report);
    // ±0.081 supports two decimals.
    assert!(conditions.contains(&"magn x y: N 47.78 ± 0.08, < 1.4 µgauss/√Hz".to_owned()), "{conditions:?}");
    assert!(conditions.contains(&"magn z: no noise model holds".to_owned()), "{conditions:?}");
}

#[test]
fn a_failing_model_is_held_beside_the_first_half_s_own_curve() {
    let answer = |own_curve: f64| {
        let mut report = report();
        let channel = &mut report.channels[4];
        channel.first_half_curve.deviance_per_point = Some(own_curve);
        reports::summary::record_sentences(&report).remove(0)
    };
    // The first half's own curve fails: the noise has changed.
    assert_eq!(answer(41.4), "This recording can be trusted in part: the noise changed in accel y.");
    // It holds: the model lacks something.
    assert_eq!(answer(1.71), "This recording can be trusted in part: the model lacks something in accel y.");
    let mut sound = report();
    sound.channels[4].after.unseen.deviance_per_point = Some(1.4);
    assert_eq!(reports::summary::record_sentences(&sound)[0], "This recording can be trusted.");
    sound.dropped.insert("gap".to_owned(), 20_000);
    for channel in &mut sound.channels {
        channel.at_rest = vec![Stretch { from_s: 0.0, to_s: 10_200.03 }];
    }
    let lost = "This recording can be trusted in part: 2.0 % of the samples are missing.";
    assert_eq!(reports::summary::record_sentences(&sound)[0], lost);
}

/// r of ln σ is a factor of exp(r).
#[test]
fn the_error_on_the_unseen_half_is_told_in_percent_of_sigma() {
    let mut report = report();
    for (channel, [before, after, halves]) in report.channels.iter_mut().zip([[69.315, 9.531, 4.879]; 6]) {
        channel.before.unseen.rms_percent = Some(before);
        channel.after.unseen.rms_percent = Some(after);
        channel.first_half_curve.rms_percent = Some(halves);
    }
    report.channels[1].after.unseen.rms_percent = Some(2.956);
    let sentence = "On the second half, which the model had not seen, σ is off by 3.0 to 10 % (the two halves differ by 5.0 %); without \
                    what was found in gyro z, by 100 %.";
    let sentences = reports::summary::record_sentences(&report);
    assert!(sentences.iter().any(|told| told == sentence), "{sentences:#?}");
    let tables = reports::summary::coefficient_tables(&report);
    assert_eq!(tables[0].rows[2].error, "100 → 10 %");
    // exp(6.4) is 600.
    report.channels[2].after.unseen.rms_percent = Some(640.0);
    report.channels[2].before.unseen.rms_percent = Some(700.0);
    assert_eq!(reports::summary::coefficient_tables(&report)[0].rows[2].error, "> 1,000 %");
}

/// The first half alone has shown an effect that the whole record does not have.
#[test]
fn a_channel_without_a_finding_has_one_error() {
    let mut report = report();
    report.findings.clear();
    for channel in &mut report.channels {
        channel.effects.clear();
        channel.before.unseen = ModelErrorReport { rms_percent: Some(14.842), ..channel.after.unseen.clone() };
        channel.before.unseen.deviance_per_point = Some(40.0);
        channel.after.unseen.rms_percent = Some(6.109);
    }
    let mut full = Vec::new();
    reports::full_tables::write(&report, None, &mut full).expect("a vector can be written");
    let page = reports::page::html(&report, None, None);
    for text in [plain(&report, 120).join(" "), String::from_utf8(full).expect("text"), page.replace('\u{a0}', " ")] {
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains("σ is off by 6.3 %"), "{text}");
        assert!(
            !["without what was found", "with what was found (", "→ 6.3"].iter().any(|told| text.contains(told)),
            "{text}"
        );
    }
    assert_eq!(reports::summary::coefficient_tables(&report)[0].rows[0].error, "6.3 %");
}

#[test]
fn the_errors_without_spikes_and_knocks_are_told_beside_those_as_recorded() {
    let mut report = report();
    assert!(reports::summary::record_sentences(&report).iter().all(|sentence| !sentence.contains("spikes")));
    let channel = &mut report.channels[2];
    for (model, [recorded, excluding]) in
        [(&mut channel.before, [69.315, 40.547]), (&mut channel.after, [9.531, 2.956])]
    {
        model.unseen.rms_percent = Some(recorded);
        let error = noise_analysis::report::ModelErrorReport {
            rms_percent: Some(excluding),
            deviance_per_point: Some(1.3),
            ..Default::default()
        };
        model.unseen_excluding = Some(error);
    }
    let sentences = reports::summary::record_sentences(&report);
    let told = "Without spikes and knocks σ is off by: gyro z 50 → 3.0 %.";
    assert!(sentences.iter().any(|sentence| sentence == told), "{sentences:#?}");
    let sentences = reports::summary::record_sentences_in_short(&report);
    assert!(sentences.iter().all(|sentence| !sentence.contains("spikes")), "{sentences:#?}");
    // Spikes and knocks alone are no sign of other noise.
    report.channels[2].after.unseen.deviance_per_point = Some(193.0);
    let answer = reports::summary::record_sentences(&report).remove(0);
    assert!(answer.contains(": spikes or knocks came oftener or larger than before in gyro z; "), "{answer}");
}

#[test]
fn departures_at_one_place_are_told_together() {
    let mut report = report();
    let in_channel = |channel: &str, percent: f64| {
        finding(departure(estimate(0.0012, 0.0), estimate(percent, 0.1)), &[channel], 0.0)
    };
    report.findings = vec![in_channel("gyro_x", -3.6), in_channel("gyro_y", -2.1), in_channel("gyro_z", -2.1)];
    let told = reports::summary::unexplained(&report);
    assert_eq!(told, ["gyros: σ is 2.1 to 3.6 % below the model around τ = 1.2 ms"]);
    report.findings[2] = in_channel("gyro_z", 2.1);
    let told = reports::summary::unexplained(&report);
    assert_eq!(told[1..], ["gyro z: σ is 2.1 % above the model around τ = 1.2 ms"]);
    report.findings = vec![in_channel("gyro_x", -3.6), in_channel("gyro_x", -3.7)];
    assert_eq!(reports::summary::unexplained(&report).len(), 1);
}

fn every_note() -> Vec<PartNote> {
    let sample_rate_hz = BoundedEstimate { value: 90.8, low: 90.7, high: 90.9 };
    vec![
        PartNote::NotSought,
        PartNote::CountsTooCoarse,
        PartNote::NotCorrelated { period_s: 0.01 },
        PartNote::Minority(vec!["accl_x"]),
        PartNote::Minority(vec!["gyro_x", "gyro_z"]),
        PartNote::Minority(Vec::new()),
        PartNote::StatedClock { sample_rate_hz: 819.2 },
        PartNote::NoTimeStamps { nominal_hz: 819.2, sample_rate_hz, stated_hz: 100.0 },
        PartNote::LengthAlone { length: 1.774, taps: 8, other_taps: vec![4, 16], nominal_hz: 819.2 },
        PartNote::Contradicted { channel: "gyro_z", decimation: 8.873 },
        PartNote::NotInAll { showing: 5, able: 6 },
    ]
}

#[test]
fn what_the_record_does_not_tell_of_the_part_is_told_in_sentences() {
    let mut noted = report();
    noted.part.notes = every_note();
    let told = reports::summary::part_notes(&noted);
    let last = [
        "Without time stamps the sample rate is the stated 100 Hz; by the part's nominal clock of 819.2 Hz it would be \
         90.80 ± 0.10 Hz. Every τ and N scale with it.",
        "The spectra give the length of the filter, 1.77 samples, and not its taps. 8 taps are nearest to the nominal clock of 819.2 Hz; \
         4 or 16 taps at another clock have the same length.",
        "Gyro z alone would have its filter read every 8.873 values, farther from the common figure than chance explains.",
        "The filter shows in 5 of the 6 channels whose noise is larger than a count.",
    ];
    assert_eq!(told[told.len() - 4..], last);
    for (at, named) in [(2, "accel x is"), (3, "gyro x and gyro z are")] {
        let expected = format!(
            "Only {named} correlated as behind a low-pass filter; most channels are not, so it is not the part's own filter."
        );
        assert_eq!(told[at], expected);
    }
    assert!(told.iter().all(|text| text.ends_with('.') && !text.contains('_') && !text.contains("  ")), "{told:#?}");
}

/// Lower bounds of N, B and K relative to their values, and the missing hours.
fn of_two_gyros(low: [[f64; 3]; 2], hours: [[Option<f64>; 3]; 2]) -> Report {
    let mut report = fixture::report();
    report.channels.retain(|channel| ["gyro_x", "gyro_y"].contains(&channel.name.as_str()));
    for ((channel, low), hours) in report.channels.iter_mut().zip(low).zip(hours) {
        let kinds = ["angle_random_walk", "bias_instability", "rate_random_walk"];
        let record =
            |(kind, more_hours): (&str, Option<f64>)| RecordLength { kind: kind.to_owned(), half_s: None, more_hours };
        channel.assessment.record = kinds.into_iter().zip(hours).map(record).collect();
        limit(channel, low);
    }
    report
}

/// The bounds of the table count.
#[test]
fn the_length_of_a_record_is_told_by_what_it_is_good_for() {
    let (narrow, wide, none) = (1.0, 0.6, 0.0);
    let enough = [Some(0.0); 3];
    for (low, hours, sentences) in [
        ([[narrow; 3]; 2], [enough; 2], "N, B and K are known to ±20 %."),
        (
            [[narrow, wide, wide], [narrow, narrow, wide]],
            [[Some(0.0), Some(0.4), Some(12.0)], [Some(0.0), Some(0.0), Some(3.0)]],
            "N is known to ±20 %. B is known to ±20 % except in gyro x. For ±20 %, B needs 24 min more and K needs 12 h more.",
        ),
        (
            [[wide, narrow, narrow], [narrow; 3]],
            [enough; 2],
            "B and K are known to ±20 %. N is known to ±20 % except in gyro x.",
        ),
        (
            [[narrow, none, none], [narrow, none, wide]],
            [[Some(0.0), None, None], [Some(0.0), None, Some(2.0)]],
            "N is known to ±20 %. For ±20 %, K needs 2.0 h more. The record gives only an upper limit for B and for K in gyro x.",
        ),
        (
            [[narrow, wide, none]; 2],
            [[Some(0.0), Some(100.0), None]; 2],
            "N is known to ±20 %. For ±20 %, B needs a much longer record. The record gives only an upper limit for K.",
        ),
    ] {
        let told = reports::summary::record_sentences(&of_two_gyros(low, hours)).join(" ");
        assert!(told.contains(sentences), "{sentences}: {told}");
    }
}

#[test]
fn a_record_too_short_for_a_model_says_what_it_is_good_for() {
    let short = |low: [[f64; 3]; 2]| {
        let mut report = of_two_gyros(low, [[Some(0.1), None, None]; 2]);
        report.samples = 500;
        report.dropped.clear();
        report.part.notes = vec![PartNote::NotCorrelated { period_s: 0.01 }];
        report
    };
    let told = |report: &Report| reports::summary::record_sentences_in_short(report).join(" ");
    let rough = short([[0.6, 0.0, 0.0], [1.0, 0.0, 0.0]]);
    let sentences = told(&rough);
    assert!(
        sentences.starts_with(
            "This recording can be trusted in part: it is short. No sample lost. \
             5.0 s: good for a rough N (±40 %) and for strong lines; not for B, K or a filter. On the second half, "
        ),
        "{sentences}"
    );
    let in_one = told(&short([[1.0, 0.0, 0.0], [0.0; 3]]));
    assert!(
        in_one.contains(
            "a rough N (±7 %) except in gyro y and for strong lines; not for B, K or a filter. On the second"
        ),
        "{in_one}"
    );
    assert!(told(&short([[0.0; 3]; 2])).contains(" lost. 5.0 s: too short for N, B, K and a filter. On the second"));
    assert!(reports::summary::nothing_found(&rough).contains("strong effects only"));
    let mut contradicted = rough.clone();
    let error = &mut contradicted.channels[0].after.unseen;
    (error.worst_sigma, error.worst_tau_s, error.worst_ratio) = (Some(46.0), Some(0.01), Some(1.3));
    assert!(reports::summary::nothing_found(&contradicted).contains("N, B and K do not describe"));
    assert!(plain(&rough, 80).join(" ").contains("For a filter: record at rest for hours."));
}

#[test]
fn rest_and_losses_are_told_as_they_are() {
    let exact = BoundedEstimate::exact;
    let sentences = |report: &Report| reports::summary::record_sentences(report)[..3].join(" ");
    let mut knocked = report();
    let knock = NoisyInterval {
        from_s: exact(7.0),
        to_s: exact(9.0),
        level: exact(3.0),
        tau_s: 1.0,
        p_value: 1e-9,
        channels: vec!["gyro_x"],
    };
    knocked.findings = vec![finding(knock, &["gyro_x"], 0.0)];
    assert!(sentences(&knocked).contains(". At rest but for a knock. "), "{}", sentences(&knocked));
    let mut moved = report();
    let motion = MotionInterval {
        from_s: exact(900.0),
        to_s: exact(903.0),
        size: exact(40.0).in_unit("deg/s"),
        scale: MotionScale::BiasError(3.0),
        stretches: 1,
        moved_s: 3,
    };
    moved.findings = vec![finding(motion, &["gyro_x"], 0.0)];
    for channel in &mut moved.channels {
        channel.at_rest = vec![Stretch { from_s: 0.0, to_s: 900.0 }, Stretch { from_s: 903.0, to_s: 10_002.15 }];
    }
    moved.dropped = [("gap", 212), ("repeated", 212)].map(|(cause, samples)| (cause.to_owned(), samples)).into();
    assert_eq!(
        sentences(&moved),
        "This recording cannot be trusted as it is. It moved for up to 3.0 s; for the longest part at rest, add --from 903 --to 10002.1. 212 samples (0.021 %) are missing: the one \
         before was read again instead."
    );
}

#[test]
fn the_screen_tells_of_the_part_in_short_what_bears_on_the_numbers() {
    let mut noted = fixture::report();
    noted.part.notes = every_note();
    let told = reports::summary::record_sentences_in_short(&noted);
    for sentence in [
        "The noise is smaller than a count, which hides the part's filter.",
        "No low-pass filter found: consecutive samples are uncorrelated, so N is valid from one sample on.",
        "Without time stamps the sample rate is the stated one. Every τ and N scale with it.",
    ] {
        assert!(told.iter().any(|told| told == sentence), "{sentence}: {told:#?}");
    }
}

#[test]
fn what_the_data_contradicts_is_told_in_sentences() {
    let mut contradicted = report();
    let error = &mut contradicted.channels[3].after.unseen;
    (error.worst_sigma, error.worst_tau_s, error.worst_ratio) = (Some(50.0), Some(8.0), Some(0.5));
    // Twice the expected variance.
    let innovations =
        Innovations { count: 1000, normalised: 2.0, low: 0.9, high: 1.1, correlation: 0.0, whiteness_p: 0.5 };
    contradicted.channels[5].assessment.innovations = Some(innovations.clone());
    assert_eq!(
        reports::summary::contradictions(&contradicted),
        [
            "accel x at τ = 8.0 s: σ is 2.0 times the model (50 standard errors)",
            "accel y at τ = 82 s: σ is 25 % above the model (8.2 standard errors)",
            "a Kalman filter with the models of accel z claims a smaller error than it has",
        ]
    );
    // In one line the place that is farthest off, or a sentence that fits.
    let told =
        |report: &Report| plain(report, 80).into_iter().find(|line| line.starts_with("Model is off")).expect("a line");
    let error = &mut contradicted.channels[3].after.unseen;
    error.worst_ratio = Some(0.99);
    assert_eq!(told(&contradicted), "Model is off     3 places; accel y at τ = 82 s: σ is 25 % above the model.");
    for channel in &mut contradicted.channels {
        channel.after.unseen.worst_sigma = None;
        channel.assessment.innovations = Some(innovations.clone());
    }
    assert_eq!(told(&contradicted), "Model is off     a Kalman filter of 6 channels claims too small an error.");
}

/// Long blocks: each finding has a line or is counted.
#[test]
fn every_finding_of_a_full_screen_has_a_line_or_is_counted() {
    let mut crowded = report();
    for number in 0..9 {
        crowded.findings.push(finding(line(20.0 + f64::from(number)), &["accl_x", "accl_y"], 3.0));
        let tau_s = estimate(f64::from(number + 1), 0.0);
        crowded.findings.push(finding(departure(tau_s, estimate(9.0, 2.0)), &["gyro_x", "accl_y"], 0.0));
    }
    crowded.part.notes = every_note();
    for (index, channel) in crowded.channels.iter_mut().enumerate() {
        let error = &mut channel.after.unseen;
        (error.worst_sigma, error.worst_tau_s, error.worst_ratio) = (Some(8.2), Some(81.92), Some(0.8));
        (error.deviance_per_point, channel.before.unseen.deviance_per_point) = (Some(5.6e6), Some(5.6e6));
        channel.first_half_curve.deviance_per_point = Some(if index % 2 == 0 { 41.4 } else { 1.7 });
    }
    for columns in [80, 120] {
        let screen = plain(&crowded, columns);
        assert!(screen.len() <= MOST_LINES, "{screen:#?}");
        assert!(screen.iter().all(|line| line.chars().count() <= columns), "{screen:#?}");
        let shown =
            (1..=11).take_while(|number| screen.iter().any(|line| line.starts_with(&format!("{number:>2}  ")))).count();
        let counted = format!(" … and {} more: --full", 11 - shown);
        assert!(shown >= 4 && (shown == 11 || screen.contains(&counted)), "{shown} findings: {screen:#?}");
        assert!(screen.last().is_some_and(|line| line.ends_with('.')), "{screen:#?}");
        for line in ["Not explained    10 places; ", "Model is off     6 places; "] {
            assert_eq!(screen.iter().filter(|of| of.starts_with(line)).count(), 1, "{line}: {screen:#?}");
        }
        assert!(screen.join(" ").contains("a motor or the mains (1, 3, 4"), "{screen:#?}");
    }
}

#[test]
fn a_long_name_is_cut_at_its_beginning() {
    let source = "2026-11-27-a-folder-with-a-long-name/recording-of-the-first-sensor.csv.gz";
    let report = report();
    let headline = Screen { report: &report, source: Some(source), columns: 80 }.lines().remove(0);
    assert!(headline.contains("…") && headline.contains("sensor.csv.gz   1,000,000 samples"), "{headline}");
}
