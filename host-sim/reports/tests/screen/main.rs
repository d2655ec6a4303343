//! The screen of a report whose numbers are known, against the files beside this one. After a change that is meant, delete the file,
//! run the test, and read what it wrote.

#[path = "../rendering/fixture.rs"]
#[allow(dead_code)]
mod fixture;
#[path = "../rendering/phrases.rs"]
mod phrases;

use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::effects::{
    CurveEvidence, Effect, LineEvidence, LineSource, Observation, OutputFilter, SinusoidalLine, Unexplained,
    UnexplainedPlace,
};
use noise_analysis::report::assessment::RecordLength;
use noise_analysis::report::{Finding, PartNote, Report, Stretch, Validation};
use phrases::{documentation, phrases};
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

fn report() -> Report {
    let mut report = fixture::report();
    report.part.name = "ADIS16405".to_owned();
    for channel in &mut report.channels {
        channel.at_rest = vec![Stretch { from_s: 0.0, to_s: 10_002.15 }];
    }
    // Beyond chance: the screen has to say so.
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

/// The screen without its styles.
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

#[test]
fn the_screen_has_one_value_of_a_coefficient() {
    // `final` counts, not `before`, `after` or the slopes.
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
    let moved =
        "It moved: at rest for 10 min of 2 h 47 min, the longest time from 9419 s to 10018 s: --from 9419 --to 10018.";
    let sentences = reports::summary::record_sentences(&report);
    assert!(sentences.iter().any(|sentence| sentence == moved), "{sentences:#?}");
}

/// A magnetometer with this N, in gauss/√Hz, and deviance on the unseen half.
fn magnetometer(name: &str, [n, low, high]: [f64; 3], deviance: f64) -> noise_analysis::report::ChannelReport {
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
    assert!(conditions.contains(&"magn x y N 47.78 ± 0.08, < 1.4 µgauss/√Hz".to_owned()), "{conditions:?}");
    assert!(conditions.contains(&"the noise of magn z is not that of N, B and K".to_owned()), "{conditions:?}");
}

#[test]
fn a_failing_model_is_held_beside_the_first_half_s_own_curve() {
    let warnings = |own_curve: f64| {
        let mut report = report();
        let channel = &mut report.channels[4];
        channel.first_half_curve.deviance_per_point = Some(own_curve);
        let steps = reports::summary::next_steps(&report);
        steps.into_iter().filter(|step| step.starts_with('!')).collect::<Vec<_>>()
    };
    // The curve of the first half fails as well: nothing that the first half shows holds in the second.
    assert_eq!(
        warnings(41.4),
        [
            "! The model of accel y fails on the unseen half, and so does the first half's own curve (41): the noise has changed."
        ]
    );
    // It holds, so the model is what is wrong.
    assert_eq!(
        warnings(1.71),
        [
            "! The model of accel y fails on the unseen half: its error is far above 1. The first half's own curve holds (1.7): \
          the model lacks something."
        ]
    );
}

/// The pair of the table is that of the data as recorded, as in the JSON; the pair without spikes and knocks has its own sentence.
#[test]
fn the_errors_without_spikes_and_knocks_are_told_beside_those_as_recorded() {
    let mut report = report();
    assert!(reports::summary::record_sentences(&report).iter().all(|sentence| !sentence.contains("spikes")));
    let channel = &mut report.channels[0];
    for (model, [recorded, excluding]) in [(&mut channel.before, [193.0, 104.0]), (&mut channel.after, [2.4, 1.3])] {
        model.unseen.deviance_per_point = Some(recorded);
        let error =
            noise_analysis::report::ModelErrorReport { deviance_per_point: Some(excluding), ..Default::default() };
        model.unseen_excluding = Some(error);
    }
    let tables = reports::summary::coefficient_tables(&report);
    assert_eq!(tables[0].rows[0].error, "193 → 2.4");
    let sentences = reports::summary::record_sentences(&report);
    let told = "The errors are on the data as recorded; the models after foretell its spikes and knocks at the rate of the first half. \
                Without them: gyro x 104 → 1.3.";
    assert!(sentences.iter().any(|sentence| sentence == told), "{sentences:#?}");
}

#[test]
fn departures_at_one_place_are_told_together() {
    let mut report = report();
    let in_channel = |channel: &str, percent: f64| {
        finding(departure(estimate(0.0012, 0.0), estimate(percent, 0.1)), &[channel], 0.0)
    };
    report.findings = vec![in_channel("gyro_x", -3.6), in_channel("gyro_y", -2.1), in_channel("gyro_z", -2.1)];
    let told = reports::summary::unexplained(&report).expect("a text");
    assert_eq!(told, "gyros: −2.1 … −3.6 % at averaging times around 1.2 ms");
    // Above and below the model are two departures.
    report.findings[2] = in_channel("gyro_z", 2.1);
    let told = reports::summary::unexplained(&report).expect("a text");
    assert!(told.ends_with("; gyro z: +2.1 % at averaging times around 1.2 ms"), "{told}");
}

/// What a record may not tell of the part's clock and filter.
fn every_note() -> Vec<PartNote> {
    let sample_rate_hz = BoundedEstimate { value: 90.8, low: 90.7, high: 90.9 };
    vec![
        PartNote::NotSought,
        PartNote::CountsTooCoarse,
        PartNote::NotCorrelated { period_s: 0.01 },
        PartNote::Minority(vec!["accl_x"]),
        PartNote::Minority(Vec::new()),
        PartNote::StatedClock { sample_rate_hz: 819.2 },
        PartNote::NoTimeStamps { nominal_hz: 819.2, sample_rate_hz, stated_hz: 100.0 },
        PartNote::LengthAlone { length: 1.774, taps: 8, other_taps: vec![4, 16], nominal_hz: 819.2 },
        PartNote::Contradicted { channel: "gyro_z", decimation: 8.873 },
        PartNote::NotInAll { showing: 5, able: 6 },
    ]
}

/// Each is one or two plain sentences on the page, without the names of the JSON.
#[test]
fn what_the_record_does_not_tell_of_the_part_is_told_in_sentences() {
    let mut noted = report();
    noted.part.notes = every_note();
    let told = reports::summary::part_notes(&noted);
    let last = [
        "Without time stamps the part's clock is not measured. At its nominal 819.2 Hz the sample rate would be 90.80 ± 0.10 Hz; 100 Hz \
         was stated.",
        "The curves give the length of the filter, 1.77 samples, and not its taps. 8 taps are nearest to the nominal clock of 819.2 Hz; \
         4 or 16 taps at another clock have the same length.",
        "Gyro z alone would have its filter read every 8.873 values, farther from the common figure than chance explains.",
        "The filter shows in 5 of the 6 channels whose noise is larger than a count.",
    ];
    assert_eq!(told[told.len() - 4..], last);
    assert_eq!(
        told[3],
        "Accel x alone is correlated as behind a low-pass filter. Most channels are not, so that it is none of the part."
    );
    assert!(told.iter().all(|text| text.ends_with('.') && !text.contains('_') && !text.contains("  ")), "{told:#?}");
}

/// The cases of recorded files: enough for all, for some, for none, and coefficients that do not show.
#[test]
fn the_length_of_a_record_is_told_by_what_it_is_good_for() {
    let told = |hours: [[Option<f64>; 3]; 2]| {
        let mut report = report();
        report.channels.retain(|channel| ["gyro_x", "gyro_y"].contains(&channel.name.as_str()));
        for (channel, hours) in report.channels.iter_mut().zip(hours) {
            let kinds = ["angle_random_walk", "bias_instability", "rate_random_walk"];
            let record = |(kind, more_hours): (&str, Option<f64>)| RecordLength {
                kind: kind.to_owned(),
                half_s: None,
                more_hours,
            };
            channel.assessment.record = kinds.into_iter().zip(hours).map(record).collect();
        }
        reports::summary::record_sentences(&report).join(" ")
    };
    let enough = Some(0.0);
    for (hours, sentences) in [
        ([[enough; 3]; 2], "N, B and K are known to ±20 %."),
        (
            [[enough, Some(0.4), Some(12.0)], [enough, enough, Some(3.0)]],
            "N is known to ±20 %. For ±20 %, B takes 24 min more and K 12 h more.",
        ),
        (
            [[enough, None, None], [enough, None, Some(2.0)]],
            "N is known to ±20 %. For ±20 %, K takes 2.0 h more. B does not show: the record bounds it from above. K does not show in \
             gyro x.",
        ),
        (
            [[Some(0.1); 3]; 2],
            "Too short for ±20 % of any coefficient. For ±20 %, N takes 6 min more, B 6 min more and K 6 min more.",
        ),
        ([[enough, None, None]; 2], "N is known to ±20 %. B and K do not show: the record bounds them from above."),
    ] {
        assert!(told(hours).contains(sentences), "{sentences}: {}", told(hours));
    }
}

#[test]
fn the_documentation_explains_every_sentence_about_the_record() {
    let page = documentation();
    let mut moved = report();
    moved.part.notes = every_note();
    moved.channels[0].at_rest = vec![Stretch { from_s: 0.0, to_s: 600.0 }];
    moved.dropped.clear();
    let mut changed = report();
    changed.channels[4].first_half_curve.deviance_per_point = Some(41.4);
    changed.channels.push(magnetometer("magn_x", [47.776e-6, 47.695e-6, 47.857e-6], 0.6));
    changed.channels.push(magnetometer("magn_y", [0.0, 0.0, 1.44e-6], 414.0));
    let mut checked = 0;
    for report in [report(), moved, changed, fixture::report(), fixture::empty()] {
        let sentences = [
            reports::summary::record_sentences_in_short(&report),
            reports::summary::contradictions(&report),
            reports::summary::conditions(&report),
            // The advice is that of the findings, which has a test of its own.
            reports::summary::next_steps(&report).into_iter().filter(|step| step.starts_with(['!', 'F'])).collect(),
        ];
        for phrase in sentences.iter().flatten().flat_map(|sentence| phrases(sentence)) {
            checked += 1;
            assert!(page.contains(&phrase), "docs/findings.md lacks \"{phrase}\"");
        }
    }
    assert!(checked > 12, "{checked} phrases");
}

#[test]
fn every_finding_of_a_full_screen_has_a_line() {
    let mut crowded = report();
    for number in 0..9 {
        crowded.findings.push(finding(line(20.0 + f64::from(number)), &["accl_x", "accl_y"], 3.0));
    }
    crowded.part.notes = every_note();
    let screen = plain(&crowded, 80);
    assert!(screen.len() <= MOST_LINES);
    for number in 1..=11 {
        assert!(screen.iter().any(|line| line.starts_with(&format!("{number:>2}  "))), "{number}: {screen:#?}");
    }
    // A warning begins a line.
    assert!(screen.iter().all(|line| !line.trim_start().contains(" ! The")), "{screen:#?}");
}
