//! Answers for a person: lines of text, made one at a time.

use super::epoch::{INERTIAL, Verdict};
use super::report::sums;
use super::{App, Sensor};
use crate::board::Board;
use crate::command::HELP;
use crate::estimators::CHANNELS;
use crate::last_words::line;
use crate::summary::{OCTAVES, channel_model};
use crate::table::{HEAD, Short, row};
use link::{Health, Line, MAX_CAUSES};

/// What `v` answers.
pub(super) const VERSION_LINE: &str = concat!("ADIS16405 noise observatory ", env!("CARGO_PKG_VERSION"));

/// Lines of a channel in the table: coefficients, covariates, and this one.
const CHECKED: usize = 1 + MAX_CAUSES;

/// An answer and how many of its lines were sent.
#[derive(Debug, Clone, Copy)]
pub(super) struct Answer {
    kind: Kind,
    next: usize,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Help,
    Table,
    Faults,
    Status,
}

impl Answer {
    pub(super) const fn help() -> Self {
        Self { kind: Kind::Help, next: 0 }
    }

    pub(super) const fn table() -> Self {
        Self { kind: Kind::Table, next: 0 }
    }

    pub(super) const fn faults() -> Self {
        Self { kind: Kind::Faults, next: 0 }
    }

    pub(super) const fn status() -> Self {
        Self { kind: Kind::Status, next: 0 }
    }
}

/// A line of an answer.
enum Next {
    Line(Line),
    /// Nothing to say here; there is more.
    Nothing,
    End,
}

impl From<Option<Line>> for Next {
    fn from(line: Option<Line>) -> Self {
        line.map_or(Self::Nothing, Self::Line)
    }
}

impl App {
    /// Answers behind those that are asked for already, or says that they are too many.
    pub(super) fn ask(&mut self, board: &mut impl Board, answer: Answer) {
        if self.answers.push_back(answer).is_err() {
            self.say(board, format_args!("busy with the keys before; ask again"));
        }
    }

    /// Makes and sends the next line of the answer under way, unless that takes a fit, which must wait.
    pub(super) fn answer_briefly(&mut self, board: &mut impl Board) {
        if self.answers.front().is_some_and(|answer| !matches!(answer.kind, Kind::Table)) {
            self.answer(board);
        }
    }

    /// Makes and sends the next line of the answer under way.
    #[inline(never)] // so that its stack is not everybody's
    pub(super) fn answer(&mut self, board: &mut impl Board) {
        let Some(&Answer { kind, next }) = self.answers.front() else { return };
        let made = match kind {
            Kind::Help => HELP.get(next).map_or(Next::End, |text| Next::Line(line(format_args!("{text}")))),
            Kind::Table => self.table_line(board, next),
            Kind::Faults => faults_line(&self.health(board), next),
            Kind::Status => self.status_line(board, next),
        };
        let told = match made {
            Next::End => {
                self.answers.pop_front();
                return;
            }
            Next::Nothing => true,
            Next::Line(line) => board.outbox(|outbox| outbox.line(&line)),
        };
        if let Some(answer) = self.answers.front_mut().filter(|_| told) {
            answer.next += 1;
        }
    }

    /// Head, a row for every octave, a line of coefficients for every inertial channel; what the last epoch taught, and what
    /// it said to what was learnt before.
    #[inline(never)] // here and below: so that its stack is not everybody's
    fn table_line(&self, board: &mut impl Board, index: usize) -> Next {
        if let Some(head) = HEAD.get(index) {
            return Next::Line(line(format_args!("{head}")));
        }
        let index = index - HEAD.len();
        if index < OCTAVES {
            return board.estimators(|estimators| row(estimators, index)).into();
        }
        let (line, index) = ((index - OCTAVES) / INERTIAL, (index - OCTAVES) % INERTIAL);
        match line {
            0 => self.coefficients_line(board, index).map_or(Next::End, Next::Line),
            1..=MAX_CAUSES => self.cause_line(index, line - 1).into(),
            CHECKED => self.checked_line(index).into(),
            _ => Next::End,
        }
    }

    #[inline(never)]
    fn coefficients_line(&self, board: &mut impl Board, index: usize) -> Option<Line> {
        let channel = CHANNELS[index];
        let model = channel_model(channel, &sums(board, index), self.config);
        let mut text = line(format_args!("{}", channel.name()));
        for term in model.terms() {
            // What does not fit is cut.
            let (value, low, high) = (Short(term.value), Short(term.low), Short(term.high));
            let _ = text.push_str(&line(format_args!("  {} ({low}..{high})", value)));
        }
        Some(text)
    }

    /// A covariate that is subtracted since the last epoch.
    #[inline(never)]
    fn cause_line(&self, index: usize, cause: usize) -> Option<Line> {
        let followed = self.school.lessons[index].causes.get(cause)?;
        let (value, error) = (Short(followed.value), Short(followed.error));
        let (name, cause) = (CHANNELS[index].name(), CHANNELS[followed.cause].name());
        Some(line(format_args!("{name} follows {cause}: {value} +- {error}")))
    }

    /// What the last epoch said to what was learnt before it.
    #[inline(never)]
    fn checked_line(&self, index: usize) -> Option<Line> {
        let Verdict { errors, drift } = self.school.verdicts[index]?;
        let (before, after) = (Short(errors.0), Short(errors.1));
        let (raw, compensated) = (Short(drift.raw), Short(drift.compensated));
        let tau = Short(drift.n as f64 / self.config.sample_period().hz());
        let name = CHANNELS[index].name();
        let text = format_args!("{name} unseen: drift at {tau} s {raw} -> {compensated}, error {before} -> {after}");
        Some(line(text))
    }

    #[inline(never)]
    fn status_line(&self, board: &mut impl Board, index: usize) -> Next {
        let now_us = board.now_us();
        let boot = &self.boot;
        let text = match index {
            0 => {
                let state = if matches!(self.sensor, Sensor::Sampled { .. }) { "sampled" } else { "sought" };
                line(format_args!("up {} s, sensor {state}, SCK {} Hz", now_us / 1_000_000, self.spi_clock_hz))
            }
            1 => {
                let measured = board.estimators(|estimators| estimators.measured_hz());
                let programmed = Short(self.config.sample_period().hz());
                let (sens_avg, measured) = (self.config.sens_avg(), Short(measured.unwrap_or(f64::NAN)));
                line(format_args!("rate {programmed} Hz, measured {measured} Hz, SENS_AVG {sens_avg:#06x}"))
            }
            2 => {
                let samples = board.estimators(|estimators| estimators.get(0).map(|estimator| estimator.len()));
                let (epoch, length) = (self.settings.epoch, self.settings.epoch_s);
                let (samples, age) = (samples.unwrap_or(0), self.epoch_age_s(now_us));
                line(format_args!("{samples} samples, epoch {epoch}, begun {age} s ago, length {length} s"))
            }
            3 => line(format_args!("start {}: {:?}, {} channels kept", boot.starts, boot.cause, boot.kept_channels)),
            4 if !boot.last_words.is_empty() => line(format_args!("last words: {}", boot.last_words)),
            _ => return Next::End,
        };
        Next::Line(text)
    }
}

/// A line for each counter that is not 0.
#[inline(never)]
fn faults_line(health: &Health, index: usize) -> Next {
    let counters = [
        ("bursts", health.bursts),
        ("used", health.used),
        ("no_new_data", health.no_new_data),
        ("error_alarm", health.error_alarm),
        ("supply", health.supply),
        ("stuck_low", health.stuck_low),
        ("stuck_high", health.stuck_high),
        ("shifted", health.shifted),
        ("frozen", health.frozen),
        ("impossible_rate", health.impossible_rate),
        ("x_sign", health.x_sign),
        ("repeated", health.repeated),
        ("bus_errors", health.bus_errors),
        ("queue_full", health.queue_full),
        ("queue_peak", health.queue_peak),
        ("lost_edges", health.lost_edges),
        ("stray_edges", health.stray_edges),
        ("unchecked", health.unchecked),
        ("recoveries", health.recoveries),
        ("raw_dropped", health.raw_dropped),
        ("serial_overruns", health.serial_overruns),
        ("bad_commands", health.bad_commands),
        ("awake_permille", health.awake_permille),
        ("sampling_cycles", health.sampling_cycles),
        ("estimator_cycles", health.estimator_cycles),
        ("stack_bytes", health.stack_bytes),
        ("stack_size", health.stack_size),
    ];
    match counters.get(index) {
        Some((name, count)) => (*count > 0).then(|| line(format_args!("{name} {count}"))).into(),
        None => Next::End,
    }
}
