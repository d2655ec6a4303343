//! What a debug probe on the bench reads: the log that the image leaves in its memory (RTT), decoded by the table of formats in its ELF.

use super::bench::{image, run};
use super::decoded::Decoded;
use super::faults::PERIOD;
use emulation::{Event, LogLine, Outcome, Scenario, Sensor};

/// The start, every line that the serial port sends as a log, and every counter of events that rises.
#[test]
fn a_probe_reads_what_the_sensor_and_the_recovery_do() {
    let events = vec![
        (1.5, Event::SensorReset),
        (3.5, Event::Stuck(Some(0x00))),
        (3.8, Event::Stuck(None)),
        (6.5, Event::LoseEdges(3)),
    ];
    let keys = vec![(0.1, b"i 0\r".to_vec()), (9.0, b"\rr".to_vec())];
    let sensor = Some(Sensor::Published(30));
    let scenario = Scenario { sensor, keys, events, seconds: 11.5, has_probe: true, ..Scenario::default() };
    let Outcome { received, log, .. } = run(image(), scenario);
    println!("{log:#?}");
    assert!(log.iter().all(|line| line.level == "info"));
    let told: Vec<&str> = log.iter().map(|line| line.text.as_str()).collect();
    assert!(told.contains(&"start 1, crystal true, crash record: "));
    let decoded = Decoded::decode(&received);
    let mut after = told.iter();
    assert!(decoded.logs().len() > 3, "{:?}", decoded.logs());
    for log in decoded.logs() {
        assert!(after.any(|line| *line == log), "{log:?} in its place");
    }
    // The report is of 9 s, and nothing is counted after 8 s.
    let health = **decoded.healths().last().expect("a report");
    let counted = [
        ("lost_edges", health.lost_edges),
        ("stuck_low", health.stuck_low),
        ("recoveries", health.recoveries),
        ("settling", health.settling),
        ("repeated", health.repeated),
    ];
    for (name, count) in counted {
        let start = format!("{name} +");
        let last = told.iter().rfind(|line| line.starts_with(&start)).unwrap_or_else(|| panic!("no line of {name}"));
        assert!(count > 0 && last.ends_with(&format!(": {count}")), "{last}, in the report {count}");
    }
}

/// The last words of a panic: an error, with its place.
#[test]
fn a_probe_reads_a_panic() {
    let events = vec![(0.25, Event::ClearInMemory(PERIOD))];
    let sensor = Some(Sensor::Published(31));
    let scenario = Scenario { sensor, events, seconds: 1.5, has_probe: true, ..Scenario::default() };
    let Outcome { log, .. } = run(image(), scenario);
    println!("{log:#?}");
    let LogLine { level, text } = log.iter().find(|line| line.text.starts_with("panic at ")).expect("the panic");
    assert!(level == "error" && text.contains("device.rs:") && text.ends_with("the sample period is 0"), "{text}");
}
