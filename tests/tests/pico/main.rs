//! The image that one flashes on a Raspberry Pi Pico, run in the emulator rp2040js (npm) under Node against the virtual
//! sensor: another core, without a floating-point unit, and the same numbers.

#[allow(dead_code, reason = "the test of the other image uses the rest")]
#[path = "../image/decoded.rs"]
mod decoded;

use adis16405_driver::BURST_BYTES;
use decoded::{Decoded, on_host};
use host_sim::sensor::{NoiseModel, VirtualAdis16405};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const TARGET: &str = "thumbv6m-none-eabi";
const RATE_HZ: f64 = 204.8;

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests live inside the workspace")
}

/// A directory of its own: the tests' own cargo may hold the lock of the other one.
fn target() -> PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace().join("target"), PathBuf::from);
    workspace().join(target).join("image")
}

fn image() -> PathBuf {
    let status = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(workspace())
        .args(["build", "--package", "firmware", "--bin", "observatory-pico", "--features", "board-pico"])
        .args(["--target", TARGET, "--profile", "image", "--locked", "--target-dir"])
        .arg(target())
        .status()
        .expect("cargo starts");
    assert!(status.success(), "the image does not build; its target comes with `rustup target add {TARGET}`");
    target().join(TARGET).join("image/observatory-pico")
}

fn emulator() -> PathBuf {
    let folder = target().join("rp2040js");
    if !folder.join("node_modules/rp2040js").is_dir() {
        std::fs::create_dir_all(&folder).expect("a folder");
        let install = Command::new("npm")
            .args(["install", "--no-save", "--no-audit", "--no-fund", "--prefix"])
            .arg(&folder)
            .arg("rp2040js@1.4.1")
            .status();
        assert!(install.is_ok_and(|status| status.success()), "rp2040js cannot be had: install Node.js 20 with npm");
    }
    folder
}

/// What a run leaves to look at.
struct Outcome {
    part: VirtualAdis16405,
    /// What the part answered in each burst, with the number of the sample that it had then.
    bursts: Vec<(u64, [u8; BURST_BYTES])>,
    received: Vec<(u64, u8)>,
    instructions: u64,
    complaints: String,
}

fn run(mut part: VirtualAdis16405, seconds: f64, keys: &[&str]) -> Outcome {
    let mut node = Command::new("node")
        .arg(workspace().join("tests/tests/pico/emulator.mjs"))
        .args([emulator(), image()])
        .arg(seconds.to_string())
        .args(keys)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("Node.js starts; install Node.js 20");
    let (mut answers, mut questions) = (node.stdin.take().expect("a pipe"), node.stdout.take().expect("a pipe"));
    let (mut bursts, mut received, mut frame) = (Vec::new(), Vec::new(), Vec::new());
    let mut instructions = 0;
    let mut question = [0; 9];
    while questions.read_exact(&mut question).is_ok() {
        let [kind, value @ ..] = question;
        let value = f64::from_le_bytes(value);
        let mut byte = [0];
        if matches!(kind, b'b' | b'u') {
            questions.read_exact(&mut byte).expect("a byte");
        }
        if kind == b'e' {
            instructions = value as u64;
            continue;
        }
        part.advance_to(value as u64);
        match kind {
            b's' => {
                part.select();
                frame.clear();
            }
            b'd' => {
                part.deselect();
                let sent: Vec<u8> = frame.iter().map(|&(_, miso)| miso).collect();
                if frame.first().is_some_and(|&(mosi, _)| mosi == 0x3E)
                    && let Ok(burst) = sent.try_into()
                {
                    bursts.push((part.samples(), burst));
                }
            }
            b'b' => {
                let miso = part.transfer_byte(byte[0]);
                frame.push((byte[0], miso));
                answers.write_all(&[miso]).expect("the emulator listens");
            }
            b'n' => {
                let next = part.next_data_ready() as f64;
                let answer = [(part.samples() as f64).to_le_bytes(), next.to_le_bytes()];
                answers.write_all(answer.as_flattened()).expect("the emulator listens");
            }
            _ => received.push((value as u64, byte[0])),
        }
    }
    let output = node.wait_with_output().expect("the emulator ends");
    let complaints = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{complaints}");
    Outcome { part, bursts, received, instructions, complaints }
}

#[test]
fn the_pico_reports_what_the_host_computes_from_the_same_counts() {
    const SECONDS: f64 = 10.0;
    let outcome = run(VirtualAdis16405::new(NoiseModel::paper(), 6), SECONDS, &["1.0=i 0\r", "2.0=r"]);
    println!("{} instructions in {SECONDS} s; {}", outcome.instructions, outcome.complaints);
    let (bursts, part) = (&outcome.bursts, &outcome.part);
    // Between frames 16 us pass; the clock is not judged here but by the firmware itself.
    assert_eq!(part.violations(), []);
    assert!(bursts.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1), "every sample is read once");
    assert!(bursts.len() as f64 > (SECONDS - 0.2) * RATE_HZ, "{} bursts", bursts.len());

    let decoded = Decoded::of(&outcome.received);
    assert_eq!((decoded.counters.bad_frames, decoded.counters.missing), (0, 0), "{:?}", decoded.counters);
    assert!(decoded.logs()[0].starts_with("sensor: ADIS16405, self-test"), "{:?}", decoded.logs());
    let hello = decoded.hellos()[0];
    assert_eq!((hello.product_id, hello.sample_rate_hz, hello.sampling), (16405, RATE_HZ, true));
    assert!(hello.spi_clock_hz <= 1_000_000, "{hello:?}");
    assert_eq!(decoded.channels().len(), 8, "a whole report");
    for report in decoded.channels() {
        assert!(report.samples as f64 > 1.8 * RATE_HZ && report.missing == 0, "{report:?}");
        assert_eq!(*report, on_host(bursts, RATE_HZ, report), "bit for bit");
    }
    let health = decoded.healths()[0];
    assert_eq!((health.used, health.lost_edges, health.queue_full), (health.bursts, 0, 0), "{health:?}");
    println!("{health:?}");
}
