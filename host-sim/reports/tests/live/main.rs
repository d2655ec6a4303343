//! The live screen on a terminal in memory.

use crate::fixture;
use noise_analysis::report::ChannelReport;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::style::Color;
use reports::finding_text::FindingText;
use reports::live::{CurveGroup, LiveCurve, LiveView};
use reports::summary;

fn view() -> LiveView {
    let health = "Health: 1,000,000 samples used, 212 lost, 3 refused, 0 used with a warning.".to_owned();
    let status = "replayed 12 min of 2 h 47 min, 60 times real time".to_owned();
    let report = fixture::report();
    let curve = |channel: &ChannelReport| LiveCurve {
        channel: channel.name.clone(),
        unit: channel.unit.clone(),
        points: channel.curve.iter().map(|point| (point.tau_s, point.adev)).collect(),
    };
    let contradicted = summary::contradictions(&report).into_iter().next();
    let contradicted = contradicted.map(|first| format!("Model is off: {first}."));
    let findings = vec![FindingText {
        channels: "gyro z".to_owned(),
        channel_count: 1,
        physics: String::new(),
        brief: "A vibration or hum at 21 Hz: a narrow line of 0.27 °/s.".to_owned(),
        advice: String::new(),
        step: None,
        weight: String::new(),
    }];
    LiveView {
        headline: summary::headline(&report, Some("run1.csv.gz")).join("   "),
        sentences: summary::record_sentences_in_short(&report).join(" "),
        tables: summary::coefficient_tables(&report),
        curves: report.channels.iter().map(curve).collect(),
        findings,
        unexplained: vec!["gyro z: σ is 9.0 % above the model around τ = 80 s".to_owned()],
        advice: contradicted.into_iter().chain(["For a filter: add -o imu.yaml.".to_owned()]).collect(),
        health,
        status,
    }
}

fn drawn(view: &LiveView, columns: u16, rows: u16, group: CurveGroup, in_colour: bool) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(columns, rows)).expect("a terminal in memory");
    terminal.draw(|frame| view.draw(frame, group, in_colour)).expect("drawn");
    terminal.backend().buffer().clone()
}

fn text(buffer: &Buffer) -> String {
    let row = |y| (0..buffer.area.width).map(|x| buffer[(x, y)].symbol().to_owned()).collect::<String>();
    (0..buffer.area.height).map(|y| row(y).trim_end().to_owned() + "\n").collect()
}

#[test]
fn the_screen_has_verdict_curve_findings_health_and_keys_in_80_columns() {
    let screen = text(&drawn(&view(), 80, 24, CurveGroup::Gyros, false));
    for expected in [
        "run1.csv.gz",
        "1,000,000 samples",
        "N, °/√h",
        "µg/√Hz",
        "σ(τ) of the gyros, °/s over s",
        "What was found",
        "A vibration or hum at 21 Hz",
        "Not explained: gyro z",
        "Health: 1,000,000 samples used, 212 lost",
        "12 min of 2 h 47 min",
        "q ends",
    ] {
        assert!(screen.contains(expected), "{expected}:\n{screen}");
    }
    // The points are letters in the left half below the tables.
    let below = screen.split("σ(τ) of the gyros").nth(1).expect("the curves");
    let left: String = below.lines().map(|line| line.chars().take(40).collect::<String>() + "\n").collect();
    assert!(left.matches(['x', 'y', 'z']).count() >= 4, "{left}");
}

/// After a wanted change, delete the file, run the test, and read the new one.
#[test]
fn the_screen_is_as_it_was_read() {
    for (columns, rows) in [(80, 24), (120, 40)] {
        let screen = text(&drawn(&view(), columns, rows, CurveGroup::Gyros, false));
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/live/{columns}x{rows}.txt"));
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
fn the_other_group_of_curves_is_shown_on_request() {
    let group = CurveGroup::Gyros.other();
    assert_eq!((group, group.other()), (CurveGroup::Accelerometers, CurveGroup::Gyros));
    assert!(text(&drawn(&view(), 80, 24, group, true)).contains("σ(τ) of the accels, g over s"));
}

#[test]
fn without_colour_no_cell_has_one() {
    let coloured = |in_colour| {
        let buffer = drawn(&view(), 120, 40, CurveGroup::Gyros, in_colour);
        buffer.content().iter().filter(|cell| cell.fg != Color::Reset || cell.bg != Color::Reset).count()
    };
    assert!(coloured(true) > 0);
    assert_eq!(coloured(false), 0);
}

#[test]
fn any_size_and_an_empty_view_are_drawn() {
    for (columns, rows) in [(1, 1), (10, 3), (40, 12), (80, 24), (200, 60)] {
        for view in [view(), LiveView::default()] {
            let buffer = drawn(&view, columns, rows, CurveGroup::Gyros, true);
            assert_eq!((buffer.area.width, buffer.area.height), (columns, rows));
        }
    }
}
