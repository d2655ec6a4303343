//! Text for a person at a terminal: single lines, and answers of several lines that are made and sent one line at a time.

use crate::board::Board;
use crate::command::HELP;
use crate::device::DeviceState;
use crate::estimators::Estimators;
use crate::learner::ValidationResult;
use crate::report::running_sums;
use crate::statistics::{CHANNELS, ChannelEstimator, INERTIAL, OCTAVES};
use core::fmt::{self, Arguments};
use heapless::Deque;
use link::{ClockSource, Health, MAX_COVARIATES, TextLine, text_line};

/// Answer to the version command.
pub(crate) const VERSION_LINE: &str = concat!("ADIS16405 noise observatory ", env!("CARGO_PKG_VERSION"));

/// Text lines that may wait for room in the transmit queue.
const WAITING_LINES: usize = 4;
/// Answers that may wait, the one that is being sent included.
const WAITING_ANSWERS: usize = 4;

/// An answer of several lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Answer {
    Help,
    /// The report as a table.
    Table,
    Counters,
    Status,
}

/// Text lines and answers that wait to be sent.
pub(crate) struct Console {
    lines: Deque<TextLine, WAITING_LINES>,
    /// Answers in order; the first is being sent.
    answers: Deque<Answer, WAITING_ANSWERS>,
    /// Index of the next line of the first answer.
    next_line: usize,
}

/// Line of an answer at some index.
enum AnswerLine {
    Text(TextLine),
    /// No line at this index, but there may be one at a later index.
    Skip,
    End,
}

impl From<Option<TextLine>> for AnswerLine {
    fn from(line: Option<TextLine>) -> Self {
        line.map_or(Self::Skip, Self::Text)
    }
}

impl Console {
    pub(crate) const fn new() -> Self {
        Self { lines: Deque::new(), answers: Deque::new(), next_line: 0 }
    }

    /// Sends a text line, after those that wait. If too many wait, the oldest is dropped.
    pub(crate) fn print(&mut self, board: &mut impl Board, text: Arguments<'_>) {
        let line = text_line(text);
        if self.lines.is_empty() && board.transmit_queue(|queue| queue.send_text(&line)) {
            return;
        }
        if self.lines.is_full() {
            self.lines.pop_front();
        }
        let _room_was_made = self.lines.push_back(line);
    }

    /// Sends the text lines that wait. Returns whether there is room for a message or a line of an answer.
    pub(crate) fn flush(&mut self, board: &mut impl Board) -> bool {
        while let Some(line) = self.lines.front() {
            if !board.transmit_queue(|queue| queue.send_text(line)) {
                return false;
            }
            self.lines.pop_front();
        }
        board.transmit_queue(|queue| queue.has_room())
    }

    /// Queues an answer after those that wait.
    pub(crate) fn answer(&mut self, board: &mut impl Board, answer: Answer) {
        if self.answers.push_back(answer).is_err() {
            self.print(board, format_args!("busy: too many answers waiting; repeat the command"));
        }
    }

    pub(crate) fn has_answers(&self) -> bool {
        !self.answers.is_empty()
    }

    /// Sends the next line of the first answer, unless it is a table, whose lines may need a model fit.
    pub(crate) fn send_quick_line(&mut self, state: &DeviceState, board: &mut impl Board) {
        if self.answers.front().is_some_and(|answer| *answer != Answer::Table) {
            self.send_line(state, board);
        }
    }

    /// Makes and sends the next line of the first answer.
    pub(crate) fn send_line(&mut self, state: &DeviceState, board: &mut impl Board) {
        let Some(&answer) = self.answers.front() else { return };
        let index = self.next_line;
        let line = match answer {
            Answer::Help => {
                HELP.get(index).map_or(AnswerLine::End, |text| AnswerLine::Text(text_line(format_args!("{text}"))))
            }
            Answer::Table => table_line(state, board, index),
            Answer::Counters => counter_line(&state.health(board), index),
            Answer::Status => status_line(state, board, index),
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

/// Head of the table.
const TABLE_HEAD: [&str; 2] = [
    "Allan deviation, gyros in deg/s, accelerometers in g",
    "     tau/s     gyro_x     gyro_y     gyro_z     accl_x     accl_y     accl_z",
];

/// Lines of an inertial channel below the table: the coefficients, its regressors, its validation, and its missing samples.
const VALIDATION_LINE: usize = 1 + MAX_COVARIATES;
const MISSING_LINE: usize = VALIDATION_LINE + 1;

/// Head, a row for every octave, then for every inertial channel the coefficients of the baseline model, for every
/// regressor a line, the validation on the last finished epoch, and the samples missing in the running one.
fn table_line(state: &DeviceState, board: &mut impl Board, index: usize) -> AnswerLine {
    if let Some(head) = TABLE_HEAD.get(index) {
        return AnswerLine::Text(text_line(format_args!("{head}")));
    }
    let index = index - TABLE_HEAD.len();
    if index < OCTAVES {
        return board.estimators(|estimators| octave_row(estimators, index)).into();
    }
    let (line, channel) = ((index - OCTAVES) / INERTIAL, (index - OCTAVES) % INERTIAL);
    match line {
        0 => AnswerLine::Text(coefficients_line(state, board, channel)),
        1..=MAX_COVARIATES => regressor_line(state, channel, line - 1).into(),
        VALIDATION_LINE => validation_line(state, channel).into(),
        MISSING_LINE => missing_line(board, channel).into(),
        _ => AnswerLine::End,
    }
}

/// The Allan deviations of the inertial channels at one octave; `None` where no channel has a value.
fn octave_row(estimators: &Estimators<'_>, octave: usize) -> Option<TextLine> {
    let config = estimators.config();
    let n = (1_u64 << octave.min(OCTAVES)) as f64;
    let deviation = |index: usize| {
        let variance = estimators.channel(index)?.allan_variance(octave)?;
        Some(CHANNELS[index].lsb(config.range()) * libm::sqrt(variance))
    };
    let mut any = false;
    let cells: [f64; INERTIAL] = core::array::from_fn(|index| {
        let cell = deviation(index);
        any |= cell.is_some();
        cell.unwrap_or(f64::NAN)
    });
    let [a, b, c, d, e, f] = cells.map(|cell| text_line(format_args!("{}", ShortFloat(cell))));
    let tau = text_line(format_args!("{}", ShortFloat(n / config.sample_period().hz())));
    any.then(|| text_line(format_args!("{tau:>10} {a:>10} {b:>10} {c:>10} {d:>10} {e:>10} {f:>10}")))
}

fn coefficients_line(state: &DeviceState, board: &mut impl Board, index: usize) -> TextLine {
    let channel = CHANNELS[index];
    let model = running_sums(board, index).fit_baseline(channel, state.config);
    let mut text = text_line(format_args!("{}", channel.name()));
    for term in model.terms() {
        // What does not fit is cut off.
        let (value, low, high) = (ShortFloat(term.value), ShortFloat(term.low), ShortFloat(term.high));
        let _ = text.push_str(&text_line(format_args!("  {value} ({low}..{high})")));
    }
    text
}

/// A covariate that has been subtracted from the channel since the last finished epoch.
fn regressor_line(state: &DeviceState, index: usize, number: usize) -> Option<TextLine> {
    let regressor = state.learner.models[index].regressors.get(number)?;
    let (value, error) = (ShortFloat(regressor.value), ShortFloat(regressor.error));
    let (name, covariate) = (CHANNELS[index].name(), CHANNELS[regressor.covariate].name());
    Some(text_line(format_args!("{name} sensitivity to {covariate}: {value} +- {error}")))
}

/// The validation of the channel's model on the last finished epoch.
fn validation_line(state: &DeviceState, index: usize) -> Option<TextLine> {
    let ValidationResult { deviance_per_point, drift } = state.learner.results[index]?;
    let (before, after) = (ShortFloat(deviance_per_point.0), ShortFloat(deviance_per_point.1));
    let (raw, compensated) = (ShortFloat(drift.raw), ShortFloat(drift.compensated));
    let tau = ShortFloat(drift.n as f64 / state.config.sample_period().hz());
    let name = CHANNELS[index].name();
    let text = format_args!("{name} unseen: adev at {tau} s {raw} -> {compensated}, error {before} -> {after}");
    Some(text_line(text))
}

/// The samples missing in a channel; `None` if there are none.
fn missing_line(board: &mut impl Board, index: usize) -> Option<TextLine> {
    let losses = board.estimators(|estimators| estimators.losses(false));
    let (name, lost, refused) = (CHANNELS[index].name(), losses.lost, losses.refused[index]);
    let replaced = board.estimators(|estimators| estimators.channel(index).map_or(0, ChannelEstimator::replaced));
    let text = format_args!("{name} missing: {lost} lost, {refused} refused; {replaced} replaced in the curve");
    (lost + refused > 0).then(|| text_line(text))
}

fn status_line(state: &DeviceState, board: &mut impl Board, index: usize) -> AnswerLine {
    let now_us = board.now_us();
    let boot = &state.boot;
    AnswerLine::Text(match index {
        0 => {
            let sensor = if state.is_sampled() { "sampled" } else { "being probed" };
            text_line(format_args!("up {} s, sensor {sensor}, SCK {} Hz", now_us / 1_000_000, state.spi_clock_hz))
        }
        1 => {
            let measured = board.estimators(|estimators| estimators.measured_hz());
            let programmed = ShortFloat(state.config.sample_period().hz());
            let (sens_avg, measured) = (state.config.sens_avg(), ShortFloat(measured.unwrap_or(f64::NAN)));
            text_line(format_args!("rate {programmed} Hz, measured {measured} Hz, SENS_AVG {sens_avg:#06x}"))
        }
        2 => {
            let samples = board.estimators(|estimators| estimators.channel(0).map(|estimator| estimator.len()));
            let (epoch, length) = (state.settings.epoch, state.settings.epoch_s);
            let (samples, age) = (samples.unwrap_or(0), state.epoch_age_s(now_us));
            text_line(format_args!("{samples} samples, epoch {epoch}, begun {age} s ago, length {length} s"))
        }
        3 => {
            let losses = board.estimators(|estimators| estimators.losses(false));
            let (lost, [a, b, c, d, e, f, t, v]) = (losses.lost, losses.refused);
            text_line(format_args!(
                "missing: {lost} lost; refused gyros {a} {b} {c}, accelerometers {d} {e} {f}, temp {t}, supply {v}"
            ))
        }
        4 => text_line(format_args!(
            "start {}: {:?}, {} channels restored",
            boot.starts, boot.cause, boot.restored_channels
        )),
        5 => match boot.clock {
            ClockSource::Crystal => text_line(format_args!("clock: crystal")),
            ClockSource::Internal => text_line(format_args!("clock: internal oscillator, the crystal did not start")),
        },
        6 if !boot.crash_record.is_empty() => text_line(format_args!("crash record: {}", boot.crash_record)),
        _ => return AnswerLine::End,
    })
}

/// A line for each counter that is not 0.
fn counter_line(health: &Health, index: usize) -> AnswerLine {
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
        ("spurious_edges", health.spurious_edges),
        ("suspect", health.suspect),
        ("recoveries", health.recoveries),
        ("raw_dropped", health.raw_dropped),
        ("serial_overruns", health.serial_overruns),
        ("bad_commands", health.bad_commands),
        ("awake_permille", health.awake_permille),
        ("sampling_cycles", health.sampling_cycles),
        ("estimator_cycles", health.estimator_cycles),
        ("stack_bytes", health.stack_bytes),
        ("stack_size", health.stack_size),
        ("partly_used", health.partly_used),
        ("marked", health.marked),
        ("implausible_supply", health.implausible_supply),
        ("diag_reads", health.diag_reads),
        ("diag_supply_low", health.diag_supply_low),
        ("diag_supply_high", health.diag_supply_high),
        ("diag_flash_update", health.diag_flash_update),
        ("diag_spi", health.diag_spi),
        ("diag_over_range", health.diag_over_range),
        ("diag_self_test", health.diag_self_test),
        ("diag_flash_checksum", health.diag_flash_checksum),
        ("diag_alarm", health.diag_alarm),
        ("rereads", health.rereads),
        ("bus_resets", health.bus_resets),
        ("sensor_resets", health.sensor_resets),
        ("reset_lines", health.reset_lines),
    ];
    match counters.get(index) {
        Some((name, count)) => (*count > 0).then(|| text_line(format_args!("{name} {count}"))).into(),
        None => AnswerLine::End,
    }
}

/// Formats a number with four digits and a power of ten, such as `3.333e-2`; what is not finite as `-`.
///
/// The formatting of `core` takes 20 kB of flash; this takes 1 kB. The fourth digit is rounded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShortFloat(pub f64);

impl fmt::Display for ShortFloat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (sign, mut value) = if self.0 < 0.0 { ("-", -self.0) } else { ("", self.0) };
        if !value.is_finite() {
            return f.write_str("-");
        }
        if value < 1e-300 {
            return f.write_str("0");
        }
        let mut exponent = 0;
        while value >= 10.0 {
            (value, exponent) = (value / 10.0, exponent + 1);
        }
        while value < 1.0 {
            (value, exponent) = (value * 10.0, exponent - 1);
        }
        let mut digits = (value * 1000.0 + 0.5) as u32;
        if digits >= 10_000 {
            (digits, exponent) = (digits / 10, exponent + 1);
        }
        write!(f, "{sign}{}.{:03}e{exponent}", digits / 1000, digits % 1000)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::string::ToString;

    /// `core`'s own formatting is the reference.
    #[test]
    fn short_floats_equal_the_standard_formatting() {
        let mut value = 1.234_56e-30;
        while value < 1e30 {
            let expected = format_args!("{value:.3e}").to_string();
            assert_eq!(format_args!("{}", ShortFloat(value)).to_string(), expected);
            assert_eq!(format_args!("{}", ShortFloat(-value)).to_string(), format_args!("-{expected}").to_string());
            value *= 1.37;
        }
        for (value, text) in [(0.0, "0"), (f64::NAN, "-"), (9.9999, "1.000e1"), (1.0, "1.000e0")] {
            assert_eq!(format_args!("{}", ShortFloat(value)).to_string(), text);
        }
    }
}
