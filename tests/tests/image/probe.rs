//! What a debug probe on the bench reads: the log that the image leaves in its memory (RTT), decoded by the table of formats in its ELF.

use crate::bench::{Event, Outcome, Scenario, image, run};
use crate::decoded::Decoded;
use crate::faults::PERIOD;
use crate::microcontroller::RAM;
use crate::peripherals::Sensor;
use defmt_decoder::{DecodeError, Table};
use rigless::emulator::Host;
use rigless::soc::Width;
use std::path::Path;

/// The first words of the block by which a probe finds the buffers: "SEGGER R".
const IDENTIFIER: [u64; 2] = [0x4747_4553, 0x5220_5245];
/// Offsets of the first buffer of bytes from the target in the block: its address, its size, and the offsets to which the target has
/// written and the probe has read.
const BUFFER: u64 = 28;
const SIZE: u64 = 32;
const WRITTEN: u64 = 36;
const READ: u64 = 40;

/// Takes the bytes of the log out of the memory of the image, as often as it is asked to.
#[derive(Debug, Default)]
pub(crate) struct Probe {
    block: Option<u64>,
    pub(crate) bytes: Vec<u8>,
}

impl Probe {
    pub(crate) fn poll(&mut self, host: &mut dyn Host) {
        let word = |host: &mut dyn Host, at| host.read(at, Width::W32).expect("memory");
        if self.block.is_none() {
            self.block = RAM.step_by(4).find(|at| [0, 4].map(|offset| word(host, at + offset)) == IDENTIFIER);
        }
        let Some(block) = self.block else { return };
        let [buffer, size, written, mut read] = [BUFFER, SIZE, WRITTEN, READ].map(|offset| word(host, block + offset));
        while read != written {
            self.bytes.push(host.read(buffer + read, Width::W8).expect("memory") as u8);
            read = (read + 1) % size;
        }
        host.write(block + READ, Width::W32, read).expect("memory");
    }
}

/// The log's lines with their levels.
fn lines(image: &Path, bytes: &[u8]) -> Vec<(String, String)> {
    let elf = std::fs::read(image).expect("the image");
    let table = Table::parse(&elf).expect("an ELF").expect("a table of formats");
    let mut decoder = table.new_stream_decoder();
    decoder.received(bytes);
    let mut lines = Vec::new();
    loop {
        match decoder.decode() {
            Ok(frame) => {
                lines.push((frame.level().expect("a level").as_str().to_owned(), frame.display_message().to_string()))
            }
            Err(DecodeError::UnexpectedEof) => return lines,
            Err(DecodeError::Malformed) => panic!("after {lines:#?}"),
        }
    }
}

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
    let sensor = Some(Sensor::published(30));
    let scenario = Scenario { sensor, keys, events, seconds: 11.5, has_probe: true, ..Scenario::default() };
    let Outcome { received, log, .. } = run(image(), scenario);
    let lines = lines(image(), &log);
    println!("{lines:#?}");
    assert!(lines.iter().all(|(level, _)| level == "info"));
    let told: Vec<&str> = lines.iter().map(|(_, line)| line.as_str()).collect();
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
    let sensor = Some(Sensor::published(31));
    let scenario = Scenario { sensor, events, seconds: 1.5, has_probe: true, ..Scenario::default() };
    let Outcome { log, .. } = run(image(), scenario);
    let lines = lines(image(), &log);
    println!("{lines:#?}");
    let (level, line) = lines.iter().find(|(_, line)| line.starts_with("panic at ")).expect("the panic");
    assert!(level == "error" && line.contains("device.rs:") && line.ends_with("the sample period is 0"), "{line}");
}
