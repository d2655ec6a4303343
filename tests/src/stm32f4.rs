//! Runs images for an STM32F405 in its emulator, a program of `tests/tools`.

use crate::{Image, tool};
use emulation::{Outcome, Scenario};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// Rust's name of a Cortex-M4F.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// The image for the Olimex STM32-H405, built at most once per run; `OBSERVATORY_IMAGE` names another image.
pub fn h405_image() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    let build = || Image::of_board("h405", TARGET, &[]);
    IMAGE.get_or_init(|| std::env::var_os("OBSERVATORY_IMAGE").map_or_else(build, PathBuf::from))
}

/// Boots the image and runs it.
pub fn run(image: &Path, scenario: Scenario) -> Outcome {
    let mut emulator = Command::new(tool("stm32f4-emulator"))
        .arg(image)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the emulator starts");
    emulator.stdin.take().expect("a pipe").write_all(&scenario.to_bytes()).expect("the emulator reads");
    let output = emulator.wait_with_output().expect("the emulator ends");
    assert!(output.status.success(), "the emulator ends with {}", output.status);
    Outcome::from_bytes(&output.stdout).expect("the results of the run")
}

/// Commands typed one after the other on the console of an emulated board. They begin after the start-up and the probe of the sensor.
#[derive(Debug)]
pub struct Typed {
    /// The commands with their times in s.
    commands: Vec<(f64, String)>,
    /// Time of the end, after the answer to the last command, s.
    pub end_s: f64,
}

impl Typed {
    /// No command.
    pub fn nothing() -> Self {
        Self { commands: Vec::new(), end_s: 0.8 }
    }

    /// Appends a command, with the time for its answer in s.
    #[must_use]
    pub fn then(mut self, command: &str, seconds: f64) -> Self {
        self.commands.push((self.end_s, command.to_owned()));
        self.end_s += seconds;
        self
    }

    /// Appends the steps of the bench, each with its longest time in s, on a board whose report takes `report_s`.
    #[must_use]
    pub fn then_steps(self, steps: impl IntoIterator<Item = (String, f64)>, report_s: f64) -> Self {
        steps.into_iter().fold(self, |typed, (command, longest_s)| {
            let seconds = answer_time(&command, longest_s, report_s);
            typed.then(&command, seconds)
        })
    }

    /// The keys with their times in s.
    pub fn keys(&self) -> impl Iterator<Item = (f64, String)> {
        self.commands.iter().map(|(at_s, command)| (*at_s, format!("{command}\r")))
    }

    /// Splits what a port has sent, bytes with their times in ns, into the answers to each command.
    pub fn answers(&self, received: &[(u64, u8)]) -> Vec<(&str, Vec<u8>)> {
        let ends = self.commands.iter().skip(1).map(|(at_s, _)| at_s * 1e9).chain([f64::INFINITY]);
        let mut bytes = received.iter().peekable();
        let mut until = |end_ns: f64| -> Vec<u8> {
            std::iter::from_fn(|| bytes.next_if(|(at, _)| (*at as f64) < end_ns)).map(|&(_, byte)| byte).collect()
        };
        let mut answers = Vec::new();
        for ((_, command), end_ns) in self.commands.iter().zip(ends) {
            answers.push((command.as_str(), until(end_ns)));
        }
        answers
    }
}

/// Sufficient time in s for the answer of an emulated board to a step of the bench; the board's report takes `report_s`, and the step
/// itself allows `longest_s`.
fn answer_time(command: &str, longest_s: f64, report_s: f64) -> f64 {
    match command.split(' ').next().unwrap_or_default() {
        "w" if command == "w 1" => longest_s,
        "r" => report_s,
        "compare" | "check" | "measure" | "deflect" => 0.8,
        "g" | "n" | "f" => 0.6,
        _ => 0.15,
    }
}
