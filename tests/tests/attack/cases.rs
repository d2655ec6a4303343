//! The kinds of attack.

use super::program::{Program, Run};
use super::recordings::{FORMS, Noise, Recorded, TEXTS, zipped};
use super::report::{baseline_term, contradiction};
use crate::recordings::but_reading;
use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::Duration;
use system_tests::{FlightLog, pseudo_terminals};
use tempfile::TempDir;

/// A kind of attack: its name and its function.
type Kind = (&'static str, fn(&mut Campaign, &mut ChaCha8Rng));

pub(crate) const KINDS: [Kind; 13] = [
    ("clean records", clean_record),
    ("mutated bytes", mutated_bytes),
    ("mutated lines", mutated_lines),
    ("clocks", clock),
    ("losses", losses),
    ("bombs", bomb),
    ("nested structures", nested),
    ("arguments", arguments),
    ("mutated reports", mutated_report),
    ("replay and conversion", replay_and_conversion),
    ("full disks", full_disk),
    ("signals", interrupted),
    ("pseudo-terminals", terminal),
];

/// Exit codes of what reads a file: all of it, none of it, or not to its end.
const READ: [i32; 3] = [0, 1, 3];
/// Fraction of the intervals that contain the true value.
const COVERAGE: f64 = 0.95;

/// Findings of a campaign.
pub(crate) struct Campaign {
    folder: TempDir,
    case: u64,
    kind: &'static str,
    runs: BTreeMap<&'static str, u64>,
    faults: Vec<String>,
    /// Number of intervals of N in clean records, and how many of them contain the true value.
    intervals: u64,
    held: u64,
}

impl Campaign {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        Self { folder, case: 0, kind: "", runs: BTreeMap::new(), faults: Vec::new(), intervals: 0, held: 0 }
    }

    /// Runs a case.
    pub(crate) fn run(&mut self, case: u64) {
        let (kind, run) = KINDS[(case % KINDS.len() as u64) as usize];
        self.folder = tempfile::tempdir().expect("a folder");
        (self.case, self.kind) = (case, kind);
        run(self, &mut ChaCha8Rng::seed_from_u64(case));
    }

    fn folder(&self) -> &Path {
        self.folder.path()
    }

    fn write(&self, name: &str, bytes: &[u8]) -> String {
        let file = self.folder().join(name);
        std::fs::write(&file, bytes).expect("written");
        file.to_str().expect("UTF-8").to_owned()
    }

    fn fault(&mut self, what: impl fmt::Display) {
        self.faults.push(format!("case {}, {}: {what}", self.case, self.kind));
    }

    fn require(&mut self, holds: bool, what: impl fmt::Display) {
        if !holds {
            self.fault(what);
        }
    }

    /// Runs the program on `bytes` bytes of input, and checks the properties of every run.
    fn checked(&mut self, program: &Program, codes: &[i32], bytes: u64) -> Run {
        let run = program.run();
        self.check(&run, &program.arguments.join(" "), codes, bytes);
        run
    }

    fn check(&mut self, run: &Run, arguments: &str, codes: &[i32], bytes: u64) {
        *self.runs.entry(self.kind).or_insert(0) += 1;
        if let Some(fault) = run.fault(codes, bytes) {
            let errors: String = run.errors.chars().take(600).collect();
            self.fault(format!("{fault}: {arguments}: {errors}"));
        }
    }

    /// The report of a run, if it has one; its figures must be consistent.
    fn report(&mut self, run: &Run) -> Option<Value> {
        if !matches!(run.code, Some(0 | 3)) {
            return None;
        }
        let report: Value = match serde_json::from_slice(&run.stdout) {
            Ok(report) => report,
            Err(error) => {
                self.fault(format!("no JSON: {error}"));
                return None;
            }
        };
        if let Some(contradiction) = contradiction(&report) {
            self.fault(contradiction);
        }
        // A replay has no reading.
        if let Some(complete) = report["reading"]["complete"].as_bool()
            && complete != (run.code == Some(0))
        {
            self.fault(format!("exit code {:?}, complete: {complete}", run.code));
        }
        Some(report)
    }

    /// Analyses any file.
    fn analyse(&mut self, recorded: &Recorded) -> Option<Value> {
        let file = self.write(recorded.name, &recorded.bytes);
        let folder = self.folder().to_owned();
        let mut program = Program::new(&folder, &recorded.reading("analyze", &file));
        program.arguments.extend(["-o", "-"].map(str::to_owned));
        let run = self.checked(&program, &READ, recorded.bytes.len() as u64);
        self.report(&run)
    }

    pub(crate) fn faults(&self) -> Vec<String> {
        let mut faults = self.faults.clone();
        let count = self.intervals as f64;
        let share = self.held as f64 / count;
        // The tolerance is three standard deviations of a binomial fraction.
        let most = 3.0 * (COVERAGE * (1.0 - COVERAGE) / count).sqrt();
        if self.intervals > 0 && (share - COVERAGE).abs() > most {
            faults.push(format!("{} of {} intervals hold the true value", self.held, self.intervals));
        }
        faults
    }
}

impl fmt::Display for Campaign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (kind, runs) in &self.runs {
            write!(f, "{kind} {runs}, ")?;
        }
        write!(
            f,
            "{} of {} intervals of N hold the true value, {} faults",
            self.held,
            self.intervals,
            self.faults.len()
        )
    }
}

/// A recording of 1 to 4 thousand rows.
fn drawn(rng: &mut ChaCha8Rng, lost: f64) -> (Noise, Recorded) {
    let rows = rng.random_range(1000..4000);
    let noise = Noise::draw(rng, rows, lost);
    let recorded = noise.drawn(rng);
    (noise, recorded)
}

/// White noise in any format, with and without losses: the report must have the noise, rate and losses.
fn clean_record(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let rows = rng.random_range(4000..12_000);
    let lost = [0.0, 0.0, 0.01, 0.05][rng.random_range(0..4)];
    let noise = Noise::draw(rng, rows, lost);
    let mut recorded = noise.drawn(rng);
    if rng.random_range(0..4) == 0 {
        recorded.bytes =
            if rng.random() { gzip(&recorded.bytes) } else { zstd::encode_all(&*recorded.bytes, 1).expect("memory") };
    }
    let Some(report) = campaign.analyse(&recorded) else {
        campaign.fault(format!("{} is not read", recorded.name));
        return;
    };
    let name = recorded.name;
    campaign.require(report["samples"] == noise.kept.len() as u64, format!("{name}: samples {}", report["samples"]));
    campaign
        .require(report["dropped"]["gap"] == noise.missing(), format!("{name}: missing {}", report["dropped"]["gap"]));
    // Time stamps are whole microseconds.
    let rate = report["sample_rate_hz"].as_f64().unwrap_or(f64::NAN) / noise.rate_hz;
    campaign.require((rate - 1.0).abs() < 1e-5, format!("{name}: {rate} of the rate"));
    for channel in report["channels"].as_array().into_iter().flatten() {
        let Some([_, low, high]) = baseline_term(channel, "angle_random_walk") else {
            campaign.fault(format!("{name}: no N"));
            continue;
        };
        campaign.intervals += 1;
        campaign.held += u64::from((low..=high).contains(&noise.angle_random_walk()));
    }
}

/// Bytes of any format are cut off, flipped, replaced, inserted or exchanged; the file may be compressed afterwards.
fn mutated_bytes(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let (_, mut recorded) = drawn(rng, 0.01);
    let bytes = &mut recorded.bytes;
    for _ in 0..1 << rng.random_range(0..6) {
        let length = bytes.len().max(1);
        // Headers have the lengths and types.
        let end = if rng.random() { length.min(400) } else { length };
        let at = rng.random_range(0..end);
        match rng.random_range(0..6) {
            0 => bytes.truncate(at),
            1 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 1 << rng.random_range(0..8)),
            2 => bytes.iter_mut().skip(at).take(8).for_each(|byte| *byte = [0, 0xFF][rng.random_range(0..2)]),
            3 => bytes.insert(at.min(bytes.len()), rng.random()),
            4 => {
                bytes.drain(at..(at + rng.random_range(1..40)).min(bytes.len()).max(at));
            }
            _ => {
                let part: Vec<u8> = bytes.iter().skip(rng.random_range(0..end)).take(64).copied().collect();
                bytes.splice(at.min(bytes.len())..at.min(bytes.len()), part);
            }
        }
        if bytes.is_empty() {
            break;
        }
    }
    if rng.random_range(0..5) == 0 {
        recorded.bytes = gzip(&recorded.bytes);
    }
    campaign.analyse(&recorded);
    let file = campaign.write(recorded.name, &recorded.bytes);
    let folder = campaign.folder().to_owned();
    // `inspect` must also refuse a file that is not a recording.
    campaign.checked(&Program::new(&folder, &["inspect", &file]), &READ, recorded.bytes.len() as u64);
}

/// Fields that are not valid numbers.
const FIELDS: [&str; 24] = [
    "",
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-320",
    "1e400",
    "9223372036854775808",
    "-9223372036854775808",
    "0x10",
    "1,5",
    "١",
    "+",
    "-",
    ".",
    "1e",
    "\"1\"",
    "\u{1b}[2J",
    "\u{202e}",
    "2024-01-01T00:00:00Z",
    "NULL",
    "1 2",
    "\0",
];

/// Lines of text are lost, doubled, exchanged or joined, and fields are not numbers.
fn mutated_lines(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let rows = rng.random_range(200..3000);
    let noise = Noise::draw(rng, rows, 0.01);
    let mut recorded = noise.recorded(FORMS[rng.random_range(0..TEXTS)]);
    let text = String::from_utf8(recorded.bytes).expect("text");
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..1 << rng.random_range(0..8) {
        // The first lines define the others.
        let end = if rng.random_range(0..3) == 0 { lines.len().min(4) } else { lines.len() };
        let at = rng.random_range(0..end);
        match rng.random_range(0..6) {
            0 if lines.len() > 1 => drop(lines.remove(at)),
            1 => lines.insert(at, lines[at].clone()),
            2 => {
                let other = rng.random_range(0..lines.len());
                lines.swap(at, other);
            }
            3 => {
                let next = lines.get(at + 1).cloned().unwrap_or_default();
                lines[at].push_str(&next);
            }
            _ => {
                let separators = [',', ';', ' '];
                let field = FIELDS.choose(rng).expect("a field");
                let parts: Vec<&str> = lines[at].split(separators).collect();
                let replaced = rng.random_range(0..parts.len());
                let sign = separators.iter().find(|sign| lines[at].contains(**sign)).unwrap_or(&',').to_string();
                let part =
                    |(at, part): (usize, &&str)| if at == replaced { (*field).to_owned() } else { (*part).to_owned() };
                lines[at] = parts.iter().enumerate().map(part).collect::<Vec<_>>().join(&sign);
            }
        }
    }
    let end = ["\n", "\r\n"][rng.random_range(0..2)];
    recorded.bytes = lines.join(end).into_bytes();
    campaign.analyse(&recorded);
}

/// Clocks have steps, wander, go back, repeat, are coarse, or begin at any time.
fn clock(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let rows = rng.random_range(1000..8000);
    let noise = Noise::draw(rng, rows, 0.0);
    let period = noise.rate_hz.recip();
    let origin = [0.0, 1e-3, 1.7e9, -5.0, 1e12][rng.random_range(0..5)];
    let tick: f64 = [0.0, 1e-6, 1e-3, 1e-2, 1.0][rng.random_range(0..5)];
    let at = rng.random_range(0..rows);
    let kind = rng.random_range(0..7);
    let size = rng.random_range(-3.0..6.0f64);
    let size = size.signum() * 10f64.powf(size.abs());
    let mut time = origin;
    let times: Vec<f64> = (0..rows)
        .map(|row| {
            let now = match kind {
                0 if row >= at => time + size * period,
                1 => time + 0.02 * size.abs().min(100.0) * (row as f64 * period / 7.0).sin(),
                2 if row % 50 == 0 => time - rng.random_range(0.0..3.0) * period,
                3 if row % 7 == 0 => time - period,
                4 => time + if row % 64 == 0 { 0.0 } else { -((row % 64) as f64) * period * 0.9 },
                5 if row >= at => origin + (time - origin) * (1.0 + 0.1 * size.clamp(-9.0, 100.0)),
                _ => time + rng.random_range(0.0..0.2) * period,
            };
            time += period;
            if tick > 0.0 { (now / tick).floor() * tick } else { now }
        })
        .collect();
    let rows = times.iter().zip(&noise.counts).map(|(time, [x, y, z])| format!("{time:.7},{x},{y},{z}\n"));
    let text = format!("time_s,gyro_x_counts,gyro_y_counts,gyro_z_counts\n{}", rows.collect::<String>());
    let recorded = Recorded { name: "clock.csv", bytes: text.into_bytes(), options: Vec::new() };
    campaign.analyse(&recorded);
}

/// Losses have any pattern by an index; each must be counted.
fn losses(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let rows = rng.random_range(2000..8000);
    let mut noise = Noise::draw(rng, rows, 0.0);
    let (lost, burst) = (rng.random_range(0.0..0.9), 1u64 << rng.random_range(0..9));
    let is_lost: Vec<bool> = (0..=rows as u64 / burst).map(|_| rng.random::<f64>() < lost).collect();
    let is_kept = |sample: &u64| !is_lost[(sample / burst) as usize];
    let counts = noise.counts.clone();
    noise.kept.retain(|sample| is_kept(sample));
    noise.counts = noise.kept.iter().map(|&sample| counts[sample as usize]).collect();
    let recorded = noise.recorded("counts.csv");
    let Some(report) = campaign.analyse(&recorded) else { return };
    let (first, last) = (noise.kept[0], noise.kept[noise.kept.len() - 1]);
    let missing = last + 1 - first - noise.kept.len() as u64;
    campaign.require(report["samples"] == noise.kept.len() as u64, format!("samples {}", report["samples"]));
    campaign
        .require(report["dropped"]["gap"] == missing, format!("missing {}, not {missing}", report["dropped"]["gap"]));
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}

/// A small file expands to a large one.
fn bomb(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let filled = [0u8, b'\n', b'1', b'0'][rng.random_range(0..4)];
    let mib = rng.random_range(20..200usize);
    let content = vec![filled; mib << 20];
    let shape = format!("{{'descr': '|i1', 'fortran_order': False, 'shape': ({}, 3), }}", content.len() / 3);
    let npy = [&b"\x93NUMPY\x01\0\x76\0"[..], format!("{shape:<117}\n").as_bytes(), &content].concat();
    let mat = || {
        let mut element = Vec::new();
        let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
        let rows = (content.len() / 3) as u32;
        // The words are flags, dimensions, name and numbers of an array of int8 (MAT-File Format, chapter 1).
        element.extend(words(&[14, 3 * rows + 56, 6, 8, 8, 0, 5, 8, rows, 3, 1 | 4 << 16]));
        element.extend(b"gyro");
        element.extend(words(&[1, 3 * rows]));
        element.extend(&content);
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(&element).expect("memory");
        let compressed = encoder.finish().expect("memory");
        let mut file = format!("{:<124}", "MATLAB 5.0 MAT-file").into_bytes();
        file.extend([0, 1, b'I', b'M']);
        file.extend(words(&[15, compressed.len() as u32]));
        file.extend(compressed);
        file
    };
    let (name, bytes): (&str, Vec<u8>) = match rng.random_range(0..7) {
        0 => ("bomb.csv.gz", gzip(&content)),
        1 => ("bomb.npy.gz", gzip(&npy)),
        2 => ("bomb.npz", zipped(&[("a.npy", &npy), ("b.npy", &npy)])),
        3 => ("bomb.csv.zst", zstd::encode_all(&*content, 1).expect("memory")),
        4 => ("bomb.npy.zst", zstd::encode_all(&*npy, 1).expect("memory")),
        5 => ("bomb.gz.gz", gzip(&gzip(&content))),
        _ => ("bomb.mat", mat()),
    };
    let file = campaign.write(name, &bytes);
    let folder = campaign.folder().to_owned();
    for command in ["analyze", "inspect"] {
        campaign.checked(&Program::new(&folder, &[command, &file]), &READ, bytes.len() as u64);
    }
}

/// Structures are nested, definitions use each other, and lists have no end.
fn nested(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let levels = 1usize << rng.random_range(3..15);
    let header = |descr: &str| {
        let text = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': (1,), }}\n");
        let length = (text.len() as u32).to_le_bytes();
        [&b"\x93NUMPY\x02\0"[..], &length, text.as_bytes()].concat()
    };
    let (name, bytes): (&str, Vec<u8>) = match rng.random_range(0..6) {
        0 => ("nested.npy", header(&format!("{}'<f8'{}", "[".repeat(levels), "]".repeat(levels)))),
        1 => ("nested.npy", header(&format!("[('a', '<f8', ({}))]", "1000,".repeat(levels.min(4000))))),
        2 => (
            "nested.jsonl",
            format!("{}1{}\n", "{\"a\":".repeat(levels.min(9000)), "}".repeat(levels.min(9000))).repeat(3).into_bytes(),
        ),
        3 => (
            "nested.jsonl",
            format!("{{\"a\": {}1{}}}\n", "[".repeat(levels), "]".repeat(levels)).repeat(3).into_bytes(),
        ),
        4 => {
            let mut log = FlightLog::empty();
            (0..levels).for_each(|level| log.add(b'F', format!("a{level}:a{} x;", level + 1).as_bytes()));
            log.add(b'A', b"\0\0\0a0");
            ("nested.ulg", log.0)
        }
        _ => {
            // Each definition uses the next one twice.
            let text: String = (0..levels.min(200))
                .map(|level| format!("\n====\nMSG: p/A{level}\np/A{0} a\np/A{0} b\n", level + 1))
                .collect();
            let definition = format!("p/A0 a\n{text}");
            let mut bytes = std::io::Cursor::new(Vec::new());
            let mut out = mcap::Writer::new(&mut bytes).expect("memory");
            let schema = out.add_schema("p/msg/Root", "ros2msg", definition.as_bytes()).expect("a schema");
            out.add_channel(schema, "/a", "cdr", &BTreeMap::new()).expect("a channel");
            out.finish().expect("memory");
            drop(out);
            ("nested.mcap", bytes.into_inner())
        }
    };
    let file = campaign.write(name, &bytes);
    let folder = campaign.folder().to_owned();
    for command in ["analyze", "inspect"] {
        campaign.checked(&Program::new(&folder, &[command, &file]), &READ, bytes.len() as u64);
    }
}

const COMMANDS: [&str; 12] = [
    "analyze",
    "batch",
    "inspect",
    "replay",
    "explain",
    "export",
    "compare",
    "convert",
    "simulate",
    "completions",
    "uf2",
    "demo",
];
const OPTIONS: [&str; 26] = [
    "--rate",
    "--range",
    "--columns",
    "--units",
    "--topic",
    "--sensor",
    "--from",
    "--to",
    "--accept-guess",
    "--each-sensor",
    "--quick",
    "--full",
    "--quiet",
    "-o",
    "-f",
    "--combine-axes",
    "--rows",
    "--running",
    "--seed",
    "--plain",
    "--effect",
    "--environment",
    "--fault",
    "--force",
    "--format",
    "--help",
];
const VALUES: [&str; 28] = [
    "0",
    "-1",
    "1e309",
    "nan",
    "2",
    "100",
    "",
    ",",
    "=",
    "gyro_x=0",
    "gyro_x=0,gyro_x=1",
    "rad/s",
    "m/s^2",
    "out/a.json",
    "out/a.html",
    "out/a.svg",
    "out",
    "kalibr=out/k.yaml",
    "\u{202e}",
    "-",
    "clean.csv",
    "clean.csv",
    "report.json",
    "missing",
    "sinusoid:gyro_z:frequency=1,amplitude=nan",
    "stuck_low:from=1,bursts=5",
    "temperature:rise=1e300",
    "table",
];

/// The arguments are any words in any order.
fn arguments(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let rows = rng.random_range(100..1500);
    let noise = Noise::draw(rng, rows, 0.0);
    campaign.write("clean.csv", &noise.recorded("counts.csv").bytes);
    campaign.write("report.json", b"{\"schema\": 1}");
    std::fs::create_dir(campaign.folder().join("out")).expect("a folder");
    let content = std::fs::read(campaign.folder().join("clean.csv")).expect("the input");
    let folder = campaign.folder().to_owned();
    for _ in 0..8 {
        let mut words = vec![*COMMANDS.choose(rng).expect("a command")];
        if matches!(words[0], "simulate" | "demo") {
            // A simulation must not run for an hour.
            words = if words[0] == "simulate" {
                vec!["simulate", "out/s.csv", "--seconds", "2"]
            } else {
                vec!["demo", "--seconds", "2"]
            };
        }
        for _ in 0..rng.random_range(0..6) {
            let list = if rng.random_range(0..3) > 0 { &VALUES[..] } else { &OPTIONS[..] };
            words.push(list.choose(rng).expect("a word"));
        }
        campaign.checked(&Program::new(&folder, &words), &[0, 1, 2], 0);
        let now = std::fs::read(folder.join("clean.csv")).unwrap_or_default();
        // The second file name of `convert` or `simulate` is their output.
        let is_output =
            words[1..].contains(&"clean.csv") && matches!(words[0], "convert" | "simulate" | "export" | "uf2");
        campaign.require(now == content || is_output, format!("an input was changed by {}", words.join(" ")));
        std::fs::write(folder.join("clean.csv"), &content).expect("written");
    }
}

/// The values of a report are replaced. Its readers must refuse it or write finite numbers.
fn mutated_report(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let rows = rng.random_range(1000..3000);
    let noise = Noise::draw(rng, rows, 0.0);
    let Some(mut report) = campaign.analyse(&noise.recorded("counts.csv")) else {
        campaign.fault("the record is not read");
        return;
    };
    let folder = campaign.folder().to_owned();
    let whole = campaign.write("whole.json", report.to_string().as_bytes());
    for _ in 0..1 << rng.random_range(0..4) {
        mutate(&mut report, rng);
    }
    let mut text = report.to_string().into_bytes();
    if rng.random_range(0..4) == 0 {
        let at = rng.random_range(0..text.len());
        text[at] = rng.random();
    }
    let file = campaign.write("mutated.json", &text);
    let format = ["kalibr", "matlab", "csv", "px4", "gtsam"][rng.random_range(0..5)];
    let out = folder.join("out.txt");
    let out = out.to_str().expect("UTF-8");
    let bytes = text.len() as u64;
    // A format that does not exist is an error of the arguments.
    let run = campaign.checked(
        &Program::new(&folder, &["export", &file, "-o", &format!("{format}={out}")]),
        &[0, 1, 2],
        bytes,
    );
    if run.code == Some(0) {
        let written = std::fs::read(out).unwrap_or_default();
        let text = String::from_utf8_lossy(&written);
        let is_number = |word: &str| matches!(word.trim_matches(['[', ']', ',', ';']), "inf" | "-inf" | "NaN" | "nan");
        campaign
            .require(!text.split_whitespace().any(is_number) && !text.contains('\u{1b}'), format!("{format}: {text}"));
    }
    campaign.checked(&Program::new(&folder, &["compare", &whole, &file]), &[0, 1], bytes);
}

/// Replaces a value somewhere in a report.
fn mutate(value: &mut Value, rng: &mut ChaCha8Rng) {
    let is_inner = rng.random_range(0..8) > 0;
    match value {
        Value::Object(fields) if is_inner && !fields.is_empty() => {
            let at = rng.random_range(0..fields.len());
            mutate(fields.values_mut().nth(at).expect("a field"), rng);
        }
        Value::Array(values) if is_inner && !values.is_empty() => {
            let at = rng.random_range(0..values.len());
            mutate(&mut values[at], rng);
        }
        other => {
            *other = match rng.random_range(0..8) {
                0 => Value::Null,
                1 => (-1e308).into(),
                2 => 1e308.into(),
                3 => 0.into(),
                4 => u64::MAX.into(),
                5 => "\u{1b}[2J".into(),
                6 => Value::Array(vec![]),
                _ => serde_json::json!({}),
            };
        }
    }
}

/// Counts replayed over the bus give the same report, and so do converted ones. The quick analysis gives the same N.
fn replay_and_conversion(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let rows = rng.random_range(1000..4000);
    let noise = Noise::draw(rng, rows, 0.01);
    let recorded = noise.recorded("counts.csv");
    let Some(report) = campaign.analyse(&recorded) else {
        campaign.fault("the record is not read");
        return;
    };
    let folder = campaign.folder().to_owned();
    let file = folder.join(recorded.name);
    let file = file.to_str().expect("UTF-8");
    let rate = noise.rate_hz.to_string();
    let of = |campaign: &mut Campaign, words: &[&str]| {
        let run = campaign.checked(&Program::new(&folder, &[words, &["-o", "-"]].concat()), &[0], 0);
        campaign.report(&run).unwrap_or_default()
    };
    let replayed = of(campaign, &["replay", file, "--rate", &rate]);
    campaign.require(but_reading(&replayed) == but_reading(&report), "replay and analyze differ");
    let converted = folder.join("converted.csv");
    let converted = converted.to_str().expect("UTF-8");
    campaign.checked(&Program::new(&folder, &["convert", file, converted]), &[0], 0);
    let again = of(campaign, &["analyze", converted, "--rate", &rate]);
    campaign.require(but_reading(&again) == but_reading(&report), "the converted record differs");
    let quick = of(campaign, &["analyze", file, "--rate", &rate, "--quick"]);
    for (one, other) in [&report, &quick]
        .map(|report| report["channels"].as_array().cloned().unwrap_or_default())
        .iter()
        .map(|channels| channels.iter().map(|channel| channel["curve"][0]["adev"].as_f64()).collect::<Vec<_>>())
        .collect::<Vec<_>>()
        .windows(2)
        .map(|pair| (&pair[0], &pair[1]))
    {
        campaign.require(one == other, format!("the curves of a quick analysis differ: {one:?} {other:?}"));
    }
}

/// Only some of a file fits on the disk: the old file stays, or the new one is complete.
fn full_disk(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let rows = rng.random_range(1000..4000);
    let noise = Noise::draw(rng, rows, 0.0);
    let recorded = noise.recorded("counts.csv");
    let file = campaign.write(recorded.name, &recorded.bytes);
    let old = b"an old file\n";
    let out = campaign.write("out.csv", old);
    let folder = campaign.folder().to_owned();
    let json = format!("json={out}");
    let words: Vec<&str> = match rng.random_range(0..3) {
        0 => vec!["convert", &file, &out, "--force"],
        1 => vec!["simulate", &out, "--force", "--seconds", "5"],
        _ => vec!["analyze", &file, "--rate", "100", "--quiet", "--force", "-o", &json],
    };
    let mut program = Program::new(&folder, &words);
    let whole = {
        campaign.checked(&program, &[0], 0);
        std::fs::read(&out).expect("written")
    };
    campaign.write("out.csv", old);
    program.most_blocks = Some(rng.random_range(0..whole.len() as u32 / 256));
    let run = campaign.checked(&program, &[0, 1], 0);
    let now = std::fs::read(&out).unwrap_or_default();
    let expected = if run.code == Some(0) { &whole[..] } else { old };
    campaign.require(now == expected, format!("{} bytes after {}", now.len(), words.join(" ")));
}

/// A signal comes at any time: the old file stays, or the new one is complete, and no other file remains.
fn interrupted(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let noise = Noise::draw(rng, 60_000, 0.0);
    let recorded = noise.recorded("counts.csv");
    let file = campaign.write(recorded.name, &recorded.bytes);
    let old = b"an old file\n";
    let out = campaign.write("out.csv", old);
    let folder = campaign.folder().to_owned();
    let words = if rng.random() { vec!["convert", &file, &out] } else { vec!["simulate", &out, "--seconds", "30"] };
    let words = [&words[..], &["--force"]].concat();
    let program = Program::new(&folder, &words);
    campaign.checked(&program, &[0], 0);
    let whole = std::fs::read(&out).expect("written");
    campaign.write("out.csv", old);
    let child = program.start();
    thread::sleep(Duration::from_millis(rng.random_range(0..400)));
    let signal = ["INT", "TERM", "HUP"][rng.random_range(0..3)];
    // The process may already have ended.
    let _ = Command::new("sh").args(["-c", &format!("kill -{signal} {}", child.id())]).output();
    let run = Run::of(child);
    let now = std::fs::read(&out).unwrap_or_default();
    *campaign.runs.entry(campaign.kind).or_insert(0) += 1;
    let is_whole = now == whole || run.code != Some(0) && now == old;
    campaign.require(is_whole, format!("SIG{signal}: exit {:?}, {} bytes of {}", run.code, now.len(), whole.len()));
    let others: Vec<String> = std::fs::read_dir(&folder)
        .expect("a folder")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| !["out.csv", recorded.name].contains(&name.as_str()))
        .collect();
    campaign.require(others.is_empty(), format!("SIG{signal} leaves {others:?}"));
}

/// Any bytes come from the port: garbage, parts of messages, floods, silence.
fn terminal(campaign: &mut Campaign, rng: &mut ChaCha8Rng) {
    let (near, far, port) = pseudo_terminals(Duration::from_millis(5));
    let folder = campaign.folder().to_owned();
    let words: Vec<&str> = if rng.random() {
        vec!["monitor", &port, "--seconds", "1"]
    } else {
        vec!["record", "port.csv", "--port", &port, "--seconds", "1"]
    };
    let program = Program::new(&folder, &words);
    let child = program.start();
    let seed = rng.random();
    let sender = thread::spawn(move || {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut received = [0; 256];
        for _ in 0..120 {
            let length = [0, 1, 20, 300, 4000][rng.random_range(0..5)];
            let zeros = rng.random_range(0..3) == 0;
            let bytes: Vec<u8> = (0..length).map(|_| if zeros { 0 } else { rng.random() }).collect();
            // The program may have closed the port, and need not read.
            let _ = near.write(&bytes);
            let _ = near.read(&mut received);
            thread::sleep(Duration::from_millis(5));
        }
    });
    let run = Run::of(child);
    campaign.check(&run, &words.join(" "), &[0, 1], 0);
    // A write that waits for room ends when the last end of the port is closed.
    drop(far);
    sender.join().expect("a sender");
}
