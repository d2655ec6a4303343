//! The running epoch as a table: 80 columns of ASCII, line by line.

use crate::answer::AnswerLine;
use crate::board::Board;
use crate::channels::{CHANNELS, GYROS, INERTIAL, OCTAVES};
use crate::device::DeviceState;
use crate::learner::{EpochModel, MAX_FINDINGS};
use crate::number_text::{Count, Decimal, Estimate};
use crate::report_frames::running_sums;
use crate::sample_intake::Estimators;
use allan_core::NoiseTerm;
use link::{TextLine, text};

type Line<B> = fn(&DeviceState, &mut B, usize) -> Option<TextLine>;

pub(crate) fn line<B: Board>(state: &DeviceState, board: &mut B, mut index: usize) -> AnswerLine {
    let sections: [(Line<B>, usize); 12] = [
        (|state, board, _| Some(headline(state, board)), 1),
        (|state, board, _| Some(record(state, board)), 1),
        (|_, _, _| Some(TextLine::new()), 1),
        (|_, _, _| Some(row(["gyro", "angle random walk", "bias instability", "rate random walk", "error on"])), 1),
        (|_, _, _| Some(row(["", "deg/sqrt(s)", "mdeg/s", "mdeg/s/sqrt(s)", "unseen epoch"])), 1),
        (|state, board, index| Some(coefficients(state, board, index)), GYROS),
        (|_, _, _| Some(row(["accel", "ug/sqrt(Hz)", "ug", "ug/sqrt(s)", ""])), 1),
        (|state, board, index| Some(coefficients(state, board, GYROS + index)), INERTIAL - GYROS),
        (|_, _, _| Some(text!("{BOUNDS}")), 1),
        (|_, _, _| Some(TextLine::new()), 1),
        (|state, _, index| found(&state.learner.models, index), INERTIAL * MAX_FINDINGS),
        (|_, board, index| curve(board, index), OCTAVES + 2),
    ];
    for (line, lines) in sections {
        if index < lines {
            return line(state, board, index).into();
        }
        index -= lines;
    }
    AnswerLine::End
}

const BOUNDS: &str = "95 % bounds by octaves: 2 to 9 % wider than those of all samples, on a host.";

/// A row of 8, 20, 19, 19 and 13 columns.
fn row([label, n, b, k, error]: [&str; 5]) -> TextLine {
    let line = text!(" {label:<7}{n:<20}{b:<19}{k:<19}{error:>13}");
    text!("{}", line.trim_end())
}

fn headline(state: &DeviceState, board: &mut impl Board) -> TextLine {
    let hz = board.estimators(|estimators| estimators.scale()).rate_hz();
    let samples = board.estimators(|estimators| estimators.channel(0).map_or(0, |estimator| estimator.len()));
    let (epoch, seconds, rate) =
        (state.settings.epoch, Count((samples as f64 / hz) as u64), Decimal::significant(hz, 4));
    match state.product_id {
        0 => text!("No sensor has answered yet"),
        part => text!("ADIS{part}   {} samples   {seconds} s at {rate} Hz   epoch {epoch}", Count(samples)),
    }
}

fn record(state: &DeviceState, board: &mut impl Board) -> TextLine {
    let losses = board.estimators(|estimators| estimators.losses(false));
    let refused = losses.refused[..INERTIAL].iter().copied().max().unwrap_or(0);
    let lost = text!("{} lost, {} refused at most", Count(losses.lost), Count(refused));
    let age = state.epoch_age_s(board.now_us());
    match u64::from(state.settings.user.epoch_s) {
        0 => text!("{lost}; the epoch has no end"),
        length => text!("{lost}; the epoch ends in {} s", Count(length.saturating_sub(age))),
    }
}

/// The row of a channel: N, B and K with bounds, and the last model's error; marks a failed self-test.
fn coefficients(state: &DeviceState, board: &mut impl Board, index: usize) -> TextLine {
    let channel = CHANNELS[index];
    // Factors from deg/s and g to the table's units.
    let factors = if index < GYROS { [1.0, 1e3, 1e3] } else { [1e6; 3] };
    let scale = board.estimators(|estimators| estimators.scale());
    let model = running_sums(board, index).fit_baseline(channel, scale);
    let cells: [TextLine; 3] = core::array::from_fn(|column| match model.terms().get(column) {
        Some(term) => {
            let factor = factors[column];
            let bounds = (factor * term.low, factor * term.high);
            text!("{}", Estimate { value: factor * term.value, bounds })
        }
        None => text!("-"),
    });
    let error = state.learner.errors[index].map_or_else(TextLine::new, |(before, after)| {
        text!("{} -> {}", Decimal::significant(before, 2), Decimal::significant(after, 2))
    });
    let mark = if state.recovery.failed_test.contains(index) { "fail" } else { "" };
    let axis = text!("{} {mark}", axis(index));
    row([axis.trim_end(), &cells[0], &cells[1], &cells[2], &error])
}

fn axis(index: usize) -> &'static str {
    ["x", "y", "z"][index % GYROS]
}

/// A line such as `gyro x temperature 0.048 +- 0.007 deg/s/degC`; `None` beyond the last finding.
fn found(models: &[EpochModel; INERTIAL], index: usize) -> Option<TextLine> {
    let (channel, number) = (index / MAX_FINDINGS, index % MAX_FINDINGS);
    let (model, unit) = (models.get(channel)?, CHANNELS[channel].unit());
    let label = text!(" {} {}", if channel < GYROS { "gyro" } else { "accel" }, axis(channel));
    if let Some(regressor) = model.regressors.get(number) {
        let covariate = CHANNELS[regressor.covariate];
        let estimate = Estimate { value: regressor.value, bounds: regressor.bounds() };
        let of = covariate.unit();
        return Some(text!("{label:<9}{:<32}{estimate} {unit}/{of}", covariate.name()));
    }
    let (term, value) = model.added_terms().nth(number - model.regressors.len())?;
    let three = |value| Decimal::significant(value, 3);
    let name = match term {
        NoiseTerm::Filtered(filter) => text!("filter of {} taps", three(f64::from(filter.taps))),
        NoiseTerm::Sinusoid(line) => text!("sinusoid, {} Hz", three(line.frequency)),
        NoiseTerm::Resonance(line) => {
            text!("resonance, {} Hz, {} Hz wide", three(line.frequency), three(line.bandwidth))
        }
        NoiseTerm::Markov(noise) => text!("Gauss-Markov, {} s", three(noise.time_constant)),
        NoiseTerm::Quantization => text!("quantization"),
        NoiseTerm::RateRamp => text!("rate ramp"),
        // These terms are part of the baseline, or are not traced.
        NoiseTerm::AngleRandomWalk | NoiseTerm::BiasInstability | NoiseTerm::RateRandomWalk | NoiseTerm::LowPass(_) => {
            return None;
        }
    };
    let per = match term {
        NoiseTerm::Filtered(_) => "*sqrt(s)",
        NoiseTerm::Quantization => "*s",
        NoiseTerm::RateRamp => "/s",
        _ => "",
    };
    Some(text!("{label:<9}{name:<32}{} {unit}{per}", three(value)))
}

/// A line of the table of Allan deviations: title, head, octaves; `None` without values.
fn curve(board: &mut impl Board, line: usize) -> Option<TextLine> {
    match line {
        0 => Some(text!("Allan deviation, gyros in deg/s, accelerometers in mg")),
        1 => Some(octave_cells("tau/s", ["gyro x", "gyro y", "gyro z", "accel x", "accel y", "accel z"])),
        line => board.estimators(|estimators| octave_row(estimators, line - 2)),
    }
}

fn octave_cells(tau: &str, [a, b, c, d, e, f]: [&str; INERTIAL]) -> TextLine {
    text!("{tau:>9}{a:>11}{b:>11}{c:>11}{d:>11}{e:>11}{f:>11}")
}

fn octave_row(estimators: &Estimators<'_>, octave: usize) -> Option<TextLine> {
    let scale = estimators.scale();
    let n = (1_u64 << octave.min(OCTAVES)) as f64;
    let deviation = |index: usize| {
        let variance = estimators.channel(index)?.allan_variance(octave)?;
        let factor = if index < GYROS { 1.0 } else { 1e3 };
        Some(factor * scale.lsb(CHANNELS[index]) * libm::sqrt(variance))
    };
    let deviations: [Option<f64>; INERTIAL] = core::array::from_fn(deviation);
    let cells = deviations.map(|value| text!("{}", Decimal::significant(value.unwrap_or(f64::NAN), 4)));
    let tau = text!("{}", Decimal::significant(n * scale.period_s(), 4));
    deviations.iter().any(Option::is_some).then(|| octave_cells(&tau, cells.each_ref().map(|cell| cell.as_str())))
}
