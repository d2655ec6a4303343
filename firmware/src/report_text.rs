//! The report on the running epoch as a table for a person at a terminal: the order and the words of the host's screen, in 80
//! columns of ASCII, made one line at a time. The curve follows below it.

use crate::board::Board;
use crate::channels::{CHANNELS, ChannelSet, GYROS, INERTIAL, OCTAVES};
use crate::device::DeviceState;
use crate::epoch::Regressor;
use crate::number_text::{Count, Decimal, Estimate, EstimateInUnit, Span};
use crate::report_frames::running_sums;
use crate::sample_intake::Estimators;
use adis16405_driver::Channel;
use allan_core::NoiseTerm;
use allan_core::confidence::NORMAL_975;
use link::{TextLine, text_line};

/// Deviance per point on the unseen epoch above which a model is marked, as on the host's screen: a true model scores about 1.
const HIGH_DEVIANCE: f64 = 3.0;
/// Lines of two channels whose frequencies differ by less than this share are one finding: the curve of an epoch of minutes gives
/// a frequency to within 2 %.
const SAME_FREQUENCY: f64 = 0.02;
/// Findings that are shown.
const MOST_FINDINGS: usize = 12;

/// A part of the table.
#[derive(Debug, Clone, Copy)]
enum Section {
    /// Part, samples, length, epoch.
    Headline,
    /// What is missing, and when the epoch ends.
    Record,
    Text(&'static str),
    /// Label, three coefficients and an error.
    Cells([&'static str; 5]),
    /// A row a channel from this one of [`CHANNELS`] on.
    Coefficients(usize),
    Findings,
    Health,
    /// Channels that have failed their self-test, if there are any.
    SelfTest,
    Advice,
    /// A row an octave.
    Curve,
}

/// The sections, each with its lines at most.
const SECTIONS: [(Section, usize); 17] = [
    (Section::Headline, 1),
    (Section::Record, 1),
    (Section::Text(""), 1),
    (Section::Cells(["gyro", "angle random walk", "bias instability", "rate random walk", "error on"]), 1),
    (Section::Cells(["", "deg/sqrt(s)", "mdeg/s", "mdeg/s/sqrt(s)", "unseen epoch"]), 1),
    (Section::Coefficients(0), GYROS),
    (Section::Cells(["accel", "ug/sqrt(Hz)", "ug", "ug/sqrt(s)", ""]), 1),
    (Section::Coefficients(GYROS), INERTIAL - GYROS),
    (Section::Text("95 % bounds by octaves: 2 to 9 % wider than those of all samples, on a host."), 1),
    (Section::Text(""), 1),
    (Section::Text("What was found"), 1),
    (Section::Findings, 2 * MOST_FINDINGS),
    (Section::Health, 1),
    (Section::SelfTest, 1),
    (Section::Advice, 1),
    (Section::Text(""), 1),
    (Section::Curve, OCTAVES + 2),
];

/// Line of an answer at some index.
pub(crate) enum AnswerLine {
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

/// The line of the table at an index.
pub(crate) fn line(state: &DeviceState, board: &mut impl Board, mut index: usize) -> AnswerLine {
    for (section, lines) in SECTIONS {
        if index < lines {
            return match section {
                Section::Headline => Some(headline(state, board)),
                Section::Record => Some(record(state, board)),
                Section::Text(text) => Some(text_line(format_args!("{text}"))),
                Section::Cells(cells) => Some(row(cells)),
                Section::Coefficients(first) => Some(coefficients(state, board, first + index)),
                Section::Findings if index.is_multiple_of(2) => finding(state, index / 2),
                Section::Findings => compensation(state, index / 2),
                Section::Health => Some(health(state, board)),
                Section::SelfTest => self_test(state),
                Section::Advice => Some(advice(state)),
                Section::Curve => curve(board, index),
            }
            .into();
        }
        index -= lines;
    }
    AnswerLine::End
}

/// A row of the coefficients' table: 7, 20, 19 and 19 columns, and 15 for the error, which are 80.
fn row([label, n, b, k, error]: [&str; 5]) -> TextLine {
    let line = text_line(format_args!(" {label:<6}{n:<20}{b:<19}{k:<19}{error:>13}"));
    text_line(format_args!("{}", line.trim_end()))
}

/// Text beside a label, which takes 17 columns.
fn labelled(label: &str, text: core::fmt::Arguments<'_>) -> TextLine {
    text_line(format_args!("{label:<17}{text}"))
}

fn headline(state: &DeviceState, board: &mut impl Board) -> TextLine {
    let hz = board.estimators(|estimators| estimators.scale()).rate_hz();
    let epoch = state.settings.epoch;
    let samples = board.estimators(|estimators| estimators.channel(0).map_or(0, |estimator| estimator.len()));
    let (count, length, rate) = (Count(samples), Span(samples as f64 / hz), Decimal::significant(hz, 4));
    match state.product_id {
        0 => text_line(format_args!("No sensor has answered yet")),
        part => text_line(format_args!("ADIS{part}   {count} samples   {length} at {rate} Hz   epoch {epoch}")),
    }
}

fn record(state: &DeviceState, board: &mut impl Board) -> TextLine {
    let losses = board.estimators(|estimators| estimators.losses(false));
    let refused = losses.refused[..INERTIAL].iter().copied().max().unwrap_or(0);
    let lost = match (losses.lost, refused) {
        (0, 0) => text_line(format_args!("No sample lost.")),
        (lost, 0) => text_line(format_args!("{} samples lost.", Count(lost))),
        (lost, refused) => {
            text_line(format_args!("{} samples lost, up to {} refused in a channel.", Count(lost), Count(refused)))
        }
    };
    let age = state.epoch_age_s(board.now_us());
    match u64::from(state.settings.epoch_s) {
        0 => text_line(format_args!("{lost} The epoch has no end.")),
        length => text_line(format_args!("{lost} The epoch ends in {}.", Span(length.saturating_sub(age) as f64))),
    }
}

/// N, B and K of the running epoch with their bounds, and the error of the last model on the epoch after it.
fn coefficients(state: &DeviceState, board: &mut impl Board, index: usize) -> TextLine {
    let channel = CHANNELS[index];
    // From deg/s and g to the units in the table.
    let factors = if index < GYROS { [1.0, 1e3, 1e3] } else { [1e6; 3] };
    let scale = board.estimators(|estimators| estimators.scale());
    let model = running_sums(board, index).fit_baseline(channel, scale);
    let cells: [TextLine; 3] = core::array::from_fn(|column| match model.terms().get(column) {
        Some(term) => {
            let factor = factors[column];
            let bounds = (factor * term.low, factor * term.high);
            text_line(format_args!("{}", Estimate { value: factor * term.value, bounds }))
        }
        None => text_line(format_args!("-")),
    });
    let error = state.learner.results[index].map_or_else(TextLine::new, |result| {
        let (before, after) = result.deviance_per_point;
        let mark = if after > HIGH_DEVIANCE { " !" } else { "" };
        text_line(format_args!("{} -> {}{mark}", deviance(before), deviance(after)))
    });
    let axis = text_line(format_args!("{}", channel.name().rsplit('_').next().unwrap_or_default()));
    row([&axis, &cells[0], &cells[1], &cells[2], &error])
}

/// A deviance with one decimal below 10, else without.
fn deviance(value: f64) -> Decimal {
    let digits = if value < 0.95 { 1 } else { 2 };
    Decimal::significant(value, if value < 99.5 { digits } else { 3 })
}

/// What a model has beyond N, B and K.
#[derive(Clone, Copy)]
enum Cause {
    Covariate(Regressor),
    Term(NoiseTerm, f64),
}

impl Cause {
    /// Whether one cause in two channels explains both.
    fn is_shared_with(self, other: Self) -> bool {
        let near = |a: f64, b: f64| libm::fabs(a - b) <= SAME_FREQUENCY * a;
        match (self, other) {
            (Self::Term(NoiseTerm::Filtered(a), _), Self::Term(NoiseTerm::Filtered(b), _)) => a.taps == b.taps,
            (Self::Term(NoiseTerm::Sinusoid(a), _), Self::Term(NoiseTerm::Sinusoid(b), _)) => {
                near(a.frequency, b.frequency)
            }
            (Self::Term(NoiseTerm::Resonance(a), _), Self::Term(NoiseTerm::Resonance(b), _)) => {
                near(a.frequency, b.frequency)
            }
            _ => false,
        }
    }
}

/// The causes in the model of an inertial channel.
fn causes(state: &DeviceState, index: usize) -> impl Iterator<Item = Cause> {
    let model = &state.learner.models[index];
    let covariates = model.regressors.iter().map(|&regressor| Cause::Covariate(regressor));
    covariates.chain(model.added_terms().map(|(term, value)| Cause::Term(term, value)))
}

/// Every finding with the first channel that shows it, in the order of the channels.
fn findings(state: &DeviceState) -> impl Iterator<Item = (usize, Cause)> {
    let all = (0..INERTIAL).flat_map(move |index| causes(state, index).map(move |cause| (index, cause)));
    all.filter(move |&(index, cause)| {
        !(0..index).any(|earlier| causes(state, earlier).any(|other| other.is_shared_with(cause)))
    })
}

fn finding(state: &DeviceState, number: usize) -> Option<TextLine> {
    let Some((first, cause)) = findings(state).nth(number) else {
        let nothing = match state.learner.models[0].baseline(state.report_scale) {
            Some(_) => "Nothing: no term beyond N, B and K was added.",
            None => "Nothing yet: effects are searched for at the end of an epoch.",
        };
        return (number == 0).then(|| text_line(format_args!(" {nothing}")));
    };
    let mut channels = ChannelSet::EMPTY;
    for index in first..INERTIAL {
        let shows = index == first || causes(state, index).any(|other| other.is_shared_with(cause));
        channels.insert_if(index, shows);
    }
    let label = text_line(format_args!("{:>2}  {}", number + 1, channel_list(channels)));
    Some(labelled(&label, format_args!("{}", physics(CHANNELS[first], cause))))
}

/// Below the first covariate of a channel: what subtracting its covariates did to the epoch after.
fn compensation(state: &DeviceState, number: usize) -> Option<TextLine> {
    let (index, _) = findings(state).nth(number).filter(|(_, cause)| matches!(cause, Cause::Covariate(_)))?;
    let is_first =
        number.checked_sub(1).and_then(|before| findings(state).nth(before)).is_none_or(|(of, _)| of != index);
    let result = state.learner.results[index].filter(|_| is_first)?;
    let (drift, tau) = (result.drift, Span(result.tau_s));
    let unit = CHANNELS[index].unit();
    let (raw, compensated) = (EstimateInUnit::new(drift.raw, unit), EstimateInUnit::new(drift.compensated, unit));
    Some(labelled("", format_args!("Subtracted, unseen epoch: {raw} at {tau} -> {compensated}.")))
}

/// One sentence of at most 63 columns.
fn physics(channel: Channel, cause: Cause) -> TextLine {
    let unit = channel.unit();
    match cause {
        Cause::Covariate(Regressor { covariate, value, error, .. }) => {
            let (name, per) = match CHANNELS[covariate] {
                Channel::Temp => ("the temperature", "degC"),
                Channel::Supply => ("the supply", "V"),
                Channel::AcclX => ("accel x", "g"),
                Channel::AcclY => ("accel y", "g"),
                _ => ("accel z", "g"),
            };
            let half_width = NORMAL_975 * error;
            let estimate = Estimate { value, bounds: (value - half_width, value + half_width) };
            let unit = text_line(format_args!("{unit}/{per}"));
            text_line(format_args!("The bias follows {name}: {}.", EstimateInUnit { estimate, unit: &unit }))
        }
        Cause::Term(term, value) => {
            let size = EstimateInUnit::new(value, unit);
            match term {
                NoiseTerm::Filtered(filter) => {
                    let taps = Decimal::significant(f64::from(filter.taps), 3);
                    text_line(format_args!("The part's low-pass filter of {taps} taps smooths the samples."))
                }
                NoiseTerm::Sinusoid(line) => {
                    let frequency = EstimateInUnit::new(line.frequency, "Hz");
                    text_line(format_args!("A vibration or hum at {frequency}: a narrow line of {size}."))
                }
                NoiseTerm::Resonance(line) => {
                    let (frequency, width) =
                        (EstimateInUnit::new(line.frequency, "Hz"), EstimateInUnit::new(line.bandwidth, "Hz"));
                    text_line(format_args!("A vibration around {frequency}, {width} wide: {size} rms."))
                }
                NoiseTerm::Markov(noise) => {
                    text_line(format_args!("A noise with a memory of {}: {size} rms.", Span(noise.time_constant)))
                }
                NoiseTerm::Quantization => text_line(format_args!("Rounding shows: a quantization noise of {size}*s.")),
                NoiseTerm::RateRamp => text_line(format_args!("The bias drifts in a straight line by {size}/s.")),
                // Terms of the baseline, and one that the device does not trace.
                NoiseTerm::AngleRandomWalk
                | NoiseTerm::BiasInstability
                | NoiseTerm::RateRandomWalk
                | NoiseTerm::LowPass(_) => TextLine::new(),
            }
        }
    }
}

/// The inertial channels of a set in few words, as on the host's screen.
fn channel_list(channels: ChannelSet) -> TextLine {
    let mut text = TextLine::new();
    if channels.has_all_inertial() {
        return text_line(format_args!("all channels"));
    }
    for (indices, one, all) in [(0..GYROS, "gyro", "gyros"), (GYROS..INERTIAL, "accel", "accels")] {
        let members = || indices.clone().filter(|&index| channels.contains(index));
        let comma = if text.is_empty() || members().next().is_none() { "" } else { ", " };
        text = match members().count() {
            0 => text,
            count if count == indices.len() => text_line(format_args!("{text}{comma}{all}")),
            _ => members().fold(text_line(format_args!("{text}{comma}{one}")), |text, index| {
                text_line(format_args!("{text} {}", ["x", "y", "z"][index % GYROS]))
            }),
        };
    }
    text
}

/// Use of the bursts, recoveries and load in one line.
fn health(state: &DeviceState, board: &mut impl Board) -> TextLine {
    let health = state.health(board);
    let (used, bursts) = (Count(u64::from(health.used)), Count(u64::from(health.bursts)));
    let awake = Decimal::significant(f64::from(health.awake_permille) / 10.0, 2);
    let recoveries = match health.recoveries {
        0 => text_line(format_args!("never lost")),
        1 => text_line(format_args!("lost once")),
        lost => text_line(format_args!("lost {} times", Count(u64::from(lost)))),
    };
    let starts = state.boot.starts;
    text_line(format_args!("Health   {used} of {bursts} bursts used; {recoveries}; awake {awake} %; start {starts}."))
}

/// The channels that have failed the self-test.
fn self_test(state: &DeviceState) -> Option<TextLine> {
    let failed = state.recovery.failed_test;
    let list = || channel_list(failed);
    (!failed.is_empty())
        .then(|| labelled("Self-test failed", format_args!("{}; they are used. Repeat it at rest: check", list())))
}

/// The next step: for the first finding that has one, or towards a first model.
fn advice(state: &DeviceState) -> TextLine {
    let far_off = state.learner.results.iter().flatten().any(|result| result.deviance_per_point.1 > HIGH_DEVIANCE);
    let step = findings(state).find_map(|(_, cause)| match cause {
        Cause::Covariate(_) => Some("Subtract this sensitivity times the covariate's change."),
        Cause::Term(NoiseTerm::Sinusoid(_) | NoiseTerm::Resonance(_), _) => {
            Some("Look for a fan, a motor or the mains.")
        }
        Cause::Term(NoiseTerm::Markov(_), _) => Some("Give the filter a Gauss-Markov state of this time constant."),
        Cause::Term(NoiseTerm::RateRamp, _) => Some("Let the part warm up before recording."),
        Cause::Term(NoiseTerm::Quantization, _) => Some("Read the part in a smaller range."),
        Cause::Term(..) => None,
    });
    let step = match step {
        _ if far_off => "The model fails on the unseen epoch (!): make epochs longer.",
        Some(step) => step,
        None if state.settings.epoch_s == 0 => "Set an epoch for effects to be searched for: e 3600 is an hour.",
        None => "Let more epochs end: k has the counters, r the report.",
    };
    labelled("What to do", format_args!("{step}"))
}

/// Title, head, and the Allan deviations at one octave each; `None` where no channel has a value.
fn curve(board: &mut impl Board, line: usize) -> Option<TextLine> {
    match line {
        0 => Some(text_line(format_args!("Allan deviation, gyros in deg/s, accelerometers in mg"))),
        1 => Some(octave_cells("tau/s", ["gyro x", "gyro y", "gyro z", "accel x", "accel y", "accel z"])),
        line => board.estimators(|estimators| octave_row(estimators, line - 2)),
    }
}

/// Columns of a row of the curve.
fn octave_cells(tau: &str, [a, b, c, d, e, f]: [&str; INERTIAL]) -> TextLine {
    text_line(format_args!("{tau:>9}{a:>11}{b:>11}{c:>11}{d:>11}{e:>11}{f:>11}"))
}

/// The Allan deviations of the inertial channels at one octave; `None` where no channel has a value.
fn octave_row(estimators: &Estimators<'_>, octave: usize) -> Option<TextLine> {
    let scale = estimators.scale();
    let n = (1_u64 << octave.min(OCTAVES)) as f64;
    let deviation = |index: usize| {
        let variance = estimators.channel(index)?.allan_variance(octave)?;
        let factor = if index < GYROS { 1.0 } else { 1e3 };
        Some(factor * scale.lsb(CHANNELS[index]) * libm::sqrt(variance))
    };
    let deviations: [Option<f64>; INERTIAL] = core::array::from_fn(deviation);
    let cells =
        deviations.map(|value| text_line(format_args!("{}", Decimal::significant(value.unwrap_or(f64::NAN), 4))));
    let tau = text_line(format_args!("{}", Decimal::significant(n * scale.period_s(), 4)));
    deviations.iter().any(Option::is_some).then(|| octave_cells(&tau, cells.each_ref().map(|cell| cell.as_str())))
}
