//! Terminal, figure and page of a report whose numbers are known.

mod explanation;

use crate::fixture::{self, channel, empty, report};
use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::effects::{Effect, EffectiveLsb, LevelStep};
use noise_analysis::report::{
    BiasOverTime, ChannelReport, Finding, ModelErrorReport, Report, SlopeMethodValue, TermReport, Validation,
};
use reports::reading::ReadingRecord;
use reports::{figure, full_tables, page};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;

fn of(value: f64) -> BoundedEstimate {
    BoundedEstimate::new(value, 0.9 * value, 1.1 * value)
}

fn text(report: &Report) -> String {
    let mut out = Vec::new();
    full_tables::write(report, None, &mut out).expect("a vector can be written");
    String::from_utf8(out).expect("text")
}

fn html(report: &Report) -> String {
    page::html(report, Some("fan <1>.csv"), None)
}

fn svg(channel: &ChannelReport) -> String {
    figure::allan_deviation(&report(), channel)
}

fn named<'a>(document: &'a Document<'a>, name: &'a str) -> impl Iterator<Item = Node<'a, 'a>> {
    document.descendants().filter(move |node| node.has_tag_name(name))
}

fn texts(svg: &str) -> Vec<String> {
    let document = Document::parse(svg).expect("well-formed");
    named(&document, "text").filter_map(|node| node.text()).map(|text| text.trim().to_owned()).collect()
}

fn dots(svg: &str) -> Vec<(f64, f64)> {
    let document = Document::parse(svg).expect("well-formed");
    let group = document.descendants().find(|node| node.attribute("data-line") == Some("measured, 95 % bounds"));
    let number =
        |node: Node<'_, '_>, name: &str| -> f64 { node.attribute(name).expect(name).parse().expect("a number") };
    let circles = group.into_iter().flat_map(|group| group.children()).filter(|node| node.has_tag_name("circle"));
    circles.map(|node| (number(node, "cx"), number(node, "cy"))).collect()
}

#[test]
fn every_point_has_a_dot_where_its_logarithms_are() {
    for channel in &report().channels {
        let dots = dots(&svg(channel));
        assert_eq!(dots.len(), channel.curve.len(), "{}", channel.name);
        // Equal octaves; the same scale for all pairs of points, to a tenth of a pixel.
        let (first, last) = (dots[0], dots[dots.len() - 1]);
        let (start, end) = (&channel.curve[0], &channel.curve[dots.len() - 1]);
        for (dot, point) in dots.iter().zip(&channel.curve) {
            let across = (point.tau_s / start.tau_s).log10() / (end.tau_s / start.tau_s).log10();
            assert!((first.0 + across * (last.0 - first.0) - dot.0).abs() < 0.11, "{} {}", channel.name, point.n);
            let up = (point.adev / start.adev).log10() / (end.adev / start.adev).log10();
            // Rounding of both ends.
            let tolerance = 0.11 * (1.0 + up.abs());
            assert!((first.1 + up * (last.1 - first.1) - dot.1).abs() < tolerance, "{} {}", channel.name, point.n);
        }
    }
}

#[test]
fn the_figure_is_labelled() {
    let texts = texts(&svg(&report().channels[2]));
    for label in [
        "Allan deviation σ(τ), °/s",
        "averaging time τ, s",
        "residual, σ",
        "measured, 95 % bounds",
        "before: N, B, K of the first half",
        "model of the whole record",
        "N 2.21 °/√h",
        "B 33.5 °/h",
        "K 281 °/h/√h",
        "0.01",
        "100",
    ] {
        assert!(texts.iter().any(|text| text == label), "{label} is not in {texts:?}");
    }
}

#[test]
fn without_effects_there_is_one_model_line() {
    assert!(!texts(&svg(&report().channels[0])).iter().any(|text| text.starts_with("before")));
}

#[test]
fn numbers_that_an_axis_cannot_show_are_left_out() {
    let mut odd = channel("gyro_x", "deg/s");
    let total = odd.curve.len();
    odd.curve[0].adev = f64::NAN;
    odd.curve[1].adev = 0.0;
    odd.curve[2].tau_s = f64::INFINITY;
    odd.curve[3].low = 0.0;
    odd.curve[4].high = f64::INFINITY;
    odd.before.adev[5] = f64::NAN;
    odd.before.adev.truncate(8);
    odd.after = odd.before.clone();
    odd.refitted = odd.before.clone();
    if let Some(value) = odd.read_off.rate_random_walk.as_mut() {
        value.to_s = f64::INFINITY;
    }
    assert_eq!(dots(&svg(&odd)).len(), total - 3);
    let mut whole = report();
    whole.channels = vec![odd];
    whole.sample_rate_hz = 0.0;
    assert!(text(&whole).contains("sample rate  0 Hz"));
    assert!(text(&whole).contains("327.7 … –"));
    assert!(!html(&whole).contains("NaN"));
}

#[test]
fn curves_of_extreme_values_are_drawn() {
    for (low, high) in [(1e-300, 1e300), (1.0, 1.0), (5e-324, f64::MAX)] {
        let mut odd = channel("gyro_x", "deg/s");
        odd.curve.truncate(2);
        for (point, adev) in odd.curve.iter_mut().zip([low, high]) {
            (point.adev, point.low, point.high) = (adev, adev / 2.0, adev * 2.0);
        }
        texts(&svg(&odd));
        odd.curve.truncate(1);
        texts(&svg(&odd));
    }
}

#[test]
fn a_record_without_a_curve_is_reported_in_a_sentence() {
    let report = empty();
    let drawing = svg(&report.channels[0]);
    assert!(dots(&drawing).is_empty() && drawing.contains("too short"));
    assert!(text(&report).contains("too short for a point of the curve"));
    assert!(text(&report).contains("no such slope"));
    assert!(html(&report).contains("too short for a point of the curve"));
}

#[test]
fn a_channel_that_never_changes_is_reported_in_a_sentence() {
    let mut still = channel("aux_adc", "V");
    for point in &mut still.curve {
        (point.adev, point.low, point.high) = (0.0, 0.0, 0.0);
    }
    let drawing = svg(&still);
    assert!(dots(&drawing).is_empty() && drawing.contains("did not change"));
}

#[test]
fn a_report_without_channels_is_written() {
    let mut report = empty();
    report.channels.clear();
    assert!(text(&report).contains("dropped      none\nflagged      none"));
    assert!(html(&report).contains("How to read this"));
}

#[test]
fn the_terminal_stays_within_a_hundred_columns() {
    for report in [report(), empty()] {
        for line in text(&report).lines() {
            assert!(line.chars().count() <= 100, "{line}");
            assert!(!line.contains('\u{1b}'), "colour codes in the text: {line}");
        }
    }
}

/// Text of the elements, without scripts and styles.
fn visible(page: &str) -> String {
    let mut text = String::new();
    let mut hidden = None;
    for piece in page.split('<') {
        let (tag, content) = piece.split_once('>').unwrap_or((piece, ""));
        let name = tag.split_whitespace().next().unwrap_or_default();
        hidden = match hidden {
            Some(of) if name.strip_prefix('/') == Some(of) => None,
            None if ["script", "style"].contains(&name) => Some(name),
            other => other,
        };
        if hidden.is_none() {
            text = text + " " + content;
        }
    }
    text
}

fn with_exponent(text: &str) -> Vec<&str> {
    let words = text.split(|letter: char| letter.is_whitespace() || "│()[];…".contains(letter));
    let bare = words.map(|word| word.trim_matches([',', '.', ':']));
    bare.filter(|word| word.contains('e') && word.replace('−', "-").parse::<f64>().is_ok()).collect()
}

#[test]
fn no_number_with_a_unit_has_an_exponent() {
    assert_eq!(
        with_exponent("N 805.1e-6 (−8.0e-4 … 8.2e-4), 1e6; the 12 µg"),
        ["805.1e-6", "−8.0e-4", "8.2e-4", "1e6"]
    );
    let mut small = report();
    small.channels.push(channel("magn_x", "gauss"));
    // A gyro below the prefix m.
    let gyro = &mut small.channels[2];
    for point in &mut gyro.curve {
        point.adev *= 1e-5;
        point.low *= 1e-5;
        point.high *= 1e-5;
    }
    for model in [&mut gyro.before, &mut gyro.after, &mut gyro.refitted] {
        model.adev.iter_mut().for_each(|adev| *adev *= 1e-5);
        for TermReport { term, .. } in &mut model.terms {
            for of in [&mut term.value, &mut term.low, &mut term.high] {
                *of *= 1e-5;
            }
        }
    }
    small.sample_rate_hz = 2e6;
    for (form, shown) in [("--full", text(&small)), ("page", visible(&html(&small)))] {
        assert!(!shown.is_empty(), "{form}");
        assert_eq!(with_exponent(&shown), Vec::<&str>::new(), "{form}");
    }
}

/// Texts that the tables must contain for [`report`], in the format of [`reports::formatting`].
const EXPECTED: [&str; 30] = [
    "gyro_x",
    "gyro_y",
    "gyro_z",
    "accl_x",
    "accl_y",
    "accl_z",
    "37.1",
    "14.3",
    "1.22",
    "36.8 ± 2.4",
    "9.3 ± 0.6",
    "1.30 ± 0.08",
    "m°/√s",
    "µg/√Hz",
    "0.01000 … 2.560",
    "1,000,000",
    "2 h 46 min 40 s",
    "1,804",
    "21.84 %",
    "3.946 %",
    "no such slope",
    "°/√h",
    "2.21 ± 0.22",
    "0.37 ± 0.04",
    "0.170",
    "0.181 ± 0.018",
    "10 min",
    "0.43",
    "enough for a filter",
    "bias instability to ±20 %: record 7 h 30 min more",
];

#[test]
fn the_terminal_shows_every_channel_and_coefficient() {
    let text = text(&report());
    for expected in EXPECTED {
        assert!(text.contains(expected), "{expected}\n{text}");
    }
    assert!(text.contains("no new data 3"));
    assert_eq!(text.matches("no such slope").count(), 1);
}

#[test]
fn the_page_shows_every_channel_and_coefficient() {
    let page = html(&report());
    for channel in ["gyro x", "gyro y", "gyro z", "accel x", "accel y", "accel z"] {
        assert!(page.contains(&format!("{channel} · Allan deviation")), "{channel}");
    }
    // N of `final` in the units of its users: 0.0368 deg/√s (0.0346 … 0.0394) are 2.208 °/√h; 36.8 mg·√s are 36.8 µg/√Hz.
    for expected in ["2.21\n±\u{a0}0.14", "°/√h", "36.8", "µg/√Hz", "24 →\u{a0}4.0\u{a0}%", "14,321"] {
        assert!(page.contains(expected), "{expected}");
    }
    // A line does not end before a per cent sign.
    assert!(page.contains("bias instability to ±20\u{a0}%: record"));
    // Story, overviews, finding, one per channel.
    assert_eq!(page.matches("<svg xmlns").count(), 10);
}

#[test]
fn the_gyros_stand_beside_the_curve_that_the_data_sheet_draws() {
    let mut report = report();
    let drawn =
        |mean: f64| format!(r#"{{"tau_s":{},"mean":{mean},"low":{},"high":{}}}"#, 1.0 / mean, 0.9 * mean, 1.1 * mean);
    let sheet = |curve: &str| {
        let stated = r#""angle_random_walk":0.03,"in_run_bias_stability":null,"rate_random_walk":null"#;
        serde_json::from_str(&format!("{{{stated}{curve}}}")).expect("a data sheet")
    };
    let svg = |report: &Report| {
        figure::pictures(report).into_iter().find(|of| of.name == "overview-gyros").expect("a figure").svg
    };
    report.channels[0].figure_data.data_sheet = Some(sheet(""));
    let stated = svg(&report);
    assert!(stated.contains("data sheet") && !stated.contains("over parts") && !stated.contains("band reference"));
    report.channels[0].figure_data.data_sheet = Some(sheet(&format!(r#","curve":[{},{}]"#, drawn(0.1), drawn(0.01))));
    let drawn = svg(&report);
    assert!(drawn.contains("data sheet, mean and ±1 σ over parts") && drawn.contains("band reference"), "{drawn}");
}

#[test]
fn the_page_names_its_recording() {
    let page = html(&report());
    assert!(page.contains("noise report · fan &lt;1&gt;.csv</title>") && page.contains("fan &lt;1&gt;.csv · "));
}

fn picture(report: &Report, name: &str) -> String {
    figure::pictures(report).into_iter().find(|picture| picture.name == name).expect(name).svg
}

/// Its points are there, below a second row of the legend.
#[test]
fn the_first_picture_has_the_half_that_the_fit_has_not_seen() {
    let mut report = report();
    let name = "second half, not seen by the fit";
    let top = |picture: &str| {
        let document = Document::parse(picture).expect("XML");
        let frame = document.descendants().find(|node| node.attribute("class") == Some("frame")).expect("a frame");
        let names = document.descendants().filter(|node| node.has_tag_name("text") && node.text() == Some(name));
        let row: Vec<f64> = names.map(|node| node.attribute("y").expect("y").parse().expect("a number")).collect();
        (frame.attribute("y").expect("y").parse::<f64>().expect("a number"), row)
    };
    let story = picture(&report, "story");
    let document = Document::parse(&story).expect("XML");
    let group = document.descendants().find(|node| node.attribute("data-line") == Some(name)).expect("the points");
    let dots = group.children().filter(|node| node.has_tag_name("circle")).count();
    assert_eq!(dots, report.channels[0].unseen_adev.len());
    assert_eq!(top(&story), (54.0, vec![40.0]));
    for channel in &mut report.channels {
        channel.unseen_adev.clear();
    }
    assert_eq!(top(&picture(&report, "story")), (34.0, Vec::new()));
}

#[test]
fn the_first_picture_is_there_without_a_gain() {
    let mut report = report();
    assert!(picture(&report, "story").contains("without what was found, by"));
    for channel in &mut report.channels {
        channel.after = channel.before.clone();
    }
    // Fewer percent, but less probable: the picture has the figure of the table.
    report.channels[2].after.unseen.deviance_per_point = Some(2e4);
    report.channels[2].after.unseen.rms_percent = Some(2.0);
    let story = picture(&report, "story");
    assert!(story.contains("model of the first half") && !story.contains("after: with effects"));
    let page = html(&report);
    assert!(page.contains("<figcaption>Gyro z: σ is off by 2.0 %</figcaption>"), "{story}");
    assert!(page.contains("→\u{a0}2.0\u{a0}%"));
}

/// The second picture is not the curve of the first once more, and a curve that falls to its end has no minimum.
#[test]
fn the_second_picture_has_what_the_first_has_not() {
    let mut report = report();
    let in_gyro = |effect: Effect| Finding {
        effect,
        channels: vec!["gyro_x".to_owned()],
        clearest: 0,
        validated: Validation::Untestable,
        share_percent: BTreeMap::new(),
        minute_percent: BTreeMap::new(),
    };
    let title = |report: &Report| {
        let page = html(report);
        let figure = page.split("<figure id=\"strongest\"").nth(1).expect("a second picture");
        let caption = figure.split("<figcaption>").nth(1).and_then(|rest| rest.split('<').next());
        caption.expect("a caption").to_owned()
    };
    let step = of(0.05).in_unit("deg/s");
    report.findings = vec![in_gyro(EffectiveLsb { step, counts: 1, values: 9, changes: 9 }.into())];
    assert_eq!(title(&report), "Allan deviation of the gyros");
    report.findings.push(in_gyro(LevelStep { time_s: of(4000.0), size: step, p_value: 1e-9 }.into()));
    for channel in &mut report.channels {
        channel.figure_data.bias_over_time =
            Some(BiasOverTime { block_s: 40.0, time_s: vec![20.0, 60.0], mean: vec![0.0, 0.1], followed: vec![] });
    }
    assert_eq!(title(&report), "Evidence 2: bias step in gyro x");
    let lowest = |report: &Report| html(report).contains(" Lowest: gyro x ");
    assert!(lowest(&report));
    for channel in &mut report.channels {
        channel.curve.truncate(6);
    }
    assert!(!lowest(&report));
}

#[test]
fn a_recording_that_was_not_read_to_its_end_says_so_in_the_answer() {
    let reading = ReadingRecord { damage: Some("truncated".to_owned()), ..ReadingRecord::default() };
    let page = page::html(&report(), None, Some(&reading));
    let answer = page.split("<section class=\"verdict\"").nth(1).and_then(|rest| rest.split("</section>").next());
    assert!(answer.is_some_and(|answer| answer.contains("Not read to its end: truncated.")), "{answer:?}");
}

#[test]
fn the_data_sheet_is_in_the_title_where_it_is_drawn() {
    let mut report = report();
    for channel in &mut report.channels {
        channel.figure_data.data_sheet = None;
    }
    assert!(!picture(&report, "overview-gyros").contains("data sheet"));
}

/// +½ through K at 3 s reaches far beyond 3 s.
#[test]
fn a_slope_reaches_to_where_the_curve_has_it_or_is_said_to_be_absent() {
    let mut channel = channel("gyro_x", "deg/s");
    let (from_s, to_s) = (1000.0, 4000.0);
    let tau = channel.curve[0].tau_s;
    let unit = String::new();
    let value = channel.curve[0].adev * (3.0 / tau).sqrt() / 1e3;
    channel.read_off.rate_random_walk = Some(SlopeMethodValue { value, unit, from_s, to_s });
    let drawn = svg(&channel);
    let document = Document::parse(&drawn).expect("well-formed");
    let group = document.descendants().find(|node| node.attribute("data-line") == Some("slope +½")).expect("the line");
    let path = named_child(group, "path").attribute("d").expect("a path").to_owned();
    assert!(path.split([' ', '-']).count() > 2 * 8, "{path}");
    channel.read_off.rate_random_walk = None;
    assert!(svg(&channel).contains("The slope method finds no slope +½ in it."));
}

fn named_child<'a>(node: Node<'a, 'a>, name: &str) -> Node<'a, 'a> {
    node.children().find(|child| child.has_tag_name(name)).expect("a child")
}

#[test]
fn the_page_needs_no_other_file_and_is_reproducible() {
    let page = html(&report());
    assert_eq!(page, html(&report()));
    let addresses = page.replace("http://www.w3.org/2000/svg", "");
    for outside in ["http:", "https:", "<link", "src=", "@import", "url(h", "url(/", "url(\"", "fetch(", "XMLHttp"] {
        assert!(!addresses.contains(outside), "{outside}");
    }
}

#[test]
fn text_from_outside_is_escaped() {
    let mut report = report();
    report.channels[0].name = "<b>&\"x".to_owned();
    report.channels[0].unit = "<i>".to_owned();
    let page = html(&report);
    assert!(!page.contains("<b>&"));
    assert!(!page.contains("<i>,"));
    texts(&svg(&report.channels[0]));
}

#[test]
fn missing_samples_and_the_error_without_exclusions_are_shown() {
    let mut report = report();
    let channel = &mut report.channels[0];
    channel.missing.lost = 1_234;
    channel.missing.refused = [("spikes".to_owned(), 17), ("knock".to_owned(), 4_096)].into();
    channel.missing.replaced = 5_300;
    channel.after.unseen_excluding =
        Some(ModelErrorReport { deviance_per_point: Some(1.618), rms_percent: Some(2.615), ..Default::default() });
    for shown in [text(&report), html(&report)] {
        for content in ["1,234 samples lost", "knock 4,096", "spikes 17", "5,300 replaced", "1.618", "2.615"] {
            assert!(shown.contains(content), "{content}");
        }
    }
    let whole = fixture::report();
    assert!(!text(&whole).contains("Missing") && !html(&whole).contains("Missing"));
}

#[test]
fn a_model_that_fails_at_one_averaging_time_is_told_in_words() {
    let mut report = report();
    let error = &mut report.channels[0].after.unseen;
    (error.worst_sigma, error.worst_tau_s, error.worst_ratio) = (Some(-12.34), Some(1310.72), Some(38.7));
    let words = "at τ = 21 min 51 s the model is 38.70 times what is measured in the unseen half (−12.34 sigma)";
    let flat = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(flat(text(&report)).contains(words), "{}", text(&report));
    assert!(html(&report).contains(words));
    let error = &mut report.channels[0].after.unseen;
    (error.worst_sigma, error.worst_ratio) = (Some(56.78), Some(0.1));
    let words = "at τ = 21 min 51 s what is measured in the unseen half is 10.00 times the model (56.78 sigma)";
    assert!(flat(text(&report)).contains(words) && html(&report).contains(words));
    let usual = fixture::report();
    assert!(!text(&usual).contains("what is measured") && text(&usual).contains("−1.876"));
    assert!(html(&usual).contains("−1.876"));
}

#[test]
fn the_deviation_by_the_spectrum_stands_beside_the_curve() {
    let report = report();
    // 1.003 times the measured deviation, m°/s; the interval of the measured one is narrower than 1 %.
    let by_spectrum = format!("{:.1}", 1e3 * report.channels[0].curve[3].adev_by_spectrum.expect("resolved"));
    for shown in [text(&report), html(&report)] {
        assert!(shown.contains("by PSD") && shown.contains(&by_spectrum), "{by_spectrum}");
    }
}
