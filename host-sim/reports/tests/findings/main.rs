//! Each channel of a finding has its own number.

use crate::fixture;
use allan_core::NoiseTerm;
use noise_analysis::bounds::{BoundedEstimate, ChannelEstimate};
use noise_analysis::effects::*;
use noise_analysis::report::{BiasOverTime, ChannelEffect, ChannelReport, Finding, Report, Validation};
use reports::json::ReportJson;
use reports::rounding::significant;
use reports::rows::ReportRow;
use std::collections::BTreeMap;

const GYROS: [&str; 3] = ["gyro_x", "gyro_y", "gyro_z"];
/// The largest in the last one.
const SIZES: [f64; 3] = [21.2, 11.9, -27.8];
/// Half of the interval, relative to the size.
const HALF_WIDTH: f64 = 0.02;

fn about(value: f64) -> BoundedEstimate {
    let half = HALF_WIDTH * value.abs();
    BoundedEstimate::new(value, value - half, value + half)
}

fn rate(value: f64) -> ChannelEstimate {
    about(value).in_unit("deg/s")
}

/// Kinds that may be negative.
fn signed_kinds() -> Vec<fn(f64) -> Effect> {
    vec![
        |size| TemperatureSensitivity { sensitivity: rate(1e-3 * size), sigmas: 9.0 }.into(),
        |size| SupplySensitivity { sensitivity: rate(1e-3 * size), sigmas: 9.0 }.into(),
        |size| {
            let (sensitivity, curvature) = (rate(1e-3 * size), rate(1e-6 * size));
            let response = ResponseVariance::default();
            TemperatureCurvature { sensitivity, curvature, reference_degc: 30.0, p_value: 1e-9, response }.into()
        },
        |size| {
            let response = ResponseVariance::default();
            TurnOnTransient { size: rate(1e-3 * size), time_constant_s: about(40.0), p_value: 1e-9, response }.into()
        },
        |size| {
            let response = ResponseVariance::default();
            ThermalLag { sensitivity: rate(1e-3 * size), time_constant_s: about(200.0), p_value: 1e-9, response }.into()
        },
        |size| AccelerationSensitivity { sensitivity: [Some(rate(1e-3 * size)), None, None], sigmas: 9.0 }.into(),
        |size| {
            let (per, accelerometer, response) = ("g", "accl_x", ResponseVariance::default());
            let sensitivity = rate(1e-3 * size);
            VibrationRectification { sensitivity, per, accelerometer, strongest: 0.1, p_value: 1e-9, response }.into()
        },
        |size| LevelStep { time_s: BoundedEstimate::exact(740.0), size: rate(1e-3 * size), p_value: 1e-9 }.into(),
        |size| {
            let ratio = rate(1e-3 * size);
            SharedDrift { ratio, per: "g", with: "accl_x", sigmas: 9.0, largest_multiple: 10.0 }.into()
        },
        |size| {
            LinearDrift { slope: rate(1e-3 * size), evidence: LinearDriftEvidence::Regression { p_value: 1e-9 } }.into()
        },
    ]
}

fn other_kinds() -> Vec<fn(f64) -> Effect> {
    fn line() -> LineEvidence {
        let curve = CurveEvidence { excess: 0.1, tau_s: 1.0, sigmas: 9.0, gain_sigmas: 9.0 };
        LineEvidence { has_width: false, source: LineSource::Curve(curve) }
    }
    vec![
        |size| {
            let (frequency_hz, amplitude) = (about(20.5), rate(1e-3 * size));
            SinusoidalLine { frequency_hz, amplitude, multiples: None, evidence: line() }.into()
        },
        |size| {
            let (frequency_hz, bandwidth_hz, deviation) = (about(20.5), about(0.7), rate(1e-3 * size));
            ResonantLine { frequency_hz, bandwidth_hz, deviation, multiples: None, evidence: line() }.into()
        },
        |size| {
            let (frequency_hz, amplitude) = (about(0.025), rate(1e-3 * size));
            let harmonics_percent = about(50.0);
            Periodic { frequency_hz, amplitude, harmonics_percent, harmonics: vec![0.1], sum: 100.0, p_value: 1e-9 }
                .into()
        },
        |size| {
            let (deviation, time_constant_s) = (rate(1e-3 * size), about(100.0));
            CommonMode { deviation, time_constant_s, others: vec!["gyro_x"], gain: 20.0 }.into()
        },
        |size| {
            let time_s = BoundedEstimate::exact(740.0);
            LevelChange { time_s, ratio: about(size), explained: 0.9, p_value: 1e-9 }.into()
        },
    ]
}

fn report(kind: fn(f64) -> Effect, sizes: [f64; 3], validated: Validation) -> Report {
    let mut report = fixture::report();
    report.findings = vec![Finding {
        effect: kind(sizes[2]),
        channels: GYROS.map(str::to_owned).to_vec(),
        clearest: 2,
        validated,
        share_percent: BTreeMap::from([("gyro_z".to_owned(), 62.0)]),
        minute_percent: BTreeMap::from([("gyro_z".to_owned(), 8.0)]),
    }];
    for (channel, size) in report.channels.iter_mut().zip(sizes) {
        channel.effects = vec![ChannelEffect { effect: kind(size), finding: 0 }];
    }
    report
}

#[test]
fn every_channel_of_a_finding_has_its_own_number_and_sign() {
    let positive = SIZES.map(f64::abs);
    let all = signed_kinds().into_iter().map(|kind| (kind, SIZES));
    for (kind, sizes) in all.chain(other_kinds().into_iter().map(|kind| (kind, positive))) {
        let report = report(kind, sizes, Validation::Yes);
        let text = &reports::summary::findings(&report).0[0];
        let page = reports::page::html(&report, None, None);
        for (sentence, digits) in [(&text.physics, 3), (&text.brief, 2)] {
            for (axis, size) in ["x", "y", "z"].into_iter().zip(sizes) {
                let number = significant(size, digits);
                assert!(
                    sentence.contains(&format!("{axis} {number}")),
                    "{}: {axis} {number}: {sentence}",
                    report.findings[0].effect.name()
                );
            }
        }
        assert!(page.contains(&text.physics), "{}", text.physics);
        let json = serde_json::to_value(ReportJson::new(&report, None)).expect("a report");
        for (channel, shown) in GYROS.iter().zip(&report.channels) {
            let own = serde_json::to_value(shown.effects[0].effect.parameters()).expect("parameters");
            assert_eq!(json["findings"][0]["in_channels"][channel], own);
        }
        assert!(!text.advice.contains("this sensitivity"), "{}", text.advice);
    }
}

#[test]
fn channels_of_two_units_have_their_numbers_by_unit() {
    let mut report = report(signed_kinds()[0], SIZES, Validation::Yes);
    let acceleration = about(-4.0e-4).in_unit("g");
    let effect = Effect::from(TemperatureSensitivity { sensitivity: acceleration, sigmas: 9.0 });
    report.channels[3].effects = vec![ChannelEffect { effect, finding: 0 }];
    report.findings[0].channels.push("accl_x".to_owned());
    assert_eq!(
        reports::summary::findings(&report).0[0].physics,
        "The bias follows the temperature: gyro x 21.2 ± 0.4, y 11.90 ± 0.24, z −27.8 ± 0.6 m°/s/°C, accel x −400 ± 8 µg/°C."
    );
}

#[test]
fn one_number_that_all_channels_have_is_told_once() {
    let report = report(signed_kinds()[0], [21.2; 3], Validation::Yes);
    let text = &reports::summary::findings(&report).0[0];
    assert_eq!(text.physics, "The bias follows the temperature: 21.2 ± 0.4 m°/s/°C each.");
}

#[test]
fn what_the_second_half_contradicts_is_not_to_be_subtracted() {
    let kinds = signed_kinds();
    for kind in &kinds[..6] {
        let report = report(*kind, SIZES, Validation::No);
        let steps = reports::summary::numbered_steps(&report).join(" ");
        let advice = &reports::summary::findings(&report).0[0].advice;
        for text in [&steps, advice] {
            assert!(!["Subtract", "Compensate"].iter().any(|word| text.contains(word)), "{text}");
        }
    }
}

#[test]
fn the_picture_of_a_sensitivity_has_a_line_for_every_channel() {
    let mut report = report(signed_kinds()[0], SIZES, Validation::Yes);
    let time_s: Vec<f64> = (0..20).map(f64::from).collect();
    let course = |slope: f64| {
        let mean = time_s.iter().map(|time| 1e-3 * slope * (time - 9.5)).collect();
        Some(BiasOverTime { block_s: 1.0, time_s: time_s.clone(), mean, followed: Vec::new() })
    };
    for (channel, size) in report.channels.iter_mut().zip(SIZES) {
        channel.figure_data.bias_over_time = course(size);
    }
    let mut temperature: ChannelReport = fixture::channel("temp", "degC");
    temperature.figure_data.bias_over_time = course(1e3);
    report.channels.push(temperature);
    let page = reports::page::html(&report, None, None);
    let figure =
        page.split("id=\"finding-1\"").nth(1).and_then(|rest| rest.split("</figure>").next()).expect("a figure");
    for (name, size) in ["gyro x", "gyro y", "gyro z"].into_iter().zip(SIZES) {
        let label = format!("{name} {}", significant(size, 3));
        assert!(figure.contains(&label), "{label}: {figure}");
    }
}

/// A ramp, whose coefficient is called slope, too.
#[test]
fn every_coefficient_of_a_channel_has_a_row() {
    let mut report = fixture::report();
    report.channels[0].refitted.terms.push(fixture::term(NoiseTerm::RateRamp, 1e-6, "deg/s"));
    let rows = reports::rows::rows(&report, "a.csv", None);
    let is_own = |row: &&ReportRow| row.row == "coefficient" && row.channel.as_deref() == Some("gyro_x");
    let kinds: Vec<&str> = rows.iter().filter(is_own).filter_map(|row| row.kind.as_deref()).collect();
    assert_eq!(kinds, ["angle_random_walk", "bias_instability", "rate_random_walk", "rate_ramp"]);
}
