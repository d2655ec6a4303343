//! The bench: drives the console of a device through the checklist of docs/bench.md and says what passes, what fails, and what is probably
//! wrong. Pages and tables are those of the ADIS16400/ADIS16405 data sheet, Rev. B.

mod transcript;
mod verdicts;

use link::{DecoderCounters, Received};
use recordings::Printable;
use recordings::serial::SerialLink;
use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

pub use transcript::{BenchPlan, Step, Transcript};
pub use verdicts::{Cause, Check, checks};

use transcript::Topic;

/// Time for which one of two ports is listened to.
const TURN: Duration = Duration::from_millis(1);

/// A device to which commands are sent.
pub trait Console {
    /// Sends a command.
    ///
    /// # Errors
    /// The port fails.
    fn send(&mut self, command: &str) -> io::Result<()>;
    /// Time since the console was opened, s.
    fn now_s(&self) -> f64;
    /// The next message or line; `None` at this time, or if the device has hung up.
    ///
    /// # Errors
    /// The port fails.
    fn next(&mut self, until_s: f64) -> io::Result<Option<Received>>;
    /// Of the decoder.
    fn counters(&self) -> DecoderCounters;
    /// What has come on a second port since the last call; `None` without one.
    fn second_port(&mut self) -> Option<Vec<Received>> {
        None
    }
}

/// A device on one or two serial ports.
pub struct SerialConsole<P> {
    link: SerialLink<P>,
    /// A port to listen on, and what has come there.
    second: Option<(SerialLink<P>, Vec<Received>)>,
    opened: Instant,
}

impl<P: Read + Write> SerialConsole<P> {
    /// A device on a port, and perhaps on a second one.
    pub fn new(link: SerialLink<P>, second: Option<SerialLink<P>>) -> Self {
        Self { link, second: second.map(|link| (link, Vec::new())), opened: Instant::now() }
    }
}

impl<P: Read + Write> Console for SerialConsole<P> {
    fn send(&mut self, command: &str) -> io::Result<()> {
        self.link.send_command(command)
    }

    fn now_s(&self) -> f64 {
        self.opened.elapsed().as_secs_f64()
    }

    fn next(&mut self, until_s: f64) -> io::Result<Option<Received>> {
        let until = self.opened + Duration::from_secs_f64(until_s);
        let Some((second, heard)) = &mut self.second else { return self.link.next(Some(until)) };
        while Instant::now() < until {
            // Both are read in turn, before the system's buffer of 4 kB is full.
            heard.extend(second.next(Some(Instant::now() + TURN))?);
            if let Some(received) = self.link.next(Some(Instant::now() + TURN))? {
                return Ok(Some(received));
            }
            if self.link.is_disconnected() {
                break;
            }
        }
        Ok(None)
    }

    fn counters(&self) -> DecoderCounters {
        self.link.counters()
    }

    fn second_port(&mut self) -> Option<Vec<Received>> {
        self.second.as_mut().map(|(_, heard)| std::mem::take(heard))
    }
}

/// Goes through the steps, and then sets what it has changed as it was. `progress` is called before each step.
///
/// # Errors
/// The port fails.
pub fn run(
    console: &mut impl Console,
    plan: &BenchPlan,
    mut progress: impl FnMut(&Step, usize, usize),
) -> io::Result<Transcript> {
    let steps = plan.steps();
    let mut transcript = Transcript::default();
    for (index, step) in steps.iter().enumerate() {
        if step.topic == Topic::Reads && verdicts::reads_are_wrong(&transcript)
            || step.needs_sensor && verdicts::is_deaf(&transcript)
        {
            continue;
        }
        progress(step, index, steps.len());
        if step.topic == Topic::Bursts {
            console.second_port();
        }
        let received = ask(console, step)?;
        if step.topic == Topic::Bursts {
            transcript.second_port = console.second_port();
        }
        transcript.push(step, received);
        if transcript.is_silent() {
            break;
        }
    }
    transcript.counters = console.counters();
    for command in transcript.settings_before() {
        console.send(&command)?;
        // The device takes some bytes at a time.
        let until_s = console.now_s() + 0.5;
        while console.next(until_s)?.is_some() {}
    }
    Ok(transcript)
}

/// Writes a row for each check, and then what is probably wrong.
///
/// # Errors
/// `out` cannot be written.
pub fn write_table(checks: &[Check], out: &mut impl Write) -> io::Result<()> {
    let width = |text: fn(&Check) -> &str| checks.iter().map(|check| text(check).chars().count()).max().unwrap_or(0);
    let (names, figures) = (width(|check| check.name).max(5), width(|check| check.measured.as_str()).max(8));
    writeln!(out, "      {:<names$}  {:<figures$}  limit", "check", "measured")?;
    for Check { name, measured, limit, cause } in checks {
        let verdict = match (cause, measured.is_empty()) {
            (Some(_), _) => "FAIL",
            (None, true) => "-",
            (None, false) => "pass",
        };
        let measured = Printable(measured).to_string();
        writeln!(out, "{verdict:<4}  {name:<names$}  {measured:<figures$}  {limit}")?;
    }
    let mut causes: Vec<&Cause> = Vec::new();
    for cause in checks.iter().filter_map(|check| check.cause.as_ref()) {
        if !causes.contains(&cause) {
            causes.push(cause);
        }
    }
    if !causes.is_empty() {
        writeln!(out, "\nProbably; begin with the first, from which others may follow:")?;
    }
    causes.iter().enumerate().try_for_each(|(index, cause)| writeln!(out, "{}. {cause}", index + 1))
}

/// Sends a command and receives until the answer is whole or its time is over.
fn ask(console: &mut impl Console, step: &Step) -> io::Result<Vec<Received>> {
    let until_s = console.now_s() + step.seconds;
    console.send(&step.command)?;
    let mut answer = Vec::new();
    while let Some(received) = console.next(until_s)? {
        let is_last = step.is_answered_by(&received);
        answer.push(received);
        if is_last {
            break;
        }
    }
    Ok(answer)
}
