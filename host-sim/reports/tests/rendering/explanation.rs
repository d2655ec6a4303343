//! Changes of the noise in the long form and on the page.

use crate::fixture::report;
use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::effects::{Effect, LineEvidence, LineSource, ResonantLine, SpectrumEvidence};
use noise_analysis::nonstationarity::{
    Baselines, EpochParameters, FittedPart, IntervalCoverage, RelatedLine, Stationarity, TrackedSet, TrackingErrors,
};
use noise_analysis::report::{
    CommonModeRegression, EventsReport, Finding, Nonstationarity, Parameter, Report, Validation,
};
use reports::{full_tables, summary};

fn text(report: &Report) -> String {
    let mut out = Vec::new();
    full_tables::write(report, None, &mut out).expect("a vector can be written");
    let text = String::from_utf8(out).expect("text");
    assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn changes() -> Nonstationarity {
    let epoch = |at: usize| EpochParameters {
        from_s: 300.0 * at as f64,
        white_noise_ratio: [0.81, 1.0, 1.043][at],
        white_noise_error: 0.009,
        line_hz: Some([21.87, 20.34, 19.66][at]),
        line_error_hz: Some(0.12),
    };
    Nonstationarity {
        quarters: Some(Stationarity { tau_s: 0.08, variance_ratio: 1.071, p_value: 1e-12 }),
        fitted_to: FittedPart::LaterQuarter,
        tracked: TrackedSet::LevelAndLine,
        epoch_s: 327.68,
        epochs: (0..3).map(epoch).collect(),
        beyond_drift: 4.3,
        tracking: TrackingErrors { pooled: 5.7, one_step: 1.67, one_step_static: 2.92 },
        baselines: Baselines { baseline_tracked: 3655.0, persistence: 1.74 },
        intervals: IntervalCoverage { octaves: 150, within: 144 },
        related_line: Some(RelatedLine {
            channel: "accl_x".to_owned(),
            ratio: (1, 2),
            correlation: 0.962,
            p_value: 1e-6,
            measured_ratio: 1.9934,
            measured_ratio_deviation: 0.0054,
            line_hz: vec![21.87, 20.34],
            related_fitted_hz: vec![10.92, 10.24],
            related_unseen_hz: vec![9.94, 9.82],
            unseen: 3.89,
        }),
    }
}

fn followed() -> Report {
    let mut report = report();
    report.channels[2].nonstationarity = Some(changes());
    report.common_mode = Some(CommonModeRegression {
        channels: vec!["gyro_z".to_owned(), "accl_x".to_owned()],
        weights_tau_s: 40.96,
        trusted: vec![true, false],
        shares: vec![noise_analysis::nonstationarity::OctaveShares {
            tau_s: 40.96,
            edf: 100.0,
            share: vec![0.17, 0.77],
        }],
        gains: vec![noise_analysis::nonstationarity::HoldOutGain { tau_s: 40.96, ratio: vec![0.91, 1.54] }],
    });
    report
}

#[test]
fn the_long_form_tells_every_figure_of_the_course() {
    let report = followed();
    let text = text(&report);
    // 100·(exp(0.04112) − 1).
    for told in [
        "The curve of the first half itself is off by 4.2 %: a model of stationary noise",
        "at τ = 80 ms: by +7.1 %; chance explains it once in",
        "fitted to the later quarter",
        "between 19.66 and 21.87 Hz",
        "between −19 % and +4.3 %",
        "leaves 1.7 a point on a single stretch of the second half, against 2.9 as it stands",
        "Of 150 octaves of these stretches 144 (96.0 %)",
        "1/2 of its frequency",
        "1.9934 ± 0.0054",
        "leaves 3.9; this uses the second half of accel x, and not that of gyro z",
        "gyro z 17 %, accel x 77 %",
        "gyro z 0.91, accel x 1.54",
        "In accel x the weights of the first quarter did not make the second quarter better",
    ] {
        assert!(text.contains(told), "{told:?} is not in\n{text}");
    }
}

#[test]
fn each_course_of_a_record_has_its_sentence() {
    let told = |change: &dyn Fn(&mut Nonstationarity), sentence: &str| {
        let mut report = followed();
        report.channels[2].nonstationarity.iter_mut().for_each(change);
        let text = text(&report);
        assert!(text.contains(sentence), "{sentence:?} is not in\n{text}");
    };
    told(&|of| of.quarters = None, "The first half is too short to compare its two quarters.");
    told(&|of| of.fitted_to = FittedPart::FirstHalf, "The model is fitted to the whole first half.");
    told(
        &|of| of.tracked = TrackedSet::Nothing,
        "No parameter of the first half moves: from one stretch of 5 min to the next the variance of the white noise lies between",
    );
    told(
        &|of| of.tracked = TrackedSet::Nothing,
        "With nothing to follow, the model leaves 1.7 a point on a single stretch",
    );
    told(&|of| of.tracked = TrackedSet::Level, "The white noise of the first half moves: from one stretch");
    told(
        &|of| of.tracked = TrackedSet::Level,
        "With the white noise followed, each stretch predicted from those before it, the model leaves 1.7",
    );
    told(
        &|of| of.related_line.iter_mut().for_each(|line| line.ratio = (1, 1)),
        "in accel x too, at the same frequency:",
    );
    let with_chance = |p_value: f64, sentence: &str| {
        told(&|of| of.quarters.iter_mut().for_each(|quarters| quarters.p_value = p_value), sentence);
    };
    with_chance(0.8, "by +7.1 %; chance explains it.");
    with_chance(1.0 / 3000.0, "by +7.1 %; chance explains it once in 3,000 times.");
    with_chance(1e-16, "by +7.1 %; chance does not explain it.");
}

#[test]
fn spikes_and_knocks_are_told_with_their_rate_and_the_errors_without_them() {
    let mut report = followed();
    let channel = &mut report.channels[2];
    channel.before.unseen_excluding = Some(channel.before.unseen.clone());
    channel.after.unseen_excluding = Some(channel.after.unseen.clone());
    let rate_per_hour = Parameter { value: 34.0, low: 23.0, high: 46.0, unit: "1/h".to_owned() };
    channel.after.events = Some(EventsReport { count: 17, rate_per_hour, scatter_percent: 35.0, adev: Vec::new() });
    let text = text(&report);
    for told in [
        "with 34 spikes and knocks an hour [23, 46], as the first half has them). The curve",
        "Without the spikes and knocks of both halves 24 % become 4.0 %.",
    ] {
        assert!(text.contains(told), "{told:?} is not in\n{text}");
    }
}

#[test]
fn every_report_tells_how_the_noise_changes() {
    let mut report = report();
    report.channels[2].nonstationarity = Some(changes());
    let line = |frequency_hz: f64| Finding {
        effect: Effect::from(ResonantLine {
            frequency_hz: BoundedEstimate::new(frequency_hz, frequency_hz - 0.1, frequency_hz + 0.1),
            bandwidth_hz: BoundedEstimate::exact(0.5),
            deviation: BoundedEstimate::exact(0.1).in_unit("deg/s"),
            multiples: None,
            evidence: LineEvidence {
                has_width: true,
                source: LineSource::Spectrum(SpectrumEvidence {
                    is_at_half_rate: false,
                    frequency_hz,
                    width_hz: Some(0.5),
                    sigmas: 9.0,
                    p_value: 1e-9,
                }),
            },
        }),
        channels: vec!["gyro_z".to_owned()],
        clearest: 0,
        validated: Validation::Yes,
        share_percent: Default::default(),
        minute_percent: Default::default(),
    };
    // The followed line is at 21.1 Hz.
    report.findings = vec![line(20.7), line(40.0)];
    let (found, _) = summary::findings(&report);
    assert!(
        found[0].weight.ends_with("; a line of accel x moves with it, at 1/2 of the frequency"),
        "{}",
        found[0].weight
    );
    assert!(!found[1].weight.contains("accel x"), "{}", found[1].weight);
    let quarter =
        "Because the noise changed, the model of gyro z was fitted to the last quarter before the second half alone.";
    assert!(summary::record_sentences(&report).contains(&quarter.to_owned()));

    let mut out = Vec::new();
    reports::full_tables::write(&report, None, &mut out).expect("a vector can be written");
    let full = String::from_utf8(out).expect("text").split_whitespace().collect::<Vec<_>>().join(" ");
    let page = reports::page::html(&report, None, None);
    for told in [
        "fitted to the later quarter",
        "with the line where accel x has it in the second half, the model leaves 3.9; this uses the second half of accel x",
        "1.711",
    ] {
        for (form, text) in [("--full", full.to_lowercase()), ("page", page.to_lowercase())] {
            assert!(text.contains(&told.to_lowercase()), "{form} lacks {told:?}");
        }
    }
}
