//! The image in rp2040js under Node, with the virtual sensor on its bus, in the emulator's time.

use crate::build;
use adis16405_driver::BURST_BYTES;
use host_sim::uf2;
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use virtual_sensor::VirtualAdis16405;

/// rp2040js and the image, as ELF and as UF2.
struct Bench {
    emulator: PathBuf,
    elf: PathBuf,
    uf2: PathBuf,
}

/// Built at most once a run.
fn bench() -> &'static Bench {
    static BENCH: OnceLock<Bench> = OnceLock::new();
    BENCH.get_or_init(|| {
        let elf = build::image("pico", "thumbv6m-none-eabi");
        let blocks = uf2::from_elf(&std::fs::read(&elf).expect("the image")).expect("an image for the Pico");
        let uf2 = elf.with_extension("uf2");
        std::fs::write(&uf2, blocks).expect("room");
        Bench { emulator: emulator(), elf, uf2 }
    })
}

fn emulator() -> PathBuf {
    let folder = build::folder().join("rp2040js");
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

/// What happens to the sensor during a run.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Event {
    /// It resets itself, as after a dip of its supply.
    PartReset,
    /// The data line to the processor is held at this byte, or let go.
    Stuck(Option<u8>),
    /// Data-ready edges do not reach the processor, or do again.
    Unheard(bool),
}

/// What a run leaves to look at.
pub(crate) struct Outcome {
    pub(crate) part: VirtualAdis16405,
    /// What the processor was sent in each burst, with the number of the sample that the part had then.
    pub(crate) bursts: Vec<(u64, [u8; BURST_BYTES])>,
    pub(crate) received: Vec<(u64, u8)>,
    pub(crate) instructions: u64,
    pub(crate) complaints: String,
}

/// Boots the image from its UF2. `keys` are as `TIME=TEXT`, `events` by rising time in s.
pub(crate) fn run(mut part: VirtualAdis16405, seconds: f64, keys: &[&str], events: &[(f64, Event)]) -> Outcome {
    let Bench { emulator, elf, uf2 } = bench();
    let mut events: VecDeque<(u64, Event)> = events.iter().map(|&(at, event)| ((at * 1e9) as u64, event)).collect();
    let (mut stuck, mut unheard) = (None, false);
    let (mut announced, mut selected) = (0, false);
    let mut node = Command::new("node")
        .arg(build::workspace().join("tests/tests/pico/emulator.mjs"))
        .args([emulator, uf2, elf])
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
        // Between frames; the sensor is asked for its time once a millisecond at least.
        if kind == b'n'
            && !selected
            && let Some((_, event)) = events.pop_front_if(|&mut (at, _)| value as u64 >= at)
        {
            match event {
                Event::PartReset => {
                    part.select();
                    part.transfer(0xBE80); // GLOB_CMD bit 7
                    part.deselect();
                }
                Event::Stuck(byte) => stuck = byte,
                Event::Unheard(on) => unheard = on,
            }
        }
        match kind {
            b's' => {
                selected = true;
                part.select();
                frame.clear();
            }
            b'd' => {
                selected = false;
                part.deselect();
                let sent: Vec<u8> = frame.iter().map(|&(_, miso)| miso).collect();
                if frame.first().is_some_and(|&(mosi, _)| mosi == 0x3E)
                    && let Ok(burst) = sent.try_into()
                {
                    bursts.push((part.samples(), burst));
                }
            }
            b'b' => {
                let answer = part.transfer_byte(byte[0]);
                let miso = stuck.unwrap_or(answer);
                frame.push((byte[0], miso));
                answers.write_all(&[miso]).expect("the emulator listens");
            }
            b'n' => {
                let next = part.next_data_ready() as f64;
                announced = if unheard { announced } else { part.samples() };
                let answer = [(announced as f64).to_le_bytes(), next.to_le_bytes()];
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
