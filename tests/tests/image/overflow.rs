//! A stack that is too small: it faults, destroys nothing, and the next start says so.

use crate::bench::{Outcome, Scenario, run};
use crate::decoded::Decoded;
use crate::{build, image, sensor};
use std::path::PathBuf;

/// The image, but for where its stack begins: the first word of the vector table, which the processor loads.
fn with_stack(bytes: u32) -> PathBuf {
    const FLASH: u32 = 0x0800_0000;
    const RAM: u32 = 0x2000_0000;
    let mut elf = std::fs::read(image()).expect("the image");
    let word = |at: usize| u32::from_le_bytes(elf[at..at + 4].try_into().expect("4 bytes"));
    let segments = usize::from(u16::from_le_bytes([elf[44], elf[45]]));
    // The program headers of a 32-bit ELF: at 4 the offset in the file, at 12 the physical address, at 16 the size.
    let mut headers = (0..segments).map(|segment| word(28) as usize + 32 * segment);
    let table = headers.find(|&header| word(header + 12) == FLASH && word(header + 16) > 0).expect("a vector table");
    let at = word(table + 4) as usize;
    elf[at..at + 4].copy_from_slice(&(RAM + bytes).to_le_bytes());
    std::fs::create_dir_all(build::folder()).expect("a folder");
    let shallow = build::folder().join(format!("observatory-f405-stack-{bytes}"));
    std::fs::write(&shallow, elf).expect("room");
    shallow
}

/// A report takes more than there is; all else goes on as before, the statistics from where they were.
#[test]
fn an_overflow_faults_and_the_next_start_says_so() {
    let asked = |keys: &str| (1.5, keys.as_bytes().to_vec());
    let quiet = (0.1, b"i 0\r".to_vec());
    let scenario = |keys| Scenario { sensor: Some(sensor(5)), keys, seconds: 5.0, ..Scenario::default() };
    let whole = run(image(), scenario(vec![quiet.clone(), asked("r")]));
    let used = Decoded::of(&whole.received).healths()[0].stack_bytes;

    let shallow = with_stack((used - 1024) & !7);
    let keys = vec![quiet, asked("r"), (3.5, b"s".to_vec()), (4.5, b"k".to_vec())];
    let Outcome { sensor, received, complaints, .. } = run(&shallow, scenario(keys));
    let lines = Decoded::of(&received).lines;
    println!("{used} B of stack would do; {complaints:?}; {lines:#?}");
    assert_eq!(complaints.iter().filter(|complaint| complaint.starts_with("reset")).count(), 1, "{complaints:?}");
    for expected in ["start 2: Software, 8 channels restored", "crash record: stack overflow", "sensor sampled"] {
        assert!(lines.iter().any(|line| line.contains(expected)), "{expected}: {lines:?}");
    }
    // Bursts at 204.8 SPS since a restart that took less than a quarter of a second, all of them used.
    let counter = |name: &str| {
        let number = |line: &String| line.strip_prefix(name)?.strip_prefix(' ')?.parse().ok();
        lines.iter().find_map(number).unwrap_or(0_u32)
    };
    assert_eq!(counter("used"), counter("bursts"));
    assert!(counter("lost_edges") == 0 && counter("bursts") > 300, "{lines:?}");
    assert!(sensor.is_some_and(|sensor| sensor.part.violations().is_empty()));
}
