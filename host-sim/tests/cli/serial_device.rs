//! The command on a serial port: a pseudo-terminal that the firmware's application serves.

use crate::program::{imunoise, send};
use ::host_sim::monitor;
use recordings::serial::SerialLink;
use serial2::SerialPort;
use simulation::Device;
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use system_tests::pseudo_terminals;
use virtual_sensor::{NoiseModel, VirtualAdis16405};

/// A simulated device, which runs faster than real time and sends bytes that are no message once a second of its time.
struct NoisyDevice {
    device: Device,
    now_us: u64,
}

impl NoisyDevice {
    fn new() -> Self {
        let sensor = VirtualAdis16405::new(NoiseModel::paper(), 5);
        Self { device: Device::new(sensor, Device::blank_memory()), now_us: 0 }
    }

    /// Bytes that it sends in its next 10 ms.
    fn next(&mut self) -> Vec<u8> {
        self.now_us += 10_000;
        let mut sent = self.device.run_until(self.now_us);
        if self.now_us.is_multiple_of(1_000_000) {
            sent.extend(b"\xFFnoise\xFE\0");
        }
        sent
    }
}

/// A pseudo-terminal that a simulated device serves until this is dropped.
pub(crate) struct DevicePort {
    pub(crate) name: String,
    is_over: Arc<AtomicBool>,
    device: Option<JoinHandle<()>>,
    /// Keeps the port open.
    _far: SerialPort,
}

impl DevicePort {
    pub(crate) fn open() -> Self {
        let (mut near, far, name) = pseudo_terminals(Duration::from_millis(1));
        let is_over = Arc::new(AtomicBool::new(false));
        let done = Arc::clone(&is_over);
        let device = thread::spawn(move || {
            let (mut device, mut keys, mut unsent) = (NoisyDevice::new(), [0; 64], Vec::new());
            while !done.load(Relaxed) {
                match near.read(&mut keys) {
                    Ok(count) => device.device.press(&keys[..count]),
                    Err(error) => assert_eq!(error.kind(), ErrorKind::TimedOut),
                }
                // The device's time stands still until the program has read what was sent.
                if unsent.is_empty() {
                    unsent = device.next();
                }
                send(&mut near, &mut unsent);
            }
        });
        Self { name, is_over, device: Some(device), _far: far }
    }
}

impl Drop for DevicePort {
    fn drop(&mut self) {
        self.is_over.store(true, Relaxed);
        let ended = self.device.take().map(JoinHandle::join);
        assert!(thread::panicking() || ended.is_none_or(|ended| ended.is_ok()), "the device did not panic");
    }
}

/// Runs `imunoise` with these arguments, `PORT` replaced by the port of a simulated device, until it has printed all of `expected`, or to
/// its end where that is empty.
fn with_device(arguments: &[&str], expected: &[&str]) -> Output {
    let port = DevicePort::open();
    let mut program = Command::new(env!("CARGO_BIN_EXE_imunoise"))
        .args(arguments.iter().map(|&argument| if argument == "PORT" { &port.name } else { argument }))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    if !expected.is_empty() {
        let (mut printed, mut text, mut bytes) = (program.stdout.take().expect("a pipe"), String::new(), [0; 4096]);
        while !expected.iter().all(|words| text.contains(words)) {
            let count = printed.read(&mut bytes).expect("a pipe");
            assert!(count > 0, "the program ends: {text}");
            text += &String::from_utf8_lossy(&bytes[..count]);
        }
        program.kill().expect("an end");
    }
    program.wait_with_output().expect("an end")
}

/// A port whose device hangs up after 3 s of its time.
struct Port {
    device: NoisyDevice,
    sent: VecDeque<u8>,
}

impl Read for Port {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.device.now_us >= 3_000_000 {
            return Err(ErrorKind::BrokenPipe.into());
        }
        self.sent.extend(self.device.next());
        let count = self.sent.read(buffer)?;
        if count > 0 { Ok(count) } else { Err(ErrorKind::TimedOut.into()) }
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.device.device.press(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn the_monitor_shows_reports_and_counts_damaged_messages() {
    let expected =
        ["-- firmware", "ADIS16405, sampled", "gyro_x: ", "accl_z: ", "bursts used", "this list", "reports every 2 s"];
    with_device(&["monitor", "PORT", "--send", "i 2", "--send", "?"], &expected);
    // The same until the device hangs up, with the summary.
    let mut link = SerialLink::new(Port { device: NoisyDevice::new(), sent: VecDeque::new() });
    link.send_command("i 2").and_then(|()| link.send_command("?")).expect("a port");
    let mut text = Vec::new();
    monitor::show(&mut link, None, monitor::LONG_SILENCE, &mut text).expect("memory");
    let text = String::from_utf8(text).expect("text");
    for words in expected {
        assert!(text.contains(words), "{words}: {text}");
    }
    let summary = text.lines().last().expect("a summary");
    assert!(summary.contains(" 0 missing by their numbers") && !summary.contains(" 0 damaged"), "{summary}");
}

#[test]
fn a_recording_of_a_device_and_its_replay_have_the_same_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a name").to_owned();
    let (log, first, second) = (path("device.csv.gz"), path("first.json"), path("second.json"));
    let output = with_device(&["record", &log, "--port", "PORT", "--seconds", "20", "-o", &first], &[]);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");
    assert!(errors.contains(" 0 missing between them") && errors.contains(" 0 missing by their numbers"), "{errors}");
    assert!(imunoise(&["replay", &log, "-o", &second]).status.success());
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
        let output = imunoise(arguments);
        assert!(!output.status.success());
        assert!(String::from_utf8_lossy(&output.stderr).contains("/dev/no-such-port"));
    }
}
