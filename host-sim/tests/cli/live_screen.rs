//! `monitor` on a pseudo-terminal: the live screen of a simulated device, how it ends, and that the terminal is restored.

use crate::serial_device::DevicePort;
use serial2::SerialPort;
use std::fs::OpenOptions;
use std::io::ErrorKind;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use system_tests::pseudo_terminals;

/// The sequences by which a terminal enters and leaves its alternate screen.
const ENTER: &str = "\u{1b}[?1049h";
const LEAVE: &str = "\u{1b}[?1049l";
/// Bound of a test that hangs; no result depends on it.
const PATIENCE: Duration = Duration::from_secs(120);

/// The settings of a terminal by `stty`.
fn settings(terminal: &str) -> String {
    let output = Command::new("stty").args(["-F", terminal, "-a"]).output().expect("stty starts");
    String::from_utf8(output.stdout).expect("text")
}

/// A text without control sequences and blanks: the program moves the cursor over cells that are blank already.
fn without_control(text: &str) -> String {
    let mut parts = text.split("\u{1b}[");
    let first = parts.next().unwrap_or_default().to_owned();
    let after = parts.map(|part| part.split_once(|of: char| ('@'..='~').contains(&of)).map_or("", |(_, rest)| rest));
    [first].into_iter().chain(after.map(str::to_owned)).collect::<String>().split_whitespace().collect()
}

/// A session of the program on a pseudo-terminal of 80 columns and 24 rows.
struct Session {
    near: SerialPort,
    /// Keeps the terminal open.
    _far: SerialPort,
    name: String,
    program: std::process::Child,
    seen: String,
    before: String,
}

impl Session {
    fn start(arguments: &[&str], environment: &[(&str, &str)]) -> Self {
        let (near, far, name) = pseudo_terminals(Duration::from_millis(20));
        let sized =
            Command::new("stty").args(["-F", &name, "sane", "rows", "24", "cols", "80"]).status().expect("stty");
        assert!(sized.success());
        let before = settings(&name);
        let terminal = || Stdio::from(OpenOptions::new().read(true).write(true).open(&name).expect("the terminal"));
        let program = Command::new(env!("CARGO_BIN_EXE_imunoise"))
            .args(arguments)
            .env_remove("NO_COLOR")
            .envs(environment.iter().copied())
            .env("TERM", "xterm")
            .stdin(terminal())
            .stdout(terminal())
            .stderr(terminal())
            .spawn()
            .expect("the program starts");
        Self { near, _far: far, name, program, seen: String::new(), before }
    }

    /// Reads what there is; whether anything was.
    fn read(&mut self) -> bool {
        let mut bytes = [0; 4096];
        match self.near.read(&mut bytes) {
            Ok(count) => self.seen += &String::from_utf8_lossy(&bytes[..count]),
            Err(error) => {
                assert_eq!(error.kind(), ErrorKind::TimedOut);
                return false;
            }
        }
        true
    }

    /// Waits for a text of the screen, or for a control sequence.
    fn wait_for(&mut self, expected: &str) {
        let begun = Instant::now();
        let has = |seen: &str| match expected.starts_with('\u{1b}') {
            true => seen.contains(expected),
            false => without_control(seen).contains(&without_control(expected)),
        };
        while !has(&self.seen) {
            assert!(begun.elapsed() < PATIENCE, "{expected}: {:?}", self.seen);
            self.read();
        }
    }

    /// Waits for the end; returns the exit code and whether the terminal is as it was.
    fn end(&mut self) -> (ExitStatus, bool, String) {
        let begun = Instant::now();
        let status = loop {
            self.read();
            if let Some(status) = self.program.try_wait().expect("the program") {
                break status;
            }
            assert!(begun.elapsed() < PATIENCE, "no end: {:?}", self.seen);
        };
        // A program that has ended sends nothing more.
        while self.read() {}
        let restored = settings(&self.name) == self.before && self.seen.contains(LEAVE);
        (status, restored, std::mem::take(&mut self.seen))
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // After a failed test; one that has ended is not there to be killed.
        let _ = self.program.kill();
    }
}

#[test]
fn the_live_screen_grows_and_every_end_restores_the_terminal() {
    let device = DevicePort::open();
    // The key q, Ctrl-C as a key, and a signal.
    for (end, name) in [(Some(b"q".as_slice()), "q"), (Some(b"\x03"), "Ctrl-C"), (None, "SIGINT")] {
        let mut session = Session::start(&["monitor", &device.name], &[]);
        session.wait_for(ENTER);
        for expected in ["°/√h", "What was found", "Health", "q ends"] {
            session.wait_for(expected);
        }
        match end {
            Some(keys) => session.near.write_all(keys).expect("typed"),
            None => {
                let process = session.program.id().to_string();
                assert!(Command::new("kill").args(["-INT", &process]).status().expect("kill starts").success());
            }
        }
        let (status, restored, seen) = session.end();
        assert!(status.success() && restored, "{name}: {status}, {seen:?}");
        // The counters of the link stay on the terminal.
        let after = seen.rsplit(LEAVE).next().unwrap_or_default();
        assert!(after.contains("missing by their numbers"), "{name}: {after:?}");
    }
}

#[test]
fn a_terminal_that_changes_its_size_is_drawn_anew() {
    let device = DevicePort::open();
    let mut session = Session::start(&["monitor", &device.name], &[]);
    session.wait_for("What was found");
    session.seen.clear();
    let name = session.name.clone();
    assert!(Command::new("stty").args(["-F", &name, "rows", "40", "cols", "120"]).status().expect("stty").success());
    // Row 40 is written only on the larger screen.
    session.wait_for("\u{1b}[40;");
    // The program has the terminal in its raw mode now.
    session.before = session.before.replace("rows 24; columns 80", "rows 40; columns 120");
    session.near.write_all(b"q").expect("typed");
    let (status, restored, _) = session.end();
    assert!(status.success() && restored);
}

#[test]
fn no_color_is_respected() {
    let device = DevicePort::open();
    // 36, 38;5;6 and the like are foreground colours, in which the curves are drawn.
    let has_colour = |seen: &str| {
        seen.split('\u{1b}')
            .filter_map(|part| part.strip_prefix('[')?.split_once('m'))
            .any(|(code, _)| code.split(';').any(|number| matches!(number.parse::<u8>(), Ok(30..=38 | 90..=97))))
    };
    for (environment, expected) in [(&[][..], true), (&[("NO_COLOR", "1")][..], false)] {
        let mut session = Session::start(&["monitor", &device.name], environment);
        session.wait_for("°/√h");
        session.wait_for("Health");
        session.near.write_all(b"q").expect("typed");
        let (_, _, seen) = session.end();
        assert_eq!(has_colour(&seen), expected, "{seen:?}");
    }
}
