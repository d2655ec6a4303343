//! The command line at the end of a cable: a pseudo-terminal with the firmware's application behind it.

use serialport::{SerialPort, TTYPort};
use simulation::Device;
use std::io::{ErrorKind, Read, Write};
use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::Duration;
use virtual_sensor::{NoiseModel, VirtualAdis16405};

/// Runs `host-sim` with these arguments, `PORT` replaced by that of a device whose time goes ten times as fast and whose
/// line has noise on it now and then.
fn with_device(arguments: &[&str]) -> Output {
    let (mut near, far) = TTYPort::pair().expect("a pseudo-terminal");
    let port = far.name().expect("a name");
    near.set_timeout(Duration::from_millis(1)).expect("a timeout");
    let over = Arc::new(AtomicBool::new(false));
    let done = Arc::clone(&over);
    let device = thread::spawn(move || {
        let mut device = Device::new(VirtualAdis16405::new(NoiseModel::paper(), 5), Device::blank_memory());
        let (mut now_us, mut keys) = (0, [0; 64]);
        while !done.load(Relaxed) {
            match near.read(&mut keys) {
                Ok(count) => device.press(&keys[..count]),
                Err(error) => assert_eq!(error.kind(), ErrorKind::TimedOut),
            }
            now_us += 10_000;
            let mut sent = device.run_until(now_us);
            if now_us % 1_000_000 == 0 {
                sent.extend(b"\xFFnoise\xFE\0");
            }
            // Nobody may be listening any more.
            let _ = near.write_all(&sent);
        }
    });
    let arguments = arguments.iter().map(|&argument| if argument == "PORT" { port.as_str() } else { argument });
    let output = Command::new(env!("CARGO_BIN_EXE_host-sim")).args(arguments).output().expect("host-sim runs");
    over.store(true, Relaxed);
    device.join().expect("the device goes on");
    drop(far);
    output
}

#[test]
fn the_monitor_shows_reports_and_counts_noise() {
    let output = with_device(&["monitor", "PORT", "--seconds", "3", "--send", "i 2", "--send", "?"]);
    let text = String::from_utf8(output.stdout).expect("text");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for expected in
        ["-- firmware", "ADIS16405, sampled", "gyro_x: ", "accl_z: ", "bursts used", "this list", "reports every 2 s"]
    {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    let summary = text.lines().last().expect("a summary");
    assert!(summary.contains(" 0 missing by their numbers") && !summary.contains(" 0 damaged"), "{summary}");
}

#[test]
fn a_recording_off_the_cable_is_analysed_and_replayed_alike() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a name").to_owned();
    let (log, first, second) = (path("cable.csv.gz"), path("first.json"), path("second.json"));
    let output = with_device(&["record", &log, "--port", "PORT", "--seconds", "20", "--json", &first]);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");
    assert!(errors.contains(" 0 missing between them") && errors.contains(" 0 missing by their numbers"), "{errors}");
    let replay = Command::new(env!("CARGO_BIN_EXE_host-sim")).args(["replay", &log, "--json", &second]).output();
    assert!(replay.expect("host-sim runs").status.success());
    let [first, second] = [first, second].map(|file| std::fs::read_to_string(file).expect("a report"));
    assert_eq!(first, second);
    let report: serde_json::Value = serde_json::from_str(&first).expect("JSON");
    let (rate, samples) = (report["sample_rate_hz"].as_f64().unwrap(), report["samples"].as_u64().unwrap());
    assert!((rate / 204.8 - 1.0).abs() < 1e-4, "{rate}");
    assert!((4096..4200).contains(&samples), "{samples}");
    assert_eq!(report["dropped"]["gap"], 0);
}

#[test]
fn a_port_that_is_none_is_named() {
    for arguments in
        [&["monitor", "/dev/no-such-port"][..], &["record", "/tmp/never.csv", "--port", "/dev/no-such-port"]]
    {
        let output = Command::new(env!("CARGO_BIN_EXE_host-sim")).args(arguments).output().expect("host-sim runs");
        assert!(!output.status.success());
        assert!(String::from_utf8_lossy(&output.stderr).contains("/dev/no-such-port"));
    }
}
