//! The wires from the sensor to the boards, and the levels: one table and one sentence, the same on every page and in
//! every source.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use system_tests::{generated, workspace};

/// A wire.
struct Wire {
    /// Pins of the sensor and their name (ADIS16400/ADIS16405 data sheet Rev. B, Table 5).
    sensor: (&'static str, &'static str),
    /// Pin of the Pico, as numbered on its board (Raspberry Pi Pico data sheet, Figure 4), and its name.
    pico: (&'static str, &'static str),
    h405: &'static str,
    feather: &'static str,
}

const WIRES: [Wire; 7] = [
    Wire { sensor: ("10, 11, 12", "VCC"), pico: ("40", "VBUS, the 5 V of USB"), h405: "5 V", feather: "USB" },
    Wire { sensor: ("13, 14, 15", "GND"), pico: ("38", "GND"), h405: "GND", feather: "GND" },
    Wire { sensor: ("3", "SCLK"), pico: ("24", "GP18"), h405: "PA5", feather: "A1 (PA5)" },
    Wire { sensor: ("4", "DOUT"), pico: ("21", "GP16"), h405: "PA6", feather: "A2 (PA6)" },
    Wire { sensor: ("5", "DIN"), pico: ("25", "GP19"), h405: "PA7", feather: "A3 (PA7)" },
    Wire { sensor: ("6", "CS"), pico: ("22", "GP17"), h405: "PA4", feather: "A0 (PA4)" },
    Wire { sensor: ("7", "DIO1, data ready"), pico: ("26", "GP20"), h405: "PB0", feather: "A4 (PC4)" },
];

/// The levels, in lines of Markdown.
const LEVELS: &str = "\
The sensor runs from 5 V and drives its outputs from an internal 3.3 V: connect every signal directly, without a divider or a
level shifter (data sheet Rev. B, page 5).";

/// Wrong sentences on levels.
const WRONG: [&str; 4] = ["5 V tolerant", "tolerate 5 V", "may drive 5 V", "may reach 5 V"];

#[test]
fn the_wires_and_levels_are_in_the_docs() {
    let mut pico = "| sensor | | Pico | |\n|---|---|---|---|\n".to_owned();
    let mut all = "| sensor | | Pico | | STM32-H405 | Feather STM32F405 |\n|---|---|---|---|---|---|\n".to_owned();
    for Wire { sensor: (pins, name), pico: (pin, signal), h405, feather } in WIRES {
        writeln!(pico, "| {pins} | {name} | {pin} | {signal} |").expect("memory");
        writeln!(all, "| {pins} | {name} | {pin} | {signal} | {h405} | {feather} |").expect("memory");
    }
    generated("README.md", "wires", &pico);
    generated("docs/device.md", "wires", &all);
    for page in ["README.md", "docs/device.md", "adis16405-driver/README.md"] {
        generated(page, "levels", LEVELS);
    }
}

/// The pin of a board to which a wire goes.
type PinOfBoard = fn(&Wire) -> &str;

/// The sources of the images state the pin of each signal, which must be that of the table.
#[test]
fn the_wires_are_those_of_the_images() {
    let boards: [(&str, PinOfBoard); 3] = [
        ("microcontroller/rp2040/wires.rs", |wire| wire.pico.1),
        ("bin/observatory-h405.rs", |wire| wire.h405),
        ("bin/observatory-feather.rs", |wire| wire.feather.split(' ').next().unwrap_or_default()),
    ];
    for (board, pin) in boards {
        let source = std::fs::read_to_string(workspace().join("firmware/src").join(board)).expect("a board");
        let mut pins = BTreeMap::new();
        for line in source.lines().filter_map(|line| line.strip_prefix("//! | ")) {
            let cells: Vec<&str> = line.trim_end_matches(" |").split(" | ").collect();
            let [pins_of_board, .., signals] = cells[..] else { continue };
            pins.extend(signals.split(", ").zip(pins_of_board.split(", ")));
        }
        for wire in &WIRES[2..] {
            let signal = wire.sensor.1.split(',').next().unwrap_or_default();
            assert_eq!(pins.get(signal), Some(&pin(wire)), "{board}: {signal}");
        }
    }
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if path.is_dir() && !name.starts_with('.') && name != "target" {
            sources(&path, found);
        } else if name.ends_with(".rs") || name.ends_with(".md") {
            found.push(path);
        }
    }
}

/// The words of a text without comment marks, tables and Markdown.
fn words(text: &str) -> String {
    let words = text.split_whitespace().filter(|word| !["//!", "///", "//", "|"].contains(word));
    words.collect::<Vec<_>>().join(" ")
}

/// Pins that "may drive 5 V" would get a divider, through which the sensor cannot be read.
#[test]
fn one_sentence_on_levels_stands_everywhere() {
    let levels = words(LEVELS);
    let mut files = Vec::new();
    for folder in ["docs", "adis16405-driver", "allan-core", "firmware", "tests/tests/boards", "tests/emulation"] {
        sources(&workspace().join(folder), &mut files);
    }
    files.push(workspace().join("README.md"));
    let mut stated = 0;
    for file in files {
        let text = words(&std::fs::read_to_string(&file).expect("UTF-8"));
        stated += text.matches(&levels).count();
        let rest = text.replace(&levels, "");
        for wrong in WRONG.into_iter().chain(["without a divider", "through a divider"]) {
            assert!(!rest.contains(wrong), "{}: {wrong:?} is not the sentence on levels", file.display());
        }
    }
    // These are three pages, five examples of the driver and three boards.
    assert!(stated >= 8, "{stated}");
}
