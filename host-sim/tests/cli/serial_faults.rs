//! Recordings over a serial port that end early, and a device that is silent.

use crate::program::{imunoise, send, signal, with_default_signals};
use ::host_sim::monitor;
use recordings::serial::SerialLink;
use simulation::Device;
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{Output, Stdio};
use std::time::Duration;
use system_tests::pseudo_terminals;
use tempfile::tempdir;
use virtual_sensor::{NoiseModel, VirtualAdis16405};

/// Event of the device after so much of its own time.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    /// The program on the host gets this signal, and the device is silent then.
    Signal(&'static str),
    Silence,
}

const FAULT_AFTER_US: u64 = 5_000_000;

/// Records 20 s of a simulated device, which runs faster than real time, into `log`. Returns the output of the program and the
/// commands that the device received.
fn record(log: &Path, fault: Fault) -> (Output, String) {
    let (mut near, far, port) = pseudo_terminals(Duration::from_millis(1));
    let mut program = with_default_signals()
        .args(["record", log.to_str().expect("UTF-8"), "--force", "--port", &port, "--seconds", "20"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut device = Device::new(VirtualAdis16405::new(NoiseModel::paper(), 5), Device::blank_memory());
    let (mut now_us, mut interrupted, mut keys, mut received, mut unsent) = (0, false, [0; 64], Vec::new(), Vec::new());
    while program.try_wait().expect("a status").is_none() {
        if let Ok(count) = near.read(&mut keys) {
            received.extend_from_slice(&keys[..count]);
            device.press(&keys[..count]);
        }
        if interrupted {
            continue;
        }
        // The device's time stands still until the program has read what was sent.
        if !unsent.is_empty() {
            send(&mut near, &mut unsent);
            continue;
        }
        now_us += 10_000;
        unsent = device.run_until(now_us);
        if fault == Fault::Silence {
            unsent.clear();
        }
        if let Fault::Signal(name) = fault
            && now_us >= FAULT_AFTER_US
        {
            signal(&program, name);
            interrupted = true;
        }
    }
    // Bytes that were sent before the end.
    while let Ok(count) = near.read(&mut keys) {
        received.extend_from_slice(&keys[..count]);
    }
    let output = program.wait_with_output().expect("an end");
    drop(far);
    (output, String::from_utf8_lossy(&received).into_owned())
}

fn samples(log: &Path) -> u64 {
    let json = log.with_extension("json");
    let output = imunoise(&["replay", log.to_str().expect("UTF-8"), "-o", json.to_str().expect("UTF-8")]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(json).expect("a report")).expect("JSON");
    report["samples"].as_u64().expect("a number")
}

#[test]
fn an_interrupted_recording_is_finished_and_the_device_is_told() {
    for signal in ["INT", "TERM", "HUP"] {
        let dir = tempdir().expect("a folder");
        let log = dir.path().join("device.csv.gz");
        let (output, commands) = record(&log, Fault::Signal(signal));
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && errors.contains("interrupted"), "{errors}");
        assert!(commands.ends_with("w 0\r"), "{commands:?}");
        // 5 s at 204.8 samples per second, less what the terminal holds, 4 KiB of some 40 bytes a sample.
        let samples = samples(&log);
        assert!((900..=1030).contains(&samples), "{samples}");
    }
}

#[test]
fn a_file_is_kept_where_the_device_is_silent() {
    let dir = tempdir().expect("a folder");
    let log = dir.path().join("old.csv");
    std::fs::write(&log, "an older recording").expect("written");
    let (output, _) = record(&log, Fault::Silence);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && errors.contains("no bursts for 10 s"), "{errors}");
    assert_eq!(std::fs::read_to_string(&log).expect("the file"), "an older recording");
}

#[test]
fn impossible_durations_are_refused() {
    for seconds in ["nan", "inf", "0", "-1"].map(|seconds| format!("--seconds={seconds}")) {
        for command in [&["record", "x.csv", "--port", "p"][..], &["monitor", "p"], &["bench", "p"]] {
            let output = imunoise(&[command, &[&seconds]].concat());
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(
                output.status.code() == Some(2) && errors.contains("not a time above 0 s"),
                "{command:?}: {errors}"
            );
        }
    }
}

/// A device whose text, in a message and in the crash record of its start, has sequences that a terminal obeys.
fn hostile_messages() -> [link::Message; 2] {
    let boot = link::Boot { crash_record: text("\x1b[2J\x07panic at app.rs:7"), ..link::Boot::default() };
    let hello = link::Hello {
        firmware: (1, 2, 3),
        product_id: 0x4015,
        gyro_full_scale: 300,
        filter_taps_log2: 4,
        sample_rate_hz: 204.8,
        measured_rate_hz: None,
        spi_clock_hz: 1_000_000,
        uptime_us: 1_500_000,
        sampling: true,
        epoch: 0,
        epoch_s: 0,
        boot,
    };
    [link::Message::Hello(hello), link::Message::Log(text("\x1b]0;title\x07 of a message"))]
}

fn text(text: &str) -> link::TextLine {
    text.try_into().expect("a short text")
}

/// A device may send any bytes: those that a terminal obeys are shown, not sent on.
#[test]
fn escape_sequences_of_a_device_do_not_reach_the_terminal() {
    struct Port(VecDeque<u8>);
    impl Read for Port {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            self.0.read(buffer)
        }
    }
    impl Write for Port {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let (mut encoder, mut bytes) = (link::Encoder::new(), VecDeque::new());
    for message in &hostile_messages() {
        encoder.encode(message.into(), &mut |sent| bytes.extend(sent));
    }
    let mut text = Vec::new();
    monitor::show(&mut SerialLink::new(Port(bytes)), None, monitor::LONG_SILENCE, &mut text).expect("memory");
    let text = String::from_utf8(text).expect("text");
    for expected in ["crash record: ", "panic at app.rs:7", "title"] {
        assert!(text.contains(expected), "{expected}: {text:?}");
    }
    assert!(!text.contains(['\u{1b}', '\u{7}']), "{text:?}");
}

/// A device that says nothing: the monitor ends after its time, with its summary.
#[test]
fn the_monitor_ends_after_its_time() {
    let (_near, _far, port) = pseudo_terminals(Duration::from_millis(1));
    let output = imunoise(&["monitor", &port, "--seconds", "0.1"]);
    assert!(output.status.success() && String::from_utf8_lossy(&output.stdout).starts_with("0 messages, "));
}
