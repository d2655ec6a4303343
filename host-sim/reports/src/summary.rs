//! The summary of a report: trust, coefficients, contradictions, next steps.

mod channels;
mod coefficient_table;
mod condition;
mod contradictions;
mod departures;
mod environment;
mod finding_list;
mod length_advice;
mod model_error;

pub use crate::coefficients::coefficient;
use crate::finding_text::{ALL_CHANNELS, channel_list};
use crate::formatting::count;
use crate::part_note;
use crate::rounding::{plain, significant, span};
use channels::is_constant;
pub(crate) use channels::{inertial, is_inertial, is_sensed};
pub(crate) use coefficient_table::coefficients_in_short;
pub use coefficient_table::{
    ChannelCoefficients, CoefficientTable, CoefficientTableRow, coefficient_tables, tables_of_channels,
};
use condition::{has_moved, losses, periods, report_length_s, rest};
pub use condition::{longest_at_rest, time_options};
pub use contradictions::contradictions;
pub(crate) use contradictions::contradictions_in_short;
pub use departures::unexplained;
pub(crate) use departures::unexplained_in_short;
pub use environment::conditions;
pub(crate) use finding_list::{advice, finding_order, finding_text};
pub use finding_list::{findings, numbered_steps};
use length_advice::{LengthAdvice, is_short, length_advice};
pub use model_error::is_fitted_to_later_quarter;
pub(crate) use model_error::{HIGH_DEVIANCE, deviance_per_point, models, off_percent};
use model_error::{failures, is_high, recent_fit, unseen_half, without_events};
use noise_analysis::effects::Effect;
use noise_analysis::report::{ChannelReport, Finding, PartNote, Report};

/// Least part of missing samples that is told against a record.
const MANY_LOST: f64 = 0.01;

/// Samples for a correlation of 0.15 at five standard errors.
const SAMPLES_FOR_FILTER: u64 = 1000;

const QUICK: &str = "Quick report, of the curves alone: spectra, spikes, steps, motion, temperature and other causes that channels \
                     have in common, and changes of the noise were not looked for.";

/// Name of the part, or a description without a profile.
pub fn part_name(report: &Report) -> &str {
    if ["", "generic"].contains(&report.part.name.as_str()) { "Inertial sensor" } else { &report.part.name }
}

pub fn headline(report: &Report, source: Option<&str>) -> Vec<String> {
    let length = span(report_length_s(report));
    let rate = plain(report.sample_rate_hz, 4);
    let samples = format!("{} samples", count(report.samples));
    let record = format!("{length} at {rate} Hz");
    [Some(part_name(report)), source, Some(samples.as_str()), Some(record.as_str())]
        .into_iter()
        .flatten()
        .map(str::to_owned)
        .collect()
}

/// The sentence for no finding, with its channels.
pub fn nothing_found(report: &Report) -> String {
    let sensed = report.channels.iter().filter(|channel| is_sensed(channel) && !is_constant(channel));
    let (failing, described): (Vec<&ChannelReport>, Vec<&ChannelReport>) = sensed.partition(|channel| is_high(channel));
    let named = |channels: &[&ChannelReport]| match channel_list(channels.iter().map(|channel| &channel.name)) {
        all if all == ALL_CHANNELS => "gyros and accelerometers".to_owned(),
        names => names,
    };
    if !failing.is_empty() {
        format!("Nothing with a name, but N, B and K do not describe {}.", named(&failing))
    } else if !contradictions(report).is_empty() {
        format!("Nothing with a name, but N, B and K do not describe all of {}.", named(&described))
    } else if is_short(report) {
        "Nothing: a record as short as this one shows strong effects only.".to_owned()
    } else if described.is_empty() {
        "Nothing.".to_owned()
    } else {
        let within = if report.quick { " in the curves" } else { "" };
        let of = if report.quick { "those of " } else { "" };
        format!("Nothing{within}: N, B and K describe {of}{}.", named(&described))
    }
}

/// Trust, rest and losses, error on the unseen half, use of the length, errors without spikes and knocks.
pub fn record_sentences(report: &Report) -> Vec<String> {
    answer(report).into_iter().chain(record_in_detail(report)).collect()
}

/// Trust, rest and losses, error on the unseen half.
pub(crate) fn answer(report: &Report) -> Vec<String> {
    condition(report).into_iter().chain(unseen_half(report)).collect()
}

/// Use of the length, fitted part, errors without spikes and knocks.
pub(crate) fn record_in_detail(report: &Report) -> Vec<String> {
    let LengthAdvice { known, except, longer, limits } = length_advice(report);
    let length = known.into_iter().chain(except).chain(longer).chain(limits);
    length.chain(recent_fit(report)).chain(without_events(report)).collect()
}

/// Sentences for the screen: fewer notes, nothing of its table.
pub fn record_sentences_in_short(report: &Report) -> Vec<String> {
    let LengthAdvice { known, longer, .. } = length_advice(report);
    let notes = part_note::in_short(&told_notes(report));
    let unseen = unseen_half(report);
    // The screen has little room, and its table has the errors: first what a short record is good for.
    let [first, second] = if is_short(report) { [known, unseen] } else { [unseen, known] };
    let sentences = condition(report).into_iter().chain(first).chain(second).chain(longer);
    sentences.chain(notes).chain(recent_fit(report)).collect()
}

fn condition(report: &Report) -> Vec<String> {
    let mut sentences = vec![trust(report), rest(report), losses(report)];
    sentences.extend(report.quick.then(|| QUICK.to_owned()));
    sentences.retain(|sentence| !sentence.is_empty());
    sentences
}

/// Trust, and reasons against it; empty without a channel.
fn trust(report: &Report) -> String {
    if inertial(report).next().is_none() {
        return String::new();
    }
    if has_moved(report) {
        return "This recording cannot be trusted as it is.".to_owned();
    }
    let lost = report.dropped.get("gap").copied().unwrap_or(0) as f64 / periods(report).max(1) as f64;
    let reasons: Vec<String> = [
        is_short(report).then(|| "it is short".to_owned()),
        (lost >= MANY_LOST).then(|| format!("{} % of the samples are missing", significant(100.0 * lost, 2))),
    ]
    .into_iter()
    .flatten()
    .chain(failures(report))
    .collect();
    match reasons.is_empty() {
        true => "This recording can be trusted.".to_owned(),
        false => format!("This recording can be trusted in part: {}.", reasons.join("; ")),
    }
}

/// The notes, without "no filter" if none could show or if some channels have one.
fn told_notes(report: &Report) -> Vec<PartNote> {
    let is_filter = |finding: &Finding| matches!(finding.effect, Effect::OutputFilter(_) | Effect::LowPassFilter(_));
    if inertial(report).next().is_none() {
        return Vec::new();
    }
    let is_sought = report.samples >= SAMPLES_FOR_FILTER && !report.findings.iter().any(is_filter);
    let is_told = |note: &&PartNote| is_sought || !matches!(note, PartNote::NotCorrelated { .. });
    report.part.notes.iter().filter(is_told).cloned().collect()
}

pub fn part_notes(report: &Report) -> Vec<String> {
    told_notes(report).iter().map(part_note::sentence).collect()
}

/// `None` without a gyro or accelerometer.
pub(crate) fn for_filter(report: &Report) -> Option<String> {
    inertial(report).next()?;
    let how = if is_short(report) { "record at rest for hours" } else { "add -o imu.yaml" };
    Some(format!("For a filter: {how}."))
}
