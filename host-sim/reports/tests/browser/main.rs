//! The page in headless Chromium: drawing, colour schemes, widths, keyboard, no requests; passes without Chromium.

use crate::fixture;
use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::effects::{
    CurveEvidence, Effect, LevelStep, LineEvidence, LineSource, MarkovEvidence, MarkovProcess, SinusoidalLine,
    TelegraphEvidence, TelegraphNoise,
};
use noise_analysis::report::{BiasOverTime, DataSheetReport, SpectrumReport};
use noise_analysis::report::{ChannelReport, Finding, Report, Validation};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

const CHROMIUM: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

fn chromium() -> Option<&'static str> {
    let runs = |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success());
    let found = CHROMIUM.into_iter().find(|name| runs(name));
    if found.is_none() {
        eprintln!("skipped: no chromium on this machine (apt-get install chromium)");
    }
    found
}

fn report() -> Report {
    let mut report = fixture::report();
    report.part.name = "ADIS16405".to_owned();
    for (index, channel) in report.channels.iter_mut().enumerate() {
        let data = &mut channel.figure_data;
        data.data_sheet = Some(DataSheetReport {
            angle_random_walk: Some(0.0333),
            in_run_bias_stability: Some(0.007),
            rate_random_walk: None,
            curve: Vec::new(),
        });
        let frequency_hz: Vec<f64> = (0..200).map(|bin| 0.001 * 1.055f64.powi(bin)).collect();
        let density: Vec<f64> = frequency_hz.iter().map(|f| 0.05 * (1.0 + 0.1 / f).sqrt()).collect();
        data.spectrum = Some(SpectrumReport {
            low: density.iter().map(|of| 0.9 * of).collect(),
            high: density.iter().map(|of| 1.1 * of).collect(),
            model: density.iter().map(|of| 1.02 * of).collect(),
            frequency_hz,
            density,
        });
        let time_s: Vec<f64> = (0..250).map(|block| 40.0 * (f64::from(block) + 0.5)).collect();
        let mean: Vec<f64> = time_s.iter().map(|time| 0.01 * (time / 1500.0 + index as f64).sin()).collect();
        data.bias_over_time =
            Some(BiasOverTime { block_s: 40.0, followed: mean.iter().map(|of| 0.8 * of).collect(), time_s, mean });
    }
    let of = |value: f64| BoundedEstimate::new(value, 0.9 * value, 1.1 * value);
    let size = |value: f64| of(value).in_unit("deg/s");
    let curve = CurveEvidence { excess: 0.1, tau_s: 1.0, sigmas: 9.0, gain_sigmas: 9.0 };
    let finding = |effect: Effect| Finding {
        effect,
        channels: vec!["gyro_z".to_owned()],
        clearest: 0,
        validated: Validation::Yes,
        share_percent: [("gyro_z".to_owned(), 40.0)].into(),
        minute_percent: Default::default(),
    };
    let line = SinusoidalLine {
        frequency_hz: of(0.7),
        amplitude: size(0.09),
        multiples: None,
        evidence: LineEvidence { has_width: false, source: LineSource::Curve(curve) },
    };
    let telegraph = TelegraphNoise {
        time_constant_s: of(60.0),
        amplitude: size(0.02),
        evidence: TelegraphEvidence::Levels { jumps: 80.0, gain: 20.0 },
    };
    let markov =
        MarkovProcess { deviation: size(0.02), time_constant_s: of(9.0), evidence: MarkovEvidence::Curve(curve) };
    report.findings = vec![
        finding(line.into()),
        finding(LevelStep { time_s: of(4000.0), size: size(0.01), p_value: 1e-9 }.into()),
        finding(telegraph.into()),
        finding(markov.into()),
    ];
    report
}

fn facts(program: &str, report: &Report, is_dark: bool, widths: &[u32]) -> Vec<Value> {
    let dir = tempfile::tempdir().expect("a folder");
    let page = reports::page::html(report, Some("fan.csv"), None);
    assert!(page.len() < 1_000_000, "{} bytes", page.len());
    let escaped = page.replace('&', "&amp;").replace('"', "&quot;");
    let frame =
        |width: &u32| format!("<iframe style=\"width:{width}px;height:900px;border:0\" srcdoc=\"{escaped}\"></iframe>");
    let frames: String = widths.iter().map(frame).collect();
    let harness = format!("<!doctype html><body>{frames}<script>{}</script></body>", include_str!("facts.js"));
    let file = dir.path().join("harness.html");
    std::fs::write(&file, harness).expect("a file");
    const START: &str = "<pre id=\"facts\">";
    // Decoding an image takes virtual time on a busy machine.
    let mut shown = [10, 100, 1_000, 10_000].into_iter().map(|budget_s| dump(program, &file, is_dark, budget_s));
    let dom = shown.find(|dom| dom.contains(START)).expect("the facts");
    let start = dom.find(START).expect("the facts") + START.len();
    let text = &dom[start..start + dom[start..].find("</pre>").expect("the end of the facts")];
    let text = text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&amp;", "&");
    let facts: Value = serde_json::from_str(&text).expect("JSON");
    facts.as_array().unwrap_or_else(|| panic!("{facts}")).clone()
}

fn dump(program: &str, file: &Path, is_dark: bool, budget_s: u32) -> String {
    let mut command = Command::new(program);
    command.args(["--headless", "--no-sandbox", "--disable-gpu", "--window-size=1400,1000"]);
    command.arg(format!("--virtual-time-budget={}", 1_000 * budget_s));
    command.arg(format!("--user-data-dir={}", file.with_extension("profile").display()));
    command.arg(format!("--blink-settings=preferredColorScheme={}", if is_dark { 0 } else { 1 }));
    let output = command.arg("--dump-dom").arg(format!("file://{}", file.display())).output().expect("chromium runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

fn list<'a>(value: &'a Value, name: &str) -> &'a [Value] {
    value[name].as_array().map_or(&[], Vec::as_slice)
}

fn pixel(axis: &Value, value: f64) -> f64 {
    let of = |name: &str| axis[name].as_f64().expect(name);
    let part = if axis["log"] == true {
        (value / of("from")).ln() / (of("to") / of("from")).ln()
    } else {
        (value - of("from")) / (of("to") - of("from"))
    };
    of("start") + part * (of("end") - of("start"))
}

/// Rounding, and four digits on an axis of 330 pixels over a decade.
const PIXEL: f64 = 0.1 + 330.0 * 0.5e-3 / std::f64::consts::LN_10;

#[test]
fn what_is_drawn_is_what_was_measured() {
    let Some(program) = chromium() else { return };
    let report = report();
    let facts = facts(program, &report, false, &[1300]);
    let figures = list(&facts[0], "figures");
    // Story, finding, gyros, accelerometers, three a channel, four of evidence.
    assert_eq!(figures.len(), 4 + 3 * 6 + 4);
    let figure = |id: &str| figures.iter().find(|figure| figure["id"] == id).expect("the figure");
    let line = |id: &str, name: &str| {
        let figure = figure(id);
        let panel = &figure["panels"][0];
        let values = list(panel, "lines").iter().find(|line| line["name"] == name).expect("its values").clone();
        let drawn = list(figure, "drawn").iter().find(|line| line["name"] == name).expect("its drawing").clone();
        (panel.clone(), values, drawn)
    };
    let check = |id: &str, name: &str, expected: &[(f64, f64)]| {
        let (panel, values, drawn) = line(id, name);
        // Measured points are not joined.
        let points = [list(&drawn, "points"), list(&drawn, "dots")].concat();
        assert_eq!(points.len(), expected.len(), "{id} {name}");
        assert_eq!(drawn["visible"], true, "{id} {name}");
        for (index, (&(x, y), point)) in expected.iter().zip(points).enumerate() {
            for (axis, value, at) in [("x", x, 0), ("y", y, 1)] {
                let read = values[axis][index].as_f64().expect("a value");
                assert!((read / value - 1.0).abs() < 1e-3, "{id} {name}: {read} for {value}");
                let distance = (point[at].as_f64().expect("a pixel") - pixel(&panel[axis], value)).abs();
                assert!(distance < PIXEL, "{id} {name}: {distance} pixels off");
            }
        }
    };
    assert_eq!(figures[0]["id"], "story");
    let gain = |channel: &ChannelReport| {
        let [before, after] =
            [&channel.before, &channel.after].map(|model| model.unseen.deviance_per_point.expect("an error"));
        before / after
    };
    let told = report.channels.iter().max_by(|a, b| gain(a).total_cmp(&gain(b))).expect("a channel");
    let taus = told.curve.iter().map(|point| point.tau_s);
    for (name, model) in [("before: N, B, K", &told.before), ("after: with effects", &told.after)] {
        check("story", name, &taus.clone().zip(model.adev.iter().copied()).collect::<Vec<_>>());
    }
    let (panel, _, drawn) = line("story", "second half, not seen by the fit");
    assert_eq!(list(&drawn, "dots").len(), told.unseen_adev.len());
    for ((tau, adev), dot) in taus.zip(&told.unseen_adev).zip(list(&drawn, "dots")) {
        for (axis, value, at) in [("x", tau, 0), ("y", *adev, 1)] {
            let distance = (dot[at].as_f64().expect("a pixel") - pixel(&panel[axis], value)).abs();
            assert!(distance < PIXEL, "{distance} pixels off");
        }
    }
    for channel in &report.channels {
        let name = &channel.name;
        let measured: Vec<(f64, f64)> = channel.curve.iter().map(|point| (point.tau_s, point.adev)).collect();
        check(&format!("{name}-allan"), "measured, 95 % bounds", &measured);
        let along = |values: &[f64]| -> Vec<(f64, f64)> {
            channel.curve.iter().map(|point| point.tau_s).zip(values.iter().copied()).collect()
        };
        check(&format!("{name}-allan"), "model of the whole record", &along(&channel.refitted.adev));
        let (_, values, _) = line(&format!("{name}-allan"), "measured, 95 % bounds");
        for (index, point) in channel.curve.iter().enumerate() {
            for (bound, value) in [("low", point.low), ("high", point.high)] {
                let read = values[bound][index].as_f64().expect("a bound");
                assert!((read / value - 1.0).abs() < 1e-3, "{name} {bound}: {read} for {value}");
            }
        }
        let spectrum = channel.figure_data.spectrum.as_ref().expect("a spectrum");
        let density: Vec<(f64, f64)> =
            spectrum.frequency_hz.iter().copied().zip(spectrum.density.iter().copied()).collect();
        check(&format!("{name}-spectrum"), "measured, 95 % bounds", &density);
        let bias = channel.figure_data.bias_over_time.as_ref().expect("a bias");
        let mean: Vec<(f64, f64)> = bias.time_s.iter().map(|time| time / 60.0).zip(bias.mean.iter().copied()).collect();
        let (_, _, drawn) = line(&format!("{name}-bias"), "mean of 40 s");
        assert_eq!(list(&drawn, "points").len(), mean.len());
    }
    let (_, sheet, _) = line("overview-gyros", "data sheet");
    let taus: Vec<f64> = report.channels[0].curve.iter().map(|point| point.tau_s).collect();
    for (index, tau) in taus.iter().enumerate() {
        let expected = (0.0333f64.powi(2) / tau + 0.007f64.powi(2)).sqrt();
        let read = sheet["y"][index].as_f64().expect("a value");
        assert!((read / expected - 1.0).abs() < 1e-3, "{read} for {expected}");
    }
}

/// Twelve channels, 191 to 400 points of a spectrum, 240 blocks of the bias.
#[test]
fn the_page_of_an_hour_of_twelve_channels_is_below_700_kilobytes() {
    let mut report = report();
    let full = report.channels[0].clone();
    let names = ["magn_x", "magn_y", "magn_z", "temp", "supply", "aux_adc"];
    report
        .channels
        .extend(names.map(|name| noise_analysis::report::ChannelReport { name: name.to_owned(), ..full.clone() }));
    for channel in &mut report.channels {
        let data = &mut channel.figure_data;
        let (points, blocks) = (200, 240);
        // Irregular digits, as measured.
        let digits = |k: usize| 0.0123456 + ((k * 7919) % 1000) as f64 * 1.00037e-6;
        let values = |count: usize| (0..count).map(digits).collect::<Vec<f64>>();
        let frequency_hz: Vec<f64> = (0..points).map(|bin| 0.00123456 * 1.06f64.powi(bin as i32)).collect();
        let (low, high, model, density) = (values(points), values(points), values(points), values(points));
        data.spectrum = Some(SpectrumReport { frequency_hz, low, high, model, density });
        let time_s = (0..blocks).map(|block| 15.012345 * (block as f64 + 0.5)).collect();
        let (followed, mean) = (values(blocks), values(blocks));
        data.bias_over_time = Some(BiasOverTime { block_s: 15.012345, followed, time_s, mean });
    }
    assert_eq!(report.channels.len(), 12);
    let bytes = reports::page::html(&report, None, None).len();
    assert!(bytes < 700_000, "{bytes} bytes");
}

#[test]
fn the_page_fits_and_can_be_read_in_both_colour_schemes() {
    let Some(program) = chromium() else { return };
    // The longest numbers of a measured run, such as 2.21 (1.3 … 13) and 4,590 → 3.9 % !
    let mut report = report();
    for channel in &mut report.channels {
        for term in channel.refitted.terms.iter_mut().map(|term| &mut term.term) {
            (term.low, term.high) = (0.6 * term.value, 6.0 * term.value);
        }
        channel.after.unseen.deviance_per_point = Some(5.0);
        channel.before.unseen.rms_percent = Some(385.0);
    }
    for is_dark in [false, true] {
        for facts in facts(program, &report, is_dark, &[400, 800, 1300]) {
            let width = &facts["width"];
            assert_eq!(facts["dark"], is_dark);
            assert_eq!(facts["overflow"], 0, "at {width} pixels");
            let cut: Vec<&str> = list(&facts, "cut").iter().filter_map(Value::as_str).collect();
            // Section links and tables scroll on a telephone; figures do not.
            let is_scrolled = |of: &str| (of.is_empty() || of.ends_with("scroll")) && !of.starts_with("verdict");
            let is_within = |most: u64| width.as_u64().is_some_and(|width| width <= most);
            // The numbers of a curve have ten columns.
            let is_allowed =
                |of: &&&str| is_within(400) && is_scrolled(of) || is_within(800) && **of == "channels scroll";
            assert!(cut.iter().all(|of| is_allowed(&of)), "{cut:?} at {width} pixels");
            let worst = &facts["contrasts"][0];
            assert!(worst[0].as_f64().expect("a contrast") >= 4.5, "{} at {width}, dark {is_dark}", facts["contrasts"]);
            assert_eq!(list(&facts, "requests").len(), 0, "{}", facts["requests"]);
            assert_eq!(list(&facts, "links").len(), 0, "links to nowhere: {}", facts["links"]);
        }
    }
}

#[test]
fn values_are_read_by_keyboard_and_pointer_and_tables_are_copied() {
    let Some(program) = chromium() else { return };
    let facts = facts(program, &report(), false, &[1300]);
    for figure in list(&facts[0], "figures") {
        let of = |name: &str| figure[name].as_str().unwrap_or_default();
        assert_eq!(figure["focused"], true, "{}", of("id"));
        assert!(of("label").chars().count() > 40, "{}: {}", of("id"), of("label"));
        let label = figure["panels"][0]["x"]["label"].as_str().expect("a label");
        let (axis, unit) = label.rsplit_once(", ").expect("a unit");
        assert!(of("read").starts_with(axis) && of("read") != of("before"), "{}: {}", of("id"), of("read"));
        assert!(of("pointed").starts_with(axis) && of("pointed") != of("read"), "{}: {}", of("id"), of("pointed"));
        assert_eq!(of("after"), of("before"), "{}", of("id"));
        for read in [of("read"), of("pointed")] {
            let place = read.split(':').next().unwrap_or_default();
            assert!(place.ends_with(unit), "{}: {read} without {unit}", of("id"));
            let words = read.split([' ', '(']).map(|word| word.trim_end_matches(')'));
            let is_exponent = |word: &str| word.starts_with(|c: char| c.is_ascii_digit()) && word.contains('e');
            assert!(!words.into_iter().any(is_exponent), "{}: {read}", of("id"));
        }
    }
    let csv = facts[0]["csv"].as_str().expect("the table");
    assert!(csv.starts_with("gyro,\"N, °/√h angle random walk\","), "{csv}");
    assert!(csv.contains("\naccel,\"N, µg/√Hz velocity random walk\","), "{csv}");
    assert!(csv.contains("\nx,2.21 ± 0.14,"), "{csv}");
    // Twice the pixels on light ground.
    let png = &facts[0]["png"];
    let view = reports::figure::pictures(&report())[0].svg.clone();
    let size = view.split("viewBox=\"0 0 ").nth(1).and_then(|rest| rest.split('"').next()).expect("a size");
    let doubled: Vec<u64> = size.split(' ').map(|of| 2 * of.parse::<u64>().expect("pixels")).collect();
    assert_eq!([&png["width"], &png["height"]], [doubled[0], doubled[1]]);
    for colour in ["ffffff", "1f5fa8", "a8480d", "0b7559"] {
        assert!(png["colours"][colour].as_u64().is_some(), "{colour}: {png}");
    }
}
