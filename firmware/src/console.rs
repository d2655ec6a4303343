//! Text for a person: lines, and answers sent line by line.

use crate::answer::{Answer, AnswerLine};
use crate::bench_console::{deflection_line, dump_line, measurement_line};
use crate::board::Board;
use crate::command::help;
use crate::device::DeviceState;
use crate::number_text::Decimal;
use crate::report_text;
use heapless::Deque;
use link::{ClockSource, Health, TextLine, text};

pub(crate) const VERSION_LINE: &str = concat!("ADIS16405 noise observatory ", env!("CARGO_PKG_VERSION"));

pub(crate) const SAFE_MODE: &str = "safe mode after three crashes: stored settings and models are not used";

const WAITING_LINES: usize = 4;
/// Answers that may wait, including the current one.
const WAITING_ANSWERS: usize = 4;

#[derive(Default)]
pub(crate) struct Console {
    lines: Deque<TextLine, WAITING_LINES>,
    answers: Deque<Answer, WAITING_ANSWERS>,
    /// Index of the next line of the first answer.
    next_line: usize,
    /// Counters, read once per answer: reading them searches the stack for a millisecond.
    counted: Health,
}

impl Console {
    /// Queues a line behind the waiting ones, and drops the oldest if there are too many.
    pub(crate) fn print(&mut self, board: &mut impl Board, line: TextLine) {
        if self.lines.is_empty() && board.transmit_queue(|queue| queue.send_text(&line)) {
            return;
        }
        if self.lines.is_full() {
            self.lines.pop_front();
        }
        let _room_was_made = self.lines.push_back(line);
    }

    /// Sends waiting lines; returns whether there is room for more.
    pub(crate) fn flush(&mut self, board: &mut impl Board) -> bool {
        while let Some(line) = self.lines.front() {
            if !board.transmit_queue(|queue| queue.send_text(line)) {
                return false;
            }
            self.lines.pop_front();
        }
        board.transmit_queue(|queue| queue.has_room())
    }

    /// Queues an answer; a line instead if too many wait.
    pub(crate) fn answer(&mut self, answer: Answer) -> Option<TextLine> {
        let is_full = self.answers.push_back(answer).is_err();
        is_full.then(|| text!("busy: too many answers waiting; repeat the command"))
    }

    pub(crate) fn has_answers(&self) -> bool {
        !self.answers.is_empty()
    }

    /// Sends the next line unless it takes long (tables, deflections).
    pub(crate) fn send_quick_line(&mut self, state: &DeviceState, board: &mut impl Board) {
        if self.answers.front().is_some_and(|answer| !matches!(answer, Answer::Table | Answer::Deflections)) {
            self.send_line(state, board);
        }
    }

    pub(crate) fn send_line(&mut self, state: &DeviceState, board: &mut impl Board) {
        let Some(&answer) = self.answers.front() else { return };
        let index = self.next_line;
        let line = match answer {
            Answer::Help => help(index).map_or(AnswerLine::End, AnswerLine::Text),
            Answer::Table => report_text::line(state, board, index),
            Answer::Counters => {
                if index == 0 {
                    self.counted = state.health(board);
                }
                counter_line(&self.counted, index)
            }
            Answer::Status => status_line(state, board, index),
            Answer::Registers => dump_line(state, board, index),
            Answer::Measurement => measurement_line(state, board, index),
            Answer::Deflections => deflection_line(state, board, index),
        };
        let done = match line {
            AnswerLine::End => {
                self.answers.pop_front();
                self.next_line = 0;
                return;
            }
            AnswerLine::Skip => true,
            AnswerLine::Text(line) => board.transmit_queue(|queue| queue.send_text(&line)),
        };
        if done {
            self.next_line += 1;
        }
    }
}

fn status_line(state: &DeviceState, board: &mut impl Board, index: usize) -> AnswerLine {
    let now_us = board.now_us();
    let boot = &state.boot;
    AnswerLine::Text(match index {
        0 => {
            let sensor = if state.is_sampled() { "sampled" } else { "being probed" };
            text!("up {} s, sensor {sensor}, SCK {} Hz", now_us / 1_000_000, state.spi_clock_hz)
        }
        1 => {
            let measured = board.estimators(|estimators| estimators.measured_hz());
            let programmed = Decimal::significant(state.config.sample_period().hz(), 5);
            let (sens_avg, measured) = (state.config.sens_avg(), Decimal::significant(measured.unwrap_or(f64::NAN), 6));
            text!("rate {programmed} Hz, measured {measured} Hz, SENS_AVG {sens_avg:#06x}")
        }
        2 => {
            let samples = board.estimators(|estimators| estimators.channel(0).map(|estimator| estimator.len()));
            let (epoch, length) = (state.settings.epoch, state.settings.user.epoch_s);
            let (samples, age) = (samples.unwrap_or(0), state.epoch_age_s(now_us));
            text!("{samples} samples, epoch {epoch}, begun {age} s ago, length {length} s")
        }
        3 => {
            let losses = board.estimators(|estimators| estimators.losses(false));
            let (lost, [a, b, c, d, e, f, t, v]) = (losses.lost, losses.refused);
            text!("missing: {lost} lost; refused gyros {a} {b} {c}, accelerometers {d} {e} {f}, temp {t}, supply {v}")
        }
        4 => text!("start {} {}, {} channels restored", boot.starts, boot.cause.text(), boot.restored_channels),
        5 => match boot.clock {
            ClockSource::Crystal => text!("clock: crystal"),
            ClockSource::Internal => text!("clock: internal oscillator, the crystal did not start"),
        },
        6 if boot.safe_mode => text!("{SAFE_MODE}"),
        7 if !boot.crash_record.is_empty() => text!("crash record: {}", boot.crash_record),
        6 | 7 => return AnswerLine::Skip,
        _ => return AnswerLine::End,
    })
}

fn counter_line(health: &Health, index: usize) -> AnswerLine {
    match health.counters().get(index) {
        Some(counter) => (counter.value > 0).then(|| text!("{} {}", counter.name, counter.value)).into(),
        None => AnswerLine::End,
    }
}
