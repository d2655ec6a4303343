//! The summary of a report: trust, coefficients, contradictions, next steps.

use crate::coefficients::{KINDS, LETTERS, white_noise};
use crate::finding_text::{
    ALL_CHANNELS, FindingText, SENSED, channel_list, channel_name, departure, describe, excess_percent, largest,
    shown_effects,
};
use crate::formatting::{count, enumerated, words};
use crate::part_note;
use crate::rounding::{
    NONE, column_prefix, estimate, extremes, is_upper_bound, parameter_magnitude, plain, quantity, significant, span,
    unit,
};
use noise_analysis::distributions::quantile;
use noise_analysis::effects::{Effect, Unexplained};
use noise_analysis::nonstationarity::FittedPart;
use noise_analysis::report::assessment::Innovations;
use noise_analysis::report::{
    BiasOverTime, ChannelReport, Finding, ModelErrorReport, ModelReport, Parameter, PartNote, Report, Stretch,
};
use noise_analysis::report::{DataSheetReport, TermReport};
use noise_analysis::units::conversions;
use time_base::TimeRange;

/// Deviance per point on the unseen half above which a model is marked; a true model has about 1.
pub(crate) const HIGH_DEVIANCE: f64 = 3.0;
/// Largest part of records with true models that are told to be contradicted.
const CHANCE: f64 = 0.01;
/// Variance of a fit to another half, over an octave's own.
const FITTED_TO_HALF: f64 = 1.0;
/// Variance of a fit to the medians of a quarter: half the samples, a fourth more scatter.
const FITTED_TO_QUARTER: f64 = 2.0 * 1.25 * 1.25;
/// Least part at rest for "throughout".
const THROUGHOUT: f64 = 0.999;
/// Minimum of the Allan deviation over B: `sqrt(2 ln 2/π)`.
const MINIMUM_OVER_B: f64 = 0.664;

/// A group of inertial channels with their units.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CoefficientTable {
    /// `gyro` or `accel`.
    pub title: &'static str,
    pub names: [&'static str; 3],
    /// Units of N, B and K, prefixes included.
    pub units: [String; 3],
    /// One row a channel, then that of the data sheet, if it is known.
    pub rows: Vec<CoefficientTableRow>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CoefficientTableRow {
    /// The axis, or `sheet`.
    pub label: String,
    /// Name in the report; empty for the data sheet.
    pub channel: String,
    /// N, B and K of the model `final` with bounds; `–` if absent.
    pub coefficients: [String; 3],
    /// Error of σ on the unseen half, without and with effects.
    pub error: String,
    /// True if the error with effects is far above chance.
    pub is_high: bool,
}

/// Symbol, unit for `conversions`, factor to the symbol's.
type UnitOfColumn = (&'static str, &'static str, f64);

/// Title, prefix, names and units of N, B and K.
type Group = (&'static str, &'static str, [&'static str; 3], [UnitOfColumn; 3]);

const GROUPS: [Group; 2] = [
    (
        "gyro",
        "gyro_",
        ["angle random walk", "bias instability", "rate random walk"],
        [("°/√h", "deg/sqrt(h)", 1.0), ("°/h", "deg/h", 1.0), ("°/h/√h", "deg/h/sqrt(h)", 1.0)],
    ),
    (
        "accel",
        "accl_",
        ["velocity random walk", "bias instability", "accel. random walk"],
        [("g/√Hz", "ug/sqrt(Hz)", 1e-6), ("g", "ug", 1e-6), ("g/√h", "ug/sqrt(h)", 1e-6)],
    ),
];

/// N, B and K of a channel in its unit and seconds, with its errors.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelCoefficients {
    /// Such as `gyro_z`.
    pub name: String,
    pub unit: String,
    /// N, B and K; absent ones are `None`.
    pub coefficients: [Option<Parameter>; 3],
    /// [`ModelErrorReport::rms_percent`] on unseen data, without and with effects.
    pub rms_percent: [Option<f64>; 2],
    /// Deviance per point on unseen data, with effects.
    pub deviance: Option<f64>,
}

impl ChannelCoefficients {
    fn from_report(channel: &ChannelReport) -> Self {
        Self {
            name: channel.name.clone(),
            unit: channel.unit.clone(),
            coefficients: KINDS.map(|kind| coefficient(channel, kind)),
            rms_percent: models(channel).map(|model| model.unseen.rms_percent),
            deviance: channel.after.unseen.deviance_per_point,
        }
    }
}

/// Tables of gyros and accelerometers, if there are any.
#[must_use]
pub fn coefficient_tables(report: &Report) -> Vec<CoefficientTable> {
    let channels: Vec<ChannelCoefficients> = report.channels.iter().map(ChannelCoefficients::from_report).collect();
    let sheet = |prefix: &str| {
        let first = report.channels.iter().find(|channel| channel.name.starts_with(prefix))?;
        first.figure_data.data_sheet.as_ref().map(sheet_coefficients)
    };
    tables_of(&channels, report.sample_rate_hz, sheet)
}

/// N, B and K with units, without intervals, such as `N 2.424 °/√h`; a letter alone without a number.
pub(crate) fn coefficients_in_short(report: &Report, channel: &str) -> [String; 3] {
    let tables = coefficient_tables(report);
    let row = tables.iter().find_map(|table| Some((table, table.rows.iter().find(|row| row.channel == channel)?)));
    std::array::from_fn(|index| {
        let letter = LETTERS[index];
        let number = row.and_then(|(table, row)| {
            let number = row.coefficients[index].split(' ').next()?;
            number
                .starts_with(|first: char| first.is_ascii_digit())
                .then(|| format!("{letter} {number} {}", table.units[index]))
        });
        number.unwrap_or_else(|| letter.to_owned())
    })
}

/// Tables of channels at `sample_rate_hz`, without a data sheet.
#[must_use]
pub fn tables_of_channels(channels: &[ChannelCoefficients], sample_rate_hz: f64) -> Vec<CoefficientTable> {
    tables_of(channels, sample_rate_hz, |_| None)
}

/// `sheet` has the data sheet's N, B, K by prefix of names.
fn tables_of(
    all: &[ChannelCoefficients],
    sample_rate_hz: f64,
    sheet: impl Fn(&str) -> Option<[Option<f64>; 3]>,
) -> Vec<CoefficientTable> {
    let table = |(title, prefix, names, units): &Group| {
        let channels: Vec<&ChannelCoefficients> =
            all.iter().filter(|channel| channel.name.starts_with(prefix)).collect();
        let first = channels.first()?;
        // Prefix, and factor to the unit with it.
        let columns: [(&str, f64); 3] = std::array::from_fn(|index| {
            let known = conversions(KINDS[index], &first.unit, sample_rate_hz);
            let (_, name, symbols) = units[index];
            let factor = known.iter().find(|known| known.unit == name).map_or(1.0, |known| known.factor) * symbols;
            let shown = channels.iter().filter_map(|channel| channel.coefficients[index].as_ref());
            let (prefix, divisor) = column_prefix(shown.map(|n| factor * parameter_magnitude(n)));
            (prefix, factor / divisor)
        });
        let mut rows: Vec<CoefficientTableRow> = channels
            .iter()
            .map(|channel| CoefficientTableRow {
                label: channel.name.trim_start_matches(prefix).to_owned(),
                channel: channel.name.clone(),
                coefficients: std::array::from_fn(|index| {
                    let scale = columns[index].1;
                    let shown = |n: &Parameter| estimate(n.value * scale, n.low * scale, n.high * scale);
                    channel.coefficients[index].as_ref().map_or_else(|| NONE.to_owned(), shown)
                }),
                error: error_change(channel.rms_percent),
                is_high: channel.deviance.is_some_and(|of| of > HIGH_DEVIANCE),
            })
            .collect();
        rows.extend(sheet(prefix).map(|sheet| CoefficientTableRow {
            label: "sheet".to_owned(),
            channel: String::new(),
            coefficients: std::array::from_fn(|index| {
                let number = |value: f64| significant(value * columns[index].1, 2);
                match sheet[index] {
                    Some(value) if index == 1 => {
                        format!("{} = {}/{MINIMUM_OVER_B}", number(value), number(value * MINIMUM_OVER_B))
                    }
                    value => value.map_or_else(|| NONE.to_owned(), number),
                }
            }),
            error: String::new(),
            is_high: false,
        }));
        let units = std::array::from_fn(|index| format!("{}{}", columns[index].0, units[index].0));
        Some(CoefficientTable { title, names: *names, units, rows })
    };
    GROUPS.iter().filter_map(table).collect()
}

/// N, B and K of a data sheet in the channel's unit and seconds; B is the in-run bias stability over 0.664.
#[must_use]
pub fn sheet_coefficients(sheet: &DataSheetReport) -> [Option<f64>; 3] {
    [
        sheet.angle_random_walk,
        sheet.in_run_bias_stability.map(|minimum| minimum / MINIMUM_OVER_B),
        sheet.rate_random_walk,
    ]
}

/// A coefficient of the model to use; N of all white noise, also below the corner of a process that replaces it.
#[must_use]
pub fn coefficient(channel: &ChannelReport, kind: &str) -> Option<Parameter> {
    let mut terms = channel.refitted.terms.iter();
    if kind == KINDS[0] {
        return white_noise(terms.filter_map(TermReport::angle_random_walk));
    }
    terms.find(|term| term.kind() == kind).map(TermReport::coefficient)
}

/// The models of the first half without and with the findings: twice the same one for a channel without a finding, even if its first half alone
/// has shown an effect.
pub(crate) fn models(channel: &ChannelReport) -> [&ModelReport; 2] {
    [if channel.effects.is_empty() { &channel.after } else { &channel.before }, &channel.after]
}

/// Error of σ before and after; empty without unseen data.
fn error_change(rms_percent: [Option<f64>; 2]) -> String {
    let [before, after] = rms_percent.map(|of| of.map_or_else(|| NONE.to_owned(), off_percent));
    match (rms_percent, before == after) {
        ([None, None], _) => NONE.to_owned(),
        (_, true) => format!("{after} %"),
        _ => format!("{before} → {after} %"),
    }
}

const MOST_PERCENT: f64 = 1000.0;

/// Error of σ by the rms logarithm of its ratio: a factor of 2 is 100 %.
pub(crate) fn off_percent(rms_percent: f64) -> String {
    match 100.0 * (rms_percent / 100.0).exp_m1() {
        off if off > MOST_PERCENT => "> 1,000".to_owned(),
        off => significant(off, if off < 100.0 { 2 } else { 3 }),
    }
}

pub(crate) fn deviance_per_point(of: f64) -> String {
    match of {
        of if of < 9.95 => format!("{of:.1}"),
        of if of <= 1000.0 => count(of.round() as u64),
        _ => "> 1,000".to_owned(),
    }
}

/// The model with effects fails on the unseen half.
fn is_high(channel: &ChannelReport) -> bool {
    channel.after.unseen.deviance_per_point.is_some_and(|of| of > HIGH_DEVIANCE)
}

pub(crate) fn inertial(report: &Report) -> impl Iterator<Item = &ChannelReport> {
    report.channels.iter().filter(|channel| ["gyro_", "accl_"].iter().any(|prefix| channel.name.starts_with(prefix)))
}

/// Gyro, accelerometer or magnetometer.
pub(crate) fn is_sensed(channel: &ChannelReport) -> bool {
    SENSED.iter().any(|prefix| channel.name.starts_with(prefix))
}

/// Name of the part, or a description without a profile.
#[must_use]
pub fn part_name(report: &Report) -> &str {
    if ["", "generic"].contains(&report.part.name.as_str()) { "Inertial sensor" } else { &report.part.name }
}

/// Part, number of samples, length and rate.
#[must_use]
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

/// Cause of a sample read twice.
const REPEATED: &str = "repeated";
/// Cause of a sample without a value in one channel.
const MISSING: &str = "missing";

fn periods(report: &Report) -> u64 {
    let missing = report.dropped.iter().filter(|(cause, _)| *cause != REPEATED);
    missing.fold(report.samples, |sum, (_, &of)| sum.saturating_add(of))
}

fn report_length_s(report: &Report) -> f64 {
    let length = periods(report) as f64 / report.sample_rate_hz;
    if length.is_finite() { length } else { 0.0 }
}

const QUICK: &str = "Quick report, of the curves alone: spectra, spikes, steps, motion, temperature and other causes that channels \
                     have in common, and changes of the noise were not looked for.";

/// The sentence for no finding, with its channels.
#[must_use]
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
#[must_use]
pub fn record_sentences(report: &Report) -> Vec<String> {
    answer(report).into_iter().chain(record_in_detail(report)).collect()
}

/// Trust, rest and losses, error on the unseen half.
pub(crate) fn answer(report: &Report) -> Vec<String> {
    condition(report).into_iter().chain(unseen_half(report)).collect()
}

/// Trust, rest and losses.
fn condition(report: &Report) -> Vec<String> {
    let mut sentences = vec![trust(report), rest(report), losses(report)];
    sentences.extend(report.quick.then(|| QUICK.to_owned()));
    sentences.retain(|sentence| !sentence.is_empty());
    sentences
}

/// Use of the length, fitted part, errors without spikes and knocks.
pub(crate) fn record_in_detail(report: &Report) -> Vec<String> {
    let LengthAdvice { known, except, longer, limits } = length_advice(report);
    let length = known.into_iter().chain(except).chain(longer).chain(limits);
    length.chain(recent_fit(report)).chain(without_events(report)).collect()
}

/// Least part of missing samples that is told against a record.
const MANY_LOST: f64 = 0.01;

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

/// Error of the first half's models on the second; `None` without unseen data.
fn unseen_half(report: &Report) -> Option<String> {
    let range = |of: &dyn Fn(&ChannelReport) -> Option<f64>| {
        let each: Vec<f64> = inertial(report).filter_map(of).collect();
        let (low, high) = extremes(each.iter().copied());
        let [low, high] = [low, high].map(off_percent);
        let range = if low == high { high } else { format!("{low} to {high}") };
        (!each.is_empty()).then(|| format!("{range} %"))
    };
    let with = range(&|channel| channel.after.unseen.rms_percent)?;
    let halves = range(&|channel| channel.first_half_curve.rms_percent)
        .map_or_else(String::new, |halves| format!(" (the two halves differ by {halves})"));
    let is_changed = |channel: &ChannelReport| {
        let [without, with] = models(channel);
        without.unseen != with.unseen
    };
    let changed = inertial_names(report, is_changed);
    let without = range(&|channel| channel.before.unseen.rms_percent.filter(|_| is_changed(channel))).zip(changed);
    let without =
        without.map_or_else(String::new, |(range, names)| format!("; without what was found in {names}, by {range}"));
    Some(format!("On the second half, which the model had not seen, σ is off by {with}{halves}{without}."))
}

/// Samples for a correlation of 0.15 at five standard errors.
const SAMPLES_FOR_FILTER: u64 = 1000;

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

/// Unknown properties of the sensor's clock and filter, with reasons.
#[must_use]
pub fn part_notes(report: &Report) -> Vec<String> {
    told_notes(report).iter().map(part_note::sentence).collect()
}

/// Sentences for the screen: fewer notes, nothing of its table.
#[must_use]
pub fn record_sentences_in_short(report: &Report) -> Vec<String> {
    let LengthAdvice { known, longer, .. } = length_advice(report);
    let notes = part_note::in_short(&told_notes(report));
    let unseen = unseen_half(report);
    // The screen has little room, and its table has the errors: first what a short record is good for.
    let [first, second] = if is_short(report) { [known, unseen] } else { [unseen, known] };
    let sentences = condition(report).into_iter().chain(first).chain(second).chain(longer);
    sentences.chain(notes).chain(recent_fit(report)).collect()
}

struct Departure<'a> {
    of: &'a Unexplained,
    /// In words, without its size.
    place: String,
    is_above: Option<bool>,
    channels: Vec<String>,
    excesses: Vec<f64>,
}

impl Departure<'_> {
    fn largest(&self) -> f64 {
        self.excesses.iter().map(|of| of.abs()).fold(0.0, f64::max)
    }

    fn text(&self) -> String {
        format!("{}: {}", channel_list(&self.channels), departure(self.of, &self.excesses))
    }
}

/// Departures from every model; equal places of one sign are merged, and told once per channel.
fn departures(report: &Report) -> Vec<Departure<'_>> {
    let mut departures: Vec<Departure<'_>> = Vec::new();
    for (number, finding) in report.findings.iter().enumerate() {
        let Effect::Unexplained(of) = &finding.effect else { continue };
        let mut excesses = excess_percent(&shown_effects(report, number));
        if excesses.is_empty() {
            excesses.extend(of.excess_percent.map(|of| of.value));
        }
        let (place, is_above) = (departure(of, &[]), of.excess_percent.map(|of| of.value >= 0.0));
        let is_same = |of: &Departure<'_>| of.place == place && of.is_above == is_above;
        let is_told = |of: &Departure<'_>| finding.channels.iter().all(|name| of.channels.contains(name));
        if departures.iter().any(|of| is_same(of) && is_told(of)) {
            continue;
        }
        let is_of_others = |of: &Departure<'_>| finding.channels.iter().all(|name| !of.channels.contains(name));
        match departures.iter_mut().find(|of| is_same(of) && is_of_others(of)) {
            Some(known) => {
                known.channels.extend(finding.channels.iter().cloned());
                known.excesses.extend(excesses);
            }
            None => departures.push(Departure { of, place, is_above, channels: finding.channels.clone(), excesses }),
        }
    }
    departures
}

#[must_use]
pub fn unexplained(report: &Report) -> Vec<String> {
    departures(report).iter().map(Departure::text).collect()
}

/// Number and largest of the departures; `None` without any.
pub(crate) fn unexplained_in_short(report: &Report) -> Option<String> {
    let departures = departures(report);
    let largest = departures.iter().max_by(|a, b| a.largest().total_cmp(&b.largest()))?;
    Some(counted(departures.len(), &largest.text()))
}

/// Number of the contradictions and the largest of them; `None` without any.
pub(crate) fn contradictions_in_short(report: &Report) -> Option<String> {
    let (far, unsure) = (far_off(report), claiming_too_much(report));
    let largest = far.iter().max_by(|a, b| a.logarithm.total_cmp(&b.logarithm)).map(|far| far.place.clone());
    let filter = || {
        let of = if let [one] = &unsure[..] { channel_list([one]) } else { format!("{} channels", unsure.len()) };
        format!("a Kalman filter of {of} claims too small an error")
    };
    let text = largest.or_else(|| (!unsure.is_empty()).then(filter))?;
    Some(counted(far.len() + usize::from(!unsure.is_empty()), &text))
}

fn counted(all: usize, text: &str) -> String {
    if all == 1 { text.to_owned() } else { format!("{all} places; {text}") }
}

/// The longest stretch at rest: of the whole file if it was examined, else of the record.
#[must_use]
pub fn longest_at_rest(report: &Report) -> Option<Stretch> {
    let stretches = || inertial(report).flat_map(|channel| &channel.at_rest);
    let longest = || stretches().max_by(|a, b| (a.to_s - a.from_s).total_cmp(&(b.to_s - b.from_s))).copied();
    report.longest_at_rest.or_else(longest)
}

/// Options for a part of a recording, in tenths of a second inside of it.
#[must_use]
pub fn time_options(from_s: f64, to_s: f64) -> String {
    let TimeRange { from_s, to_s } = TimeRange { from_s, to_s }.whole_tenths();
    format!("--from {from_s} --to {to_s}")
}

/// Least over the channels, s; `None` without any.
fn least_at_rest(report: &Report) -> Option<f64> {
    let still = |channel: &ChannelReport| channel.at_rest.iter().map(|of| of.to_s - of.from_s).sum::<f64>();
    let least = inertial(report).filter(|channel| !channel.at_rest.is_empty()).map(still).fold(f64::INFINITY, f64::min);
    least.is_finite().then_some(least)
}

fn has_moved(report: &Report) -> bool {
    let is_motion = |of: &Finding| matches!(of.effect, Effect::MotionInterval(_));
    least_at_rest(report)
        .is_some_and(|least| report.findings.iter().any(is_motion) || least < THROUGHOUT * report_length_s(report))
}

/// Rest of the platform, not throughout with a knock or motion.
fn rest(report: &Report) -> String {
    let length = report_length_s(report);
    let Some(least) = least_at_rest(report) else { return String::new() };
    let is_knock = |of: &&Finding| matches!(of.effect, Effect::NoisyInterval(_));
    let knocks = report.findings.iter().filter(is_knock).count();
    if has_moved(report) {
        let longest = longest_at_rest(report).map_or_else(String::new, |of| {
            format!("; for the longest part at rest, add {}", time_options(of.from_s, of.to_s))
        });
        return format!("It moved for up to {}{longest}.", span((length - least).max(0.0)));
    }
    match knocks {
        0 => "At rest throughout.".to_owned(),
        1 => "At rest but for a knock.".to_owned(),
        knocks => format!("At rest but for {knocks} knocks."),
    }
}

fn losses(report: &Report) -> String {
    let lost = report.dropped.get("gap").copied().unwrap_or(0);
    let percent = significant(100.0 * lost as f64 / periods(report).max(1) as f64, 2);
    if lost > 0 && report.dropped.get(REPEATED) == Some(&lost) {
        // Values read twice account for the missing ones.
        return format!("{} samples ({percent} %) are missing: the one before was read again instead.", count(lost));
    }
    let refused: Vec<String> = report
        .dropped
        .iter()
        .filter(|(cause, samples)| cause.as_str() != "gap" && **samples > 0)
        .map(|(cause, samples)| format!("{} {}", count(*samples), words(cause)))
        .collect();
    let lost =
        if lost == 0 { "No sample lost".to_owned() } else { format!("{} samples lost ({percent} %)", count(lost)) };
    let lost = format!("{lost}{}", missing_values(report));
    if refused.is_empty() { format!("{lost}.") } else { format!("{lost}, refused: {}.", refused.join(", ")) }
}

/// Missing values of some channels, as a part of a sentence.
fn missing_values(report: &Report) -> String {
    let missing = |channel: &ChannelReport| channel.missing.refused.get(MISSING).copied().unwrap_or(0);
    let with_missing: Vec<&ChannelReport> = report.channels.iter().filter(|channel| missing(channel) > 0).collect();
    let Some(most) = with_missing.iter().map(|channel| missing(channel)).max() else { return String::new() };
    let up_to = if with_missing.iter().all(|channel| missing(channel) == most) { "" } else { "up to " };
    let names = channel_list(with_missing.iter().map(|channel| &channel.name));
    format!(", {up_to}{} values missing in {names}", count(most))
}

/// Largest relative half-width called ±20 %.
const KNOWN: f64 = 0.205;
/// Largest extrapolation, in record lengths.
const FARTHEST: f64 = 10.0;

enum Knowledge {
    /// Within ±20 %.
    Known,
    /// Wider; the additional recording time, s, may be infinite.
    Wide(f64),
    Bounded,
}

/// Larger side of the interval, relative.
fn relative_error(of: &Parameter) -> f64 {
    (of.high - of.value).max(of.value - of.low) / of.value
}

/// The knowledge of the coefficient `kind` in each channel.
fn knowledge(report: &Report, kind: &str) -> Vec<(String, Knowledge)> {
    let of = |channel: &ChannelReport| {
        let value = coefficient(channel, kind)?;
        let record = channel.assessment.record.iter().find(|record| record.kind == kind);
        let known = match record {
            _ if is_upper_bound(value.value, value.low) => Knowledge::Bounded,
            _ if relative_error(&value) <= KNOWN => Knowledge::Known,
            Some(record) => Knowledge::Wide(record.more_hours.map_or(f64::INFINITY, |hours| 3600.0 * hours)),
            None => Knowledge::Wide(0.0),
        };
        Some((channel.name.clone(), known))
    };
    inertial(report).filter(|channel| !channel.assessment.record.is_empty()).filter_map(of).collect()
}

/// Shortest record, s, that may lack B and K without a remark.
const SHORT_S: f64 = 600.0;

/// Too short: most channels have only limits for B and K.
fn is_short(report: &Report) -> bool {
    let shows = |channel: &ChannelReport| {
        KINDS[1..].iter().filter_map(|kind| coefficient(channel, kind)).any(|of| !is_upper_bound(of.value, of.low))
    };
    report_length_s(report) < SHORT_S && {
        let (showing, all) = (inertial(report).filter(|channel| shows(channel)).count(), inertial(report).count());
        all > 0 && 2 * showing < all
    }
}

fn use_of_short_record(report: &Report) -> String {
    let length = span(report_length_s(report));
    let is_known = |(_, n): &(String, Parameter)| !is_upper_bound(n.value, n.low) && relative_error(n).is_finite();
    let all = inertial(report).filter_map(|channel| Some((channel.name.clone(), coefficient(channel, KINDS[0])?)));
    let (known, bounded): (Vec<_>, Vec<_>) = all.partition(is_known);
    if known.is_empty() {
        return format!("{length}: too short for N, B, K and a filter.");
    }
    let percent = 100.0 * known.iter().map(|(_, n)| relative_error(n)).fold(0.0, f64::max);
    let names: Vec<String> = bounded.into_iter().map(|(name, _)| name).collect();
    let except = if names.is_empty() { String::new() } else { format!(" except in {}", channel_list(&names)) };
    let rough = if percent < 5.0 { "" } else { "a rough " };
    format!(
        "{length}: good for {rough}N (±{} %){except} and for strong lines; not for B, K or a filter.",
        significant(percent, 1)
    )
}

/// Coefficients within ±20 %, recording time for others, and limits.
#[derive(Default)]
struct LengthAdvice {
    known: Option<String>,
    except: Vec<String>,
    longer: Option<String>,
    limits: Option<String>,
}

/// Empty without an inertial channel.
fn length_advice(report: &Report) -> LengthAdvice {
    if is_short(report) {
        return LengthAdvice { known: Some(use_of_short_record(report)), ..LengthAdvice::default() };
    }
    let (mut known, mut except, mut longer, mut much_longer) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut bounded, mut in_some) = (Vec::new(), Vec::new());
    for (kind, letter) in KINDS.into_iter().zip(LETTERS) {
        let all = knowledge(report, kind);
        let named = |is_one: &dyn Fn(&Knowledge) -> bool| -> Vec<String> {
            all.iter().filter(|(_, of)| is_one(of)).map(|(name, _)| name.clone()).collect()
        };
        let unknown = named(&|of| !matches!(of, Knowledge::Known));
        let limited = named(&|of| matches!(of, Knowledge::Bounded));
        let seconds = |(_, of): &(String, Knowledge)| if let Knowledge::Wide(seconds) = of { *seconds } else { 0.0 };
        let most = all.iter().map(seconds).fold(0.0, f64::max);
        match unknown.len() {
            _ if all.is_empty() => continue,
            0 => known.push(letter.to_owned()),
            some if some == limited.len() && some == all.len() => bounded.push(letter.to_owned()),
            some if 2 * some <= all.len() => {
                except.push(format!("{letter} is known to ±20 % except in {}.", channel_list(&unknown)));
            }
            _ if !limited.is_empty() => in_some.push(format!("for {letter} in {}", channel_list(&limited))),
            _ => {}
        }
        if most > FARTHEST * report_length_s(report) {
            much_longer.push(letter.to_owned());
        } else if most > 0.0 {
            longer.push(format!("{letter} needs {} more", hours(most / 3600.0)));
        }
    }
    let verb =
        |letters: &[String], one: &'static str, several: &'static str| if letters.len() == 1 { one } else { several };
    if !much_longer.is_empty() {
        let need = verb(&much_longer, "needs", "need");
        longer.push(format!("{} {need} a much longer record", enumerated(&much_longer)));
    }
    if !bounded.is_empty() {
        in_some.insert(0, format!("for {}", enumerated(&bounded)));
    }
    let known =
        (!known.is_empty()).then(|| format!("{} {} known to ±20 %.", enumerated(&known), verb(&known, "is", "are")));
    let longer = (!longer.is_empty()).then(|| format!("For ±20 %, {}.", enumerated(&longer)));
    let limits =
        (!in_some.is_empty()).then(|| format!("The record gives only an upper limit {}.", enumerated(&in_some)));
    LengthAdvice { known, except, longer, limits }
}

/// The inertial channels that are so, in few words; `None` without any.
fn inertial_names(report: &Report, is_so: impl Fn(&ChannelReport) -> bool) -> Option<String> {
    let names: Vec<&String> = inertial(report).filter(|channel| is_so(channel)).map(|channel| &channel.name).collect();
    (!names.is_empty()).then(|| channel_list(names))
}

/// Channels fitted to the later quarter; `None` without any.
fn recent_fit(report: &Report) -> Option<String> {
    let recent = inertial_names(report, is_fitted_to_later_quarter)?;
    Some(format!(
        "Because the noise changed, the model of {recent} was fitted to the last quarter before the second half alone."
    ))
}

/// `None` without spikes and knocks.
fn without_events(report: &Report) -> Option<String> {
    let excluding = inertial(report).filter_map(|channel| {
        let [before, after] = models(channel).map(|model| model.unseen_excluding.as_ref());
        let change = error_change([before?, after?].map(|error| error.rms_percent));
        Some(format!("{} {change}", channel_name(channel)))
    });
    let excluding: Vec<String> = excluding.collect();
    (!excluding.is_empty()).then(|| format!("Without spikes and knocks σ is off by: {}.", excluding.join(", ")))
}

/// Fitted to the later quarter of the first half.
#[must_use]
pub fn is_fitted_to_later_quarter(channel: &ChannelReport) -> bool {
    channel.nonstationarity.as_ref().is_some_and(|of| of.fitted_to == FittedPart::LaterQuarter)
}

fn hours(hours: f64) -> String {
    match hours {
        hours if hours < 1.0 => span(3600.0 * hours),
        hours if hours < 10.0 => format!("{} h", significant(hours, 2)),
        hours if hours < 72.0 => format!("{hours:.0} h"),
        hours => format!("{:.0} days", hours / 24.0),
    }
}

/// Magnetometers, temperature, supply: one text each.
#[must_use]
pub fn conditions(report: &Report) -> Vec<String> {
    let moved = |name: &str, label: &str| {
        let channel = report.channels.iter().find(|channel| channel.name == name)?;
        let bias = channel.figure_data.bias_over_time.as_ref()?;
        let (low, high) = extremes(bias.mean.iter().copied());
        let range = high - low;
        Some(if is_constant(channel) || range == 0.0 {
            format!("{label} did not change")
        } else if range < range_of_white_noise(channel, bias) {
            format!("{label} constant within its noise")
        } else {
            format!("{label} moved by {}", quantity(range, &channel.unit))
        })
    };
    [moved("temp", "temperature"), moved("supply", "supply")]
        .into_iter()
        .flatten()
        .chain(magnetometers(report))
        .collect()
}

/// All samples equal, up to rounding of block means.
fn is_constant(channel: &ChannelReport) -> bool {
    !channel.curve.is_empty() && channel.curve.iter().all(|point| point.adev == 0.0)
}

/// Range of block means that white noise exceeds in fewer than [`CHANCE`] of all records; 0 without N.
fn range_of_white_noise(channel: &ChannelReport, bias: &BiasOverTime) -> f64 {
    let deviation = coefficient(channel, KINDS[0]).map_or(0.0, |n| n.high / bias.block_s.sqrt());
    // Highest and lowest mean, half each.
    2.0 * quantile(CHANCE / 2.0 / bias.mean.len().max(1) as f64) * deviation
}

/// N of magnetometers; a failing model's bound is left out.
fn magnetometers(report: &Report) -> Vec<String> {
    let all = report.channels.iter().filter(|channel| channel.name.starts_with("magn_"));
    let (failed, described): (Vec<&ChannelReport>, Vec<&ChannelReport>) = all.partition(|channel| is_high(channel));
    let label = |channels: &[&ChannelReport]| match channels.len() {
        3 => "magnetometers".to_owned(),
        _ => channel_list(channels.iter().map(|channel| &channel.name)),
    };
    let noise: Vec<Parameter> = described.iter().filter_map(|of| coefficient(of, KINDS[0])).collect();
    let mut told = Vec::new();
    if let Some(first) = noise.first() {
        let (prefix, factor) = column_prefix(noise.iter().map(parameter_magnitude));
        let each: Vec<String> =
            noise.iter().map(|n| estimate(n.value / factor, n.low / factor, n.high / factor)).collect();
        told.push(format!("{}: N {} {prefix}{}", label(&described), each.join(", "), unit(&first.unit)));
    }
    if !failed.is_empty() {
        told.push(format!("{}: no noise model holds", label(&failed)));
    }
    told
}

/// Order of the findings: motion, causes in inertial channels, in conditions, unexplained; then by what they cost: their share of the variance
/// of an angle or a velocity after a minute, and then the largest share at any time.
pub(crate) fn finding_order(report: &Report) -> Vec<usize> {
    let is_inertial = |name: &String| name.starts_with("gyro_") || name.starts_with("accl_");
    let rank = |&index: &usize| {
        let Finding { effect, channels, .. } = &report.findings[index];
        match effect {
            Effect::MotionInterval(_) => 0,
            Effect::Unexplained(_) => 3,
            _ => 1 + u8::from(!channels.iter().any(is_inertial)),
        }
    };
    let shares = |index: &usize| {
        let Finding { share_percent, minute_percent, .. } = &report.findings[*index];
        [minute_percent, share_percent].map(largest)
    };
    let by_cost = |a: &usize, b: &usize| {
        let ([a_minute, a_largest], [b_minute, b_largest]) = (shares(a), shares(b));
        b_minute.total_cmp(&a_minute).then(b_largest.total_cmp(&a_largest))
    };
    let mut order: Vec<usize> = (0..report.findings.len()).collect();
    order.sort_by(|a, b| rank(a).cmp(&rank(b)).then_with(|| by_cost(a, b)));
    order
}

fn named_findings(report: &Report) -> Vec<usize> {
    let is_named = |&index: &usize| !matches!(report.findings[index].effect, Effect::Unexplained(_));
    finding_order(report).into_iter().filter(is_named).collect()
}

pub(crate) fn finding_text(report: &Report, index: usize) -> FindingText {
    let finding = &report.findings[index];
    let mut text = describe(finding, &shown_effects(report, index));
    if let Some(related) = related_line(report, finding) {
        text.weight = [text.weight, related].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ");
    }
    text
}

/// Findings in words in their order, and the unexplained ones.
#[must_use]
pub fn findings(report: &Report) -> (Vec<FindingText>, Vec<FindingText>) {
    let named = named_findings(report).len();
    let mut texts: Vec<FindingText> =
        finding_order(report).into_iter().map(|index| finding_text(report, index)).collect();
    let unexplained = texts.split_off(named);
    (texts, unexplained)
}

/// Largest relative difference of a finding's and a followed line's frequency: half the step of the ratios.
const SAME_LINE: f64 = 0.1;

/// A line of another channel that moves with the finding's.
fn related_line(report: &Report, finding: &Finding) -> Option<String> {
    let frequency = finding.effect.frequency_hz()?.value;
    let of = finding.channels.iter().find_map(|name| {
        let channel = report.channels.iter().find(|channel| channel.name == *name)?;
        let related = channel.nonstationarity.as_ref()?.related_line.as_ref()?;
        let followed = related.line_hz.iter().sum::<f64>() / related.line_hz.len().max(1) as f64;
        ((frequency / followed - 1.0).abs() < SAME_LINE).then_some(related)
    })?;
    let other = channel_list([&of.channel]);
    let at = match of.ratio {
        (1, 1) => "at the same frequency".to_owned(),
        (above, below) => format!("at {above}/{below} of the frequency"),
    };
    Some(format!("a line of {other} moves with it, {at}"))
}

/// A point of the unseen half farther from the model than chance explains.
struct FarOff {
    sigma: f64,
    /// Absolute logarithm of measured over modelled σ.
    logarithm: f64,
    /// Channel, averaging time and departure in words.
    place: String,
}

/// One of each channel, the least probable first.
fn far_off(report: &Report) -> Vec<FarOff> {
    let channels = inertial(report).count() as f64;
    let is_far_off = |channel: &ChannelReport, sigma: f64| {
        let fitted = if is_fitted_to_later_quarter(channel) { FITTED_TO_QUARTER } else { FITTED_TO_HALF };
        let octaves = channel.curve.len() as f64;
        sigma > (1.0 + fitted).sqrt() * quantile(CHANCE / 2.0 / (channels * octaves).max(1.0))
    };
    let far = |channel: &ChannelReport| {
        let ModelErrorReport { worst_sigma, worst_tau_s, worst_ratio, .. } = channel.after.unseen;
        let sigma = worst_sigma.map(f64::abs).filter(|&sigma| is_far_off(channel, sigma))?;
        let (tau, times) = (span(worst_tau_s?), 1.0 / worst_ratio?);
        let change = 100.0 * (times - 1.0);
        let size = if change.abs() < 100.0 {
            format!("{} % {}", significant(change.abs(), 2), if change < 0.0 { "below" } else { "above" })
        } else {
            format!("{} times", significant(times, 2))
        };
        let place = format!("{} at τ = {tau}: σ is {size} the model", channel_name(channel));
        Some(FarOff { sigma, logarithm: times.ln().abs(), place })
    };
    let mut far: Vec<FarOff> = inertial(report).filter_map(far).collect();
    far.sort_by(|a, b| b.sigma.total_cmp(&a.sigma));
    far
}

/// Channels in which a Kalman filter with the model is surer of itself than chance explains.
fn claiming_too_much(report: &Report) -> Vec<&String> {
    let channels = inertial(report).count() as f64;
    let is_unsure = |of: &Innovations| channels * of.chance_of_small_claim() < CHANCE;
    let unsure = inertial(report).filter(|channel| channel.assessment.innovations.as_ref().is_some_and(is_unsure));
    unsure.map(|channel| &channel.name).collect()
}

/// One text each, the least probable first.
#[must_use]
pub fn contradictions(report: &Report) -> Vec<String> {
    let standard_errors = |far: &FarOff| format!("{} ({} standard errors)", far.place, significant(far.sigma, 2));
    let unsure = claiming_too_much(report);
    let filter = (!unsure.is_empty()).then(|| {
        format!("a Kalman filter with the models of {} claims a smaller error than it has", channel_list(unsure))
    });
    far_off(report).iter().map(standard_errors).chain(filter).collect()
}

/// Advice in the order of the findings, with their numbers; rest comes first.
pub(crate) fn advice(report: &Report) -> Vec<(String, Vec<usize>)> {
    let is_motion = |index: usize| matches!(report.findings[index].effect, Effect::MotionInterval(_));
    let at_rest = longest_at_rest(report);
    let mut steps: Vec<(String, Vec<usize>)> = Vec::new();
    for (position, index) in named_findings(report).into_iter().enumerate() {
        let step = match at_rest.filter(|_| is_motion(index)) {
            Some(Stretch { from_s, to_s }) => {
                Some(format!("Analyse the part at rest alone: add {}.", time_options(from_s, to_s)))
            }
            None => finding_text(report, index).step,
        };
        let Some(step) = step else { continue };
        match steps.iter_mut().find(|(known, _)| *known == step) {
            Some((_, numbers)) => numbers.push(position + 1),
            None => steps.push((step, vec![position + 1])),
        }
    }
    steps.truncate(MOST_STEPS);
    steps
}

/// Most pieces of advice by findings.
const MOST_STEPS: usize = 3;

/// Advice with the numbers of its findings: `Look for a fan, a motor or the mains (2, 5).`
#[must_use]
pub fn numbered_steps(report: &Report) -> Vec<String> {
    let numbered = |(step, numbers): (String, Vec<usize>)| {
        let numbers: Vec<String> = numbers.iter().map(usize::to_string).collect();
        format!("{} ({}).", step.trim_end_matches('.'), numbers.join(", "))
    };
    advice(report).into_iter().map(numbered).collect()
}

/// `None` without a gyro or accelerometer.
pub(crate) fn for_filter(report: &Report) -> Option<String> {
    inertial(report).next()?;
    let how = if is_short(report) { "record at rest for hours" } else { "add -o imu.yaml" };
    Some(format!("For a filter: {how}."))
}

/// Reasons why models fail on the unseen half: spikes and knocks, a change of the noise, or a lack of the model.
fn failures(report: &Report) -> Vec<String> {
    #[derive(PartialEq)]
    enum Reason {
        Events,
        Change,
        Lack,
        Unknown,
    }
    let excluding = |channel: &ChannelReport| channel.after.unseen_excluding.as_ref()?.deviance_per_point;
    let reason = |channel: &ChannelReport| match channel.first_half_curve.deviance_per_point {
        _ if excluding(channel).is_some_and(|of| of <= HIGH_DEVIANCE) => Reason::Events,
        Some(of) if of > HIGH_DEVIANCE => Reason::Change,
        Some(_) => Reason::Lack,
        None => Reason::Unknown,
    };
    [
        (Reason::Events, "spikes or knocks came oftener or larger than before in"),
        (Reason::Change, "the noise changed in"),
        (Reason::Lack, "the model lacks something in"),
        (Reason::Unknown, "the model fails in"),
    ]
    .into_iter()
    .filter_map(|(of, text)| {
        Some(format!("{text} {}", inertial_names(report, |channel| is_high(channel) && reason(channel) == of)?))
    })
    .collect()
}
