//! Terminal, figure and page of a report whose numbers are known.

mod fixture;

use fixture::{channel, empty, report};
use noise_analysis::report::{ChannelReport, ModelErrorReport, Report};
use reports::{figure, page, terminal};

fn text(report: &Report) -> String {
    let mut out = Vec::new();
    terminal::write(report, &mut out).expect("a vector can be written");
    String::from_utf8(out).expect("text")
}

fn html(report: &Report) -> String {
    let dir = tempfile::tempdir().expect("a folder");
    let path = page::write(report, &dir.path().join("new/page")).expect("a page");
    assert!(path.ends_with("new/page/index.html"));
    std::fs::read_to_string(path).expect("the page that was written")
}

/// Circles and texts of the figure, which must be XML.
fn figure_content(channel: &ChannelReport) -> (usize, Vec<String>) {
    let svg = figure::allan_deviation(channel).expect("a figure");
    let document = roxmltree::Document::parse(&svg).expect("well-formed");
    let named = |name| document.descendants().filter(move |node| node.has_tag_name(name));
    for node in named("text") {
        assert_eq!(node.attribute("font-family"), Some("sans-serif"));
    }
    let texts = named("text").filter_map(|node| node.text()).map(|text| text.trim().to_owned());
    (named("circle").count(), texts.collect())
}

#[test]
fn every_point_has_a_marker_in_both_panels() {
    let legend = 1;
    for channel in &report().channels {
        let (circles, _) = figure_content(channel);
        assert_eq!(circles, 2 * channel.curve.len() + legend, "{}", channel.name);
    }
}

#[test]
fn the_figure_is_labelled() {
    let (_, texts) = figure_content(&report().channels[2]);
    for label in [
        "gyro_z · Allan deviation",
        "Allan deviation σ(τ), °/s",
        "averaging time τ, s",
        "σ / model − 1, %",
        "measured, 95 % interval",
        "baseline model (N, B, K)",
        "with traced effects",
        "N = 0.03714 °/√s",
        "B = 0.01430 °/s",
        "K = 0.001217 °/s/√s",
        "0.01",
        "100",
    ] {
        assert!(texts.iter().any(|text| text == label), "{label} is not in {texts:?}");
    }
}

#[test]
fn without_effects_there_is_one_model_line() {
    let (_, texts) = figure_content(&report().channels[0]);
    assert!(!texts.iter().any(|text| text == "with traced effects"));
}

#[test]
fn every_colour_of_the_figure_has_a_dark_counterpart() {
    let svg = figure::allan_deviation(&report().channels[2]).expect("a figure");
    let document = roxmltree::Document::parse(&svg).expect("well-formed");
    for node in document.descendants() {
        for colour in [node.attribute("fill"), node.attribute("stroke")].into_iter().flatten() {
            let known = figure::DARK_COLOURS.iter().any(|(light, _)| *light == colour);
            assert!(known || colour == "none", "{colour}");
        }
    }
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
    if let Some(value) = odd.read_off.angle_random_walk.as_mut() {
        value.value = f64::NAN;
    }
    if let Some(value) = odd.read_off.rate_random_walk.as_mut() {
        value.to_s = f64::INFINITY;
    }
    let (circles, _) = figure_content(&odd);
    let beneath = [3, 4, 6, 7].len();
    assert_eq!(circles, total - 3 + beneath + 1);
    let mut whole = report();
    whole.channels = vec![odd];
    whole.sample_rate_hz = 0.0;
    assert!(text(&whole).contains("sample rate  0 Hz"));
    assert!(text(&whole).contains("327.7 … –"));
    assert!(html(&whole).contains("found in 327.7 … – s"));
}

#[test]
fn curves_of_extreme_values_are_drawn() {
    for (low, high) in [(1e-300, 1e300), (1.0, 1.0), (5e-324, f64::MAX)] {
        let mut odd = channel("gyro_x", "deg/s");
        odd.curve.truncate(2);
        for (point, adev) in odd.curve.iter_mut().zip([low, high]) {
            (point.adev, point.low, point.high) = (adev, adev / 2.0, adev * 2.0);
        }
        figure_content(&odd);
        odd.curve.truncate(1);
        figure_content(&odd);
    }
}

#[test]
fn a_record_without_a_curve_is_reported_in_a_sentence() {
    let report = empty();
    let (circles, texts) = figure_content(&report.channels[0]);
    assert_eq!(circles, 0);
    assert!(texts.iter().any(|text| text.contains("too short")));
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
    let (circles, texts) = figure_content(&still);
    assert_eq!(circles, 0);
    assert!(texts.iter().any(|text| text.contains("did not change")));
}

/// Two slopes found at the same place, as a band-limited sensor shows them.
#[test]
fn labels_of_slopes_do_not_cover_each_other() {
    let mut close = channel("gyro_x", "deg/s");
    let flat = close.read_off.bias_instability.clone().expect("a value");
    for value in [&mut close.read_off.angle_random_walk, &mut close.read_off.rate_random_walk] {
        let value = value.as_mut().expect("a value");
        (value.from_s, value.to_s) = (flat.from_s, flat.to_s);
        // Both lines pass 0.0095 deg/s at 58 s.
        value.value = 0.0095 * if value.unit == "deg/sqrt(s)" { 58f64.sqrt() } else { (3.0 / 58.0f64).sqrt() };
    }
    let svg = figure::allan_deviation(&close).expect("a figure");
    let document = roxmltree::Document::parse(&svg).expect("well-formed");
    let height = |symbol: &str| -> i32 {
        let mut texts = document.descendants().filter(|node| node.has_tag_name("text"));
        let label = texts.find(|node| node.text().is_some_and(|text| text.trim().starts_with(symbol)));
        label.and_then(|node| node.attribute("y")?.parse().ok()).expect("a label with a height")
    };
    // The letters are 23 pixels high; the label of the flat line reaches to both sides.
    for other in ["N = ", "K = "] {
        assert!((height("B = ") - height(other)).abs() >= 28, "{other}");
    }
}

#[test]
fn a_report_without_channels_is_written() {
    let mut report = empty();
    report.channels.clear();
    assert!(text(&report).contains("dropped      none\nflagged      none"));
    assert!(html(&report).contains("Samples dropped"));
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

/// Texts that both the terminal and the page must contain for [`report`], in the format of [`reports::formatting`].
const EXPECTED: [&str; 33] = [
    "gyro_x",
    "gyro_y",
    "gyro_z",
    "accl_x",
    "accl_y",
    "accl_z",
    "0.03714",
    "0.01430",
    "0.001217",
    "0.03680",
    "0.009300",
    "0.001300",
    "37.14e-6",
    "36.80e-6",
    "0.01000 … 2.560",
    "1,000,000",
    "2 h 46 min 40 s",
    "1,804",
    "21.84 %",
    "3.946 %",
    "°/√s",
    "no such slope",
    "°/√h",
    "2.208",
    "0.3681",
    "0.1700",
    "0.1810",
    "10 min",
    "0.4321",
    "enough for a filter",
    "0.03677",
    "Markov time by the autocorrelation",
    "bias instability to ±20 %: record 7 h 30 min more",
];

#[test]
fn the_terminal_shows_every_channel_and_coefficient() {
    let text = text(&report());
    for expected in EXPECTED {
        assert!(text.contains(expected), "{expected}\n{text}");
    }
    assert!(text.contains("no new data 3"));
    // Only accl_x lacks a slope.
    assert_eq!(text.matches("no such slope").count(), 1);
}

#[test]
fn the_page_shows_every_channel_and_coefficient() {
    let page = html(&report());
    for expected in EXPECTED {
        assert!(page.contains(expected), "{expected}");
    }
    assert_eq!(page.matches("<svg").count(), 6);
    assert_eq!(page.matches("no such slope").count(), 1);
    assert!(page.contains("the residual rises to 41 %"));
}

#[test]
fn the_page_needs_no_other_file_and_is_reproducible() {
    let page = html(&report());
    assert_eq!(page, html(&report()));
    let addresses = page.replace("http://www.w3.org/2000/svg", "");
    for outside in ["http:", "https:", "<script", "<link", "src=", "@import", "url("] {
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
    figure_content(&report.channels[0]);
}

#[test]
fn a_page_that_cannot_be_written_names_its_path() {
    let dir = tempfile::tempdir().expect("a folder");
    let file = dir.path().join("taken");
    std::fs::write(&file, "").expect("a file");
    let error = page::write(&report(), &file).expect_err("a file is not a folder").to_string();
    assert!(error.contains(&file.join("index.html").display().to_string()), "{error}");
    assert!(error.starts_with("cannot write the page"), "{error}");
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
    // Without a gap there is no such line.
    let whole = fixture::report();
    assert!(!text(&whole).contains("Missing") && !html(&whole).contains("Missing"));
}

#[test]
fn a_model_that_fails_at_one_averaging_time_is_told_in_words() {
    let mut report = report();
    let error = &mut report.channels[0].after.unseen;
    (error.worst_sigma, error.worst_tau_s, error.worst_ratio) = (Some(-12.34), Some(1310.72), Some(38.7));
    let words = "at τ = 21 min 51 s the model is 38.70 times what is measured in the unseen half (-12.34 sigma)";
    let flat = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(flat(text(&report)).contains(words), "{}", text(&report));
    assert!(html(&report).contains(words));
    // The other way round.
    let error = &mut report.channels[0].after.unseen;
    (error.worst_sigma, error.worst_ratio) = (Some(56.78), Some(0.1));
    let words = "at τ = 21 min 51 s what is measured in the unseen half is 10.00 times the model (56.78 sigma)";
    assert!(flat(text(&report)).contains(words) && html(&report).contains(words));
    // A deviation as chance has it is a number in the table only.
    let usual = fixture::report();
    assert!(!text(&usual).contains("what is measured") && text(&usual).contains("-1.876"));
    assert!(html(&usual).contains("-1.876 σ"));
}

#[test]
fn the_deviation_by_the_spectrum_stands_beside_the_curve() {
    let report = report();
    let by_spectrum = reports::formatting::number(report.channels[0].curve[3].adev_by_spectrum.expect("resolved"));
    for shown in [text(&report), html(&report)] {
        assert!(shown.contains("by PSD") && shown.contains(&by_spectrum), "{by_spectrum}");
        assert!(shown.contains("+1.9 % from the fit"));
    }
    let mut without = report;
    without.channels[0].assessment.angle_random_walk_by_spectrum = None;
    without.channels[0].assessment.angle_random_walk_by_spectrum_note = Some("rounding hides it".to_owned());
    assert!(text(&without).contains("N by the spectrum: none, rounding hides it."));
    assert!(html(&without).contains(": none, rounding hides it."));
}
