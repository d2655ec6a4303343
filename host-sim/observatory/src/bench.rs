//! The bench: works through the checklist of docs/bench.md on a device, and states which checks pass or fail and the probable cause. Pages
//! and tables are those of the ADIS16400/ADIS16405 data sheet, Rev. B.

mod transcript;
mod verdicts;

use link::{DecoderCounters, Received};
use recordings::Printable;
use std::io::{self, Write};
use transcript::Topic;

pub use transcript::{BenchPlan, Step, Transcript};
pub use verdicts::{Cause, Check, checks};

/// Pause after a command that restores a setting, s, since the device accepts a few bytes at a time.
pub const SETTING_S: f64 = 0.5;

/// The run of the steps. The caller sends the commands, and passes on the answers of the device.
#[derive(Debug)]
pub struct BenchRun {
    steps: Vec<Step>,
    /// Position of the step after the current one.
    next: usize,
    /// The current step, and what was received since its command.
    under_way: Option<(Step, Vec<Received>)>,
    transcript: Transcript,
    /// Counters of the decoder before the first step.
    before: DecoderCounters,
}

impl BenchRun {
    /// A run before its first step, with the counters of a decoder that may have received something already.
    #[must_use]
    pub fn new(plan: &BenchPlan, before: DecoderCounters) -> Self {
        Self { steps: plan.steps(), next: 0, under_way: None, transcript: Transcript::default(), before }
    }

    /// Number of steps.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps.len()
    }

    /// Ends the current step and starts the next one. Returns its position and the step, whose command is to be sent; `None` if no step is
    /// left.
    pub fn begin_step(&mut self) -> Option<(usize, Step)> {
        if let Some((step, received)) = self.under_way.take() {
            self.transcript.push(&step, received);
            if self.transcript.is_silent() {
                return None;
            }
        }
        loop {
            let (position, step) = (self.next, self.steps.get(self.next)?.clone());
            self.next += 1;
            let says_nothing_new = step.topic == Topic::Reads && verdicts::reads_are_wrong(&self.transcript)
                || step.needs_sensor && verdicts::is_deaf(&self.transcript);
            if !says_nothing_new {
                self.under_way = Some((step.clone(), Vec::new()));
                return Some((position, step));
            }
        }
    }

    /// Adds what was received. True if the answer to the current step is complete.
    pub fn take(&mut self, received: Received) -> bool {
        let Some((step, answer)) = &mut self.under_way else { return false };
        let is_last = step.is_answered_by(&received);
        answer.push(received);
        is_last
    }

    /// Sets the messages of a second port while the bursts were counted.
    pub fn set_second_port(&mut self, received: Option<Vec<Received>>) {
        self.transcript.second_port = received;
    }

    /// Returns all answers, and the decoder's counts during the run; `after` are its counters now.
    #[must_use]
    pub fn finish(mut self, after: DecoderCounters) -> Transcript {
        let before = self.before;
        self.transcript.counters = DecoderCounters {
            frames: after.frames - before.frames,
            lines: after.lines - before.lines,
            bad_frames: after.bad_frames - before.bad_frames,
            other_version: after.other_version - before.other_version,
            missing: after.missing - before.missing,
            discarded_bytes: after.discarded_bytes - before.discarded_bytes,
        };
        self.transcript
    }
}

/// Writes a row for each check, and then the probable causes of failures.
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
