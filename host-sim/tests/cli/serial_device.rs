//! The command on a serial port: a pseudo-terminal that the firmware's application serves.

use crate::program::host_sim;
use serialport::{SerialPort, TTYPort};
use simulation::Device;
use std::io::{ErrorKind, Read, Write};
use std::process::Output;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::Duration;
use virtual_sensor::{NoiseModel, VirtualAdis16405};

/// Runs `host-sim` with these arguments, `PORT` replaced by the port of a simulated device. The device runs faster than real
/// time and sends bytes that are no message once a second of its time.
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
            // The program may have closed the port.
            let _ = near.write_all(&sent);
        }
    });
    let with_port = |&argument: &&str| if argument == "PORT" { port.clone() } else { argument.to_owned() };
    let arguments: Vec<String> = arguments.iter().map(with_port).collect();
    let output = host_sim(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    over.store(true, Relaxed);
    device.join().expect("the device did not panic");
    drop(far);
    output
}

#[test]
fn the_monitor_shows_reports_and_counts_damaged_messages() {
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
fn a_recording_of_a_device_and_its_replay_have_the_same_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a name").to_owned();
    let (log, first, second) = (path("device.csv.gz"), path("first.json"), path("second.json"));
    let output = with_device(&["record", &log, "--port", "PORT", "--seconds", "20", "--json", &first]);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");
    assert!(errors.contains(" 0 missing between them") && errors.contains(" 0 missing by their numbers"), "{errors}");
    assert!(host_sim(&["replay", &log, "--json", &second]).status.success());
    let [first, second] = [first, second].map(|file| std::fs::read_to_string(file).expect("a report"));
    assert_eq!(first, second);
    let report: serde_json::Value = serde_json::from_str(&first).expect("JSON");
    let (rate, samples) = (report["sample_rate_hz"].as_f64().unwrap(), report["samples"].as_u64().unwrap());
    assert!((rate / 204.8 - 1.0).abs() < 1e-4, "{rate}");
    assert!((4096..4200).contains(&samples), "{samples}");
    assert_eq!(report["dropped"]["gap"], 0);
}

#[test]
fn the_error_names_a_port_that_does_not_exist() {
    for arguments in
        [&["monitor", "/dev/no-such-port"][..], &["record", "/tmp/never.csv", "--port", "/dev/no-such-port"]]
    {
        let output = host_sim(arguments);
        assert!(!output.status.success());
        assert!(String::from_utf8_lossy(&output.stderr).contains("/dev/no-such-port"));
    }
}
