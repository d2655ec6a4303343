//! What a debug probe on the bench reads: the log that the image leaves in its memory (RTT), decoded by the table of formats in its ELF.

use super::bench::{image, run};
use super::decoded::Decoded;
use super::faults::PERIOD;
use emulation::{Event, LogLine, Outcome, Probe, Scenario, Sensor};

/// The start, what happens to the sensor and what is done about it, by names and with levels, and every counter of events that rises.
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
    let scenario = Scenario { sensor, keys, events, seconds: 11.5, probe: Some(Probe::Reads), ..Scenario::default() };
    let Outcome { received, log, .. } = run(image(), scenario);
    println!("{log:#?}");
    let mut after = log.iter();
    let expected = [
        ("info", "start by power-on, crystal true, crash record: "),
        ("info", "ADIS16405, self-test Some(passed)"),
        ("info", "sensor Sampled { since_us: "),
        ("warn", "sensor in trouble: NoEdges"),
        ("warn", "recovery step Reread"),
        ("info", "sensor Sampled"),
        ("warn", "sensor in trouble: Unusable(stuck_low)"),
        ("warn", "recovery step Reread"),
        ("warn", "recovery step BusReset"),
        ("info", "sensor Sampled"),
    ];
    for (level, text) in expected {
        assert!(after.any(|line| line.level == level && line.text.starts_with(text)), "{level} {text} in its place");
    }
    // The report is of 9 s, and nothing is counted after 8 s.
    let decoded = Decoded::decode(&received);
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
        let last =
            log.iter().rfind(|line| line.text.starts_with(&start)).unwrap_or_else(|| panic!("no line of {name}"));
        assert!(count > 0 && last.text.ends_with(&format!(": {count}")), "{last:?}, in the report {count}");
    }
}

/// A panic is an error, with its place.
#[test]
fn a_probe_reads_a_panic() {
    let events = vec![(0.25, Event::ClearInMemory(PERIOD))];
    let sensor = Some(Sensor::Published(31));
    let scenario = Scenario { sensor, events, seconds: 1.5, probe: Some(Probe::Reads), ..Scenario::default() };
    let Outcome { log, .. } = run(image(), scenario);
    println!("{log:#?}");
    let LogLine { level, text } = log.iter().find(|line| line.text.starts_with("panic at ")).expect("the panic");
    assert!(level == "error" && text.contains("device.rs:"), "{text}");
}

/// A probe that has stalled, or was pulled off, asks the image to wait for it: no sample is lost, and every answer comes.
#[test]
fn a_probe_that_does_not_read_costs_no_sample() {
    let typed = [(1.5, "i 0\rf 819.2\r"), (2.5, "?"), (3.0, "k"), (3.5, "t"), (5.0, "r")];
    let keys = typed.map(|(at_s, keys)| (at_s, keys.as_bytes().to_vec())).to_vec();
    let sensor = Some(Sensor::Published(32));
    let scenario = Scenario { sensor, keys, seconds: 7.5, probe: Some(Probe::Stalls), ..Scenario::default() };
    let Outcome { received, diagnostics, .. } = run(image(), scenario);
    assert_eq!(diagnostics, [""; 0], "no restart");
    let decoded = Decoded::decode(&received);
    let health = **decoded.healths().last().expect("a report");
    assert_eq!((health.lost_edges, health.queue_full, health.recoveries), (0, 0, 0), "{health:?}");
    assert_eq!((health.used, health.serial_overruns), (health.bursts, 0), "{health:?}");
}
