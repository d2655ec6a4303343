//! The bench on serial ports.

use link::{DecoderCounters, Received};
use observatory::bench::{BenchRun, SETTING_S};
use recordings::serial::SerialLink;
use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

pub use observatory::bench::{BenchPlan, Cause, Check, Step, Transcript, checks, write_table};

/// Time for which one of two ports is read before the other.
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
    /// Counters of the decoder.
    fn counters(&self) -> DecoderCounters;
    /// Messages of the second port since the last call; `None` without one.
    fn second_port(&mut self) -> Option<Vec<Received>> {
        None
    }
}

/// A device on one or two serial ports.
pub struct SerialConsole<P> {
    link: SerialLink<P>,
    /// The second port, and the messages that it has received.
    second: Option<(SerialLink<P>, Vec<Received>)>,
    opened: Instant,
}

impl<P: Read + Write> SerialConsole<P> {
    /// A device on a port, and a second one if given.
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
            // Both ports are read in turn, before the system's buffer of 4 kB is full.
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

/// Runs the steps, and then restores the settings that it has changed. `progress` is called before each step.
///
/// # Errors
/// The port fails.
pub fn run(
    console: &mut impl Console,
    plan: &BenchPlan,
    mut progress: impl FnMut(&Step, usize, usize),
) -> io::Result<Transcript> {
    let mut bench = BenchRun::new(plan, console.counters());
    while let Some((position, step)) = bench.begin_step() {
        progress(&step, position, bench.steps());
        if step.counts_bursts() {
            console.second_port();
        }
        let until_s = console.now_s() + step.seconds;
        console.send(&step.command)?;
        while let Some(received) = console.next(until_s)? {
            if bench.take(received) {
                break;
            }
        }
        if step.counts_bursts() {
            bench.set_second_port(console.second_port());
        }
    }
    let transcript = bench.finish(console.counters());
    for command in transcript.settings_before() {
        console.send(&command)?;
        let until_s = console.now_s() + SETTING_S;
        while console.next(until_s)?.is_some() {}
    }
    Ok(transcript)
}
