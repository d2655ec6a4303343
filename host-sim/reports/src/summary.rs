//! What a report says in short, for the terminal's screen, the page's first screen and the live view: the record in sentences,
//! the coefficients in the units of their users, what the data contradicts, and what to do next.

use crate::coefficients;
use crate::finding_text::{FindingText, channel_list, describe, signed_percent, unexplained_place};
use crate::formatting::{count, enumerated, words};
use crate::part_note;
use crate::rounding::{column_prefix, estimate, plain, quantity, significant, span, unit};
use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::distributions::quantile;
use noise_analysis::effects::Effect;
use noise_analysis::nonstationarity::FittedPart;
use noise_analysis::report::DataSheetReport;
use noise_analysis::report::assessment::Innovations;
use noise_analysis::report::{ChannelReport, ModelErrorReport, Parameter, Report};
use noise_analysis::units::conversions;

/// Deviance a point on the unseen half above which a model is marked: a true model scores about 1, and what changes from one
/// half to the other leaves up to 3.
const HIGH_DEVIANCE: f64 = 3.0;
/// Most records with true models of which the same sentence says that the data contradicts the model of some channel.
const CHANCE: f64 = 0.01;
/// Variance of what the fit to another half does not know of an octave, over that of the octave in the unseen half: it has as many
/// samples.
const FITTED_TO_HALF: f64 = 1.0;
/// The same of the fit to the medians of the later quarter: half as many samples, and the median scatters by a fourth more than the mean.
const FITTED_TO_QUARTER: f64 = 2.0 * 1.25 * 1.25;
/// Part of the record that has to be at rest for "throughout".
const THROUGHOUT: f64 = 0.999;
/// Minimum of the Allan deviation over B: `sqrt(2 ln 2/π)`.
const MINIMUM_OVER_B: f64 = 0.664;

/// Kind, letter and full name of the coefficients of the baseline model.
const LETTERS: [(&str, &str); 3] = [("angle_random_walk", "N"), ("bias_instability", "B"), ("rate_random_walk", "K")];

/// A group of inertial channels with their units.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CoefficientTable {
    /// `gyro` or `accel`.
    pub title: &'static str,
    /// Units of N, B and K, prefixes included.
    pub units: [String; 3],
    /// One row a channel, then that of the data sheet, if it is known.
    pub rows: Vec<CoefficientTableRow>,
}

/// One channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CoefficientTableRow {
    /// The axis, or `sheet`.
    pub label: String,
    /// Name of the channel in the report; empty for the data sheet.
    pub channel: String,
    /// N, B and K of the model `final`, with their bounds; `–` where the model lacks them.
    pub coefficients: [String; 3],
    /// Deviance a point on the unseen half before and after.
    pub error: String,
    /// Whether that of the model with its effects is far above what chance makes.
    pub is_high: bool,
}

/// Symbol of a unit, the unit that `conversions` knows, and the factor from that to the symbol's.
type UnitOfColumn = (&'static str, &'static str, f64);

/// Groups of inertial channels: title, prefix of their names, and the units of N, B and K.
const GROUPS: [(&str, &str, [UnitOfColumn; 3]); 2] = [
    ("gyro", "gyro_", [("°/√h", "deg/sqrt(h)", 1.0), ("°/h", "deg/h", 1.0), ("°/h/√h", "deg/h/sqrt(h)", 1.0)]),
    ("accel", "accl_", [("g/√Hz", "ug/sqrt(Hz)", 1e-6), ("g", "ug", 1e-6), ("g/√h", "ug/sqrt(h)", 1e-6)]),
];

/// N, B and K of a channel in its unit and seconds, and what is said of its model.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelCoefficients {
    /// Name of the channel, such as `gyro_z`.
    pub name: String,
    /// Its unit, such as `deg/s`.
    pub unit: String,
    /// N, B and K, as far as the model has them.
    pub coefficients: [Option<Parameter>; 3],
    /// Deviance a point on unseen data of the model without and with its effects.
    pub deviance: [Option<f64>; 2],
}

impl ChannelCoefficients {
    fn from_report(channel: &ChannelReport) -> Self {
        Self {
            name: channel.name.clone(),
            unit: channel.unit.clone(),
            coefficients: LETTERS.map(|(kind, _)| coefficient(channel, kind)),
            deviance: unseen_errors(channel),
        }
    }
}

/// The tables of the gyros and of the accelerometers, without those of which there is no channel.
#[must_use]
pub fn coefficient_tables(report: &Report) -> Vec<CoefficientTable> {
    let channels: Vec<ChannelCoefficients> = report.channels.iter().map(ChannelCoefficients::from_report).collect();
    let sheet = |prefix: &str| {
        let first = report.channels.iter().find(|channel| channel.name.starts_with(prefix))?;
        first.figure_data.data_sheet.as_ref().map(sheet_coefficients)
    };
    tables_of(&channels, report.sample_rate_hz, sheet)
}

/// The same tables of channels sampled at `sample_rate_hz`, without a row for the data sheet.
#[must_use]
pub fn tables_of_channels(channels: &[ChannelCoefficients], sample_rate_hz: f64) -> Vec<CoefficientTable> {
    tables_of(channels, sample_rate_hz, |_| None)
}

/// `sheet` has N, B and K of the data sheet for the channels whose names begin so.
fn tables_of(
    all: &[ChannelCoefficients],
    sample_rate_hz: f64,
    sheet: impl Fn(&str) -> Option<[Option<f64>; 3]>,
) -> Vec<CoefficientTable> {
    let table = |(title, prefix, units): &(&'static str, &str, [UnitOfColumn; 3])| {
        let channels: Vec<&ChannelCoefficients> =
            all.iter().filter(|channel| channel.name.starts_with(prefix)).collect();
        let first = channels.first()?;
        let factor = |index: usize| {
            let known = conversions(LETTERS[index].0, &first.unit, sample_rate_hz);
            known.iter().find(|known| known.unit == units[index].1).map_or(1.0, |known| known.factor) * units[index].2
        };
        let factors: [f64; 3] = std::array::from_fn(factor);
        let prefixes: [(&str, f64); 3] = std::array::from_fn(|index| {
            let shown = channels.iter().filter_map(|channel| channel.coefficients[index].as_ref());
            column_prefix(shown.map(|n| factors[index] * if n.value > 0.0 { n.value } else { n.high }))
        });
        let scale = |index: usize| factors[index] / prefixes[index].1;
        let mut rows: Vec<CoefficientTableRow> = channels
            .iter()
            .map(|channel| CoefficientTableRow {
                label: channel.name.trim_start_matches(prefix).to_owned(),
                channel: channel.name.clone(),
                coefficients: std::array::from_fn(|index| {
                    channel.coefficients[index].as_ref().map_or_else(
                        || "–".to_owned(),
                        |n| estimate(n.value * scale(index), n.low * scale(index), n.high * scale(index)),
                    )
                }),
                error: error_change(channel.deviance),
                is_high: channel.deviance[1].is_some_and(|of| of > HIGH_DEVIANCE),
            })
            .collect();
        rows.extend(sheet(prefix).map(|sheet| CoefficientTableRow {
            label: "sheet".to_owned(),
            channel: String::new(),
            coefficients: std::array::from_fn(|index| {
                sheet[index].map_or_else(|| "–".to_owned(), |value| significant(value * scale(index), 2))
            }),
            error: String::new(),
            is_high: false,
        }));
        let units = std::array::from_fn(|index| format!("{}{}", prefixes[index].0, units[index].0));
        Some(CoefficientTable { title, units, rows })
    };
    GROUPS.iter().filter_map(table).collect()
}

/// N, B and K of a data sheet in the channel's unit and seconds. The in-run bias stability is the minimum of the curve, B is that over
/// 0.664.
#[must_use]
pub fn sheet_coefficients(sheet: &DataSheetReport) -> [Option<f64>; 3] {
    [
        sheet.angle_random_walk,
        sheet.in_run_bias_stability.map(|minimum| minimum / MINIMUM_OVER_B),
        sheet.rate_random_walk,
    ]
}

/// A coefficient of the model to use. N is that of all white noise, behind the part's filter and after it.
#[must_use]
pub fn coefficient(channel: &ChannelReport, kind: &str) -> Option<Parameter> {
    let terms = channel.refitted.terms.iter().map(|term| {
        let Parameter { value, low, high, unit } = term.coefficient();
        (term.kind(), BoundedEstimate { value, low, high }, unit)
    });
    let (BoundedEstimate { value, low, high }, unit) = coefficients::coefficient(kind, terms)?;
    Some(Parameter::new(value, low, high, unit))
}

/// Deviance a point of the models `before` and `after` on the unseen half as recorded, as the table has them.
pub(crate) fn unseen_errors(channel: &ChannelReport) -> [Option<f64>; 2] {
    [&channel.before, &channel.after].map(|model| model.unseen.deviance_per_point)
}

/// Deviance a point before and after; nothing where no model has met unseen data yet.
fn error_change(deviance: [Option<f64>; 2]) -> String {
    if deviance == [None, None] {
        return "–".to_owned();
    }
    let [before, after] = deviance.map(|of| of.map_or_else(|| "–".to_owned(), deviance_per_point));
    format!("{before} → {after}")
}

/// A deviance a point with the digits that every place of the report gives it.
pub(crate) fn deviance_per_point(of: f64) -> String {
    if of < 9.95 { format!("{of:.1}") } else { count(of.round() as u64) }
}

/// Whether the model with its effects fails on the unseen half.
fn is_high(channel: &ChannelReport) -> bool {
    channel.after.unseen.deviance_per_point.is_some_and(|of| of > HIGH_DEVIANCE)
}

/// Gyros and accelerometers.
pub(crate) fn inertial(report: &Report) -> impl Iterator<Item = &ChannelReport> {
    report.channels.iter().filter(|channel| ["gyro_", "accl_"].iter().any(|prefix| channel.name.starts_with(prefix)))
}

/// Part, number of samples, length and rate.
#[must_use]
pub fn headline(report: &Report, source: Option<&str>) -> Vec<String> {
    let part = if report.part.name.is_empty() { "Inertial sensor" } else { &report.part.name };
    let length = span(report_length_s(report));
    let rate = plain(report.sample_rate_hz, 4);
    let samples = format!("{} samples", count(report.samples));
    let record = format!("{length} at {rate} Hz");
    [Some(part), source, Some(samples.as_str()), Some(record.as_str())]
        .into_iter()
        .flatten()
        .map(str::to_owned)
        .collect()
}

/// Length of the record with its gaps, s.
fn report_length_s(report: &Report) -> f64 {
    let lost = report.dropped.values().fold(0, |sum: u64, &of| sum.saturating_add(of));
    let length = report.samples.saturating_add(lost) as f64 / report.sample_rate_hz;
    if length.is_finite() { length } else { 0.0 }
}

/// What a report of the curves alone does not look for.
const QUICK: &str = "Quick report, of the curves alone: spectra, spikes, steps, motion, temperature and other causes that channels \
                     have in common, and changes of the noise were not looked for.";

/// What is said where nothing was found.
#[must_use]
pub fn nothing_found(report: &Report) -> &'static str {
    if report.quick {
        "Nothing in the curves: N, B and K describe those of every channel."
    } else {
        "Nothing: N, B and K describe every channel."
    }
}

/// The record in sentences: rest, losses, length.
#[must_use]
pub fn record_sentences(report: &Report) -> Vec<String> {
    let mut sentences = vec![rest(report), losses(report)];
    sentences.extend(report.quick.then(|| QUICK.to_owned()));
    sentences.extend(length_advice(report));
    sentences.extend(recent_fit(report));
    sentences.extend(without_events(report));
    sentences.retain(|sentence| !sentence.is_empty());
    sentences
}

/// What the record does not tell of the part's clock and filter, and why.
#[must_use]
pub fn part_notes(report: &Report) -> Vec<String> {
    report.part.notes.iter().map(part_note::sentence).collect()
}

/// The record in sentences, with those of the part's notes that a short report has.
#[must_use]
pub fn record_sentences_in_short(report: &Report) -> Vec<String> {
    let mut sentences = record_sentences(report);
    sentences.extend(part_note::in_short(&report.part.notes));
    sentences
}

/// Where and by how much the data departs from every model, in one text; `None` where it does not. Channels that depart at the same
/// place, to the same side, are told together.
#[must_use]
pub fn unexplained(report: &Report) -> Option<String> {
    struct Departure {
        place: String,
        channels: Vec<String>,
        excesses: Vec<f64>,
    }
    let mut departures: Vec<Departure> = Vec::new();
    // Each channel has its own excess at the place of the finding.
    let in_channels = |number: usize| {
        let effects = report.channels.iter().flat_map(|channel| &channel.effects);
        let shown = effects.filter(move |shown| shown.finding == number);
        shown.filter_map(|shown| match &shown.effect {
            Effect::Unexplained(of) => Some(of.excess_percent?.value),
            _ => None,
        })
    };
    for (number, finding) in report.findings.iter().enumerate() {
        let Effect::Unexplained(of) = &finding.effect else { continue };
        let (place, excess) = (unexplained_place(of), of.excess_percent.map(|of| of.value));
        let excesses = in_channels(number).chain(excess);
        let is_same_side = |of: &Departure| match (of.excesses.first(), excess) {
            (Some(first), Some(excess)) => first.signum() == excess.signum(),
            (first, excess) => first.is_none() && excess.is_none(),
        };
        let of_other_channels = |of: &Departure| finding.channels.iter().all(|name| !of.channels.contains(name));
        let known = departures.iter_mut().find(|of| of.place == place && is_same_side(of) && of_other_channels(of));
        match known {
            Some(departure) => {
                departure.channels.extend(finding.channels.iter().cloned());
                departure.excesses.extend(excesses);
            }
            None => {
                departures.push(Departure { place, channels: finding.channels.clone(), excesses: excesses.collect() })
            }
        }
    }
    let mut text = String::new();
    let mut before = None;
    for Departure { place, channels, excesses } in &departures {
        let told = match excesses.as_slice() {
            [] => format!("what is measured {place}"),
            excesses => format!("{} {place}", signed_percent(excesses)),
        };
        if before == Some(channels) {
            text += &format!(", {told}");
        } else {
            let separator = if text.is_empty() { "" } else { "; " };
            text += &format!("{separator}{}: {told}", channel_list(channels));
        }
        before = Some(channels);
    }
    (!text.is_empty()).then_some(text)
}

fn rest(report: &Report) -> String {
    let length = report_length_s(report);
    let still = |channel: &ChannelReport| channel.at_rest.iter().map(|of| of.to_s - of.from_s).sum::<f64>();
    let least = inertial(report).filter(|channel| !channel.at_rest.is_empty()).map(still).fold(f64::INFINITY, f64::min);
    match least {
        _ if !least.is_finite() => String::new(),
        least if least >= THROUGHOUT * length => "At rest throughout.".to_owned(),
        least => {
            let stretches = inertial(report).flat_map(|channel| &channel.at_rest);
            let longest = stretches.max_by(|a, b| (a.to_s - a.from_s).total_cmp(&(b.to_s - b.from_s)));
            let longest = longest.map_or_else(String::new, |of| {
                // In whole seconds, none of which is moved.
                let (from, to) = (of.from_s.ceil(), of.to_s.floor());
                format!(", the longest time from {from} s to {to} s: --from {from} --to {to}")
            });
            format!("It moved: at rest for {} of {}{longest}.", span(least), span(length))
        }
    }
}

fn losses(report: &Report) -> String {
    let lost = report.dropped.get("gap").copied().unwrap_or(0);
    let refused: Vec<String> = report
        .dropped
        .iter()
        .filter(|(cause, samples)| cause.as_str() != "gap" && **samples > 0)
        .map(|(cause, samples)| format!("{} {}", count(*samples), words(cause)))
        .collect();
    let all = report.samples.saturating_add(report.dropped.values().sum());
    let lost = match lost {
        0 => "No sample lost".to_owned(),
        lost => {
            format!("{} samples lost ({} %)", count(lost), significant(100.0 * lost as f64 / all.max(1) as f64, 2))
        }
    };
    if refused.is_empty() { format!("{lost}.") } else { format!("{lost}, refused: {}.", refused.join(", ")) }
}

/// Which coefficients the record gives to ±20 %, how much longer it should be for the others, and which do not show. Nothing without
/// an inertial channel that says it.
fn length_advice(report: &Report) -> Vec<String> {
    let (mut known, mut longer, mut nowhere, mut somewhere) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (kind, letter) in LETTERS {
        let said: Vec<(&str, Option<f64>)> = inertial(report)
            .filter_map(|channel| {
                let record = channel.assessment.record.iter().find(|record| record.kind == kind)?;
                Some((channel.name.as_str(), record.more_hours))
            })
            .collect();
        let hidden: Vec<String> =
            said.iter().filter(|(_, hours)| hours.is_none()).map(|(name, _)| (*name).to_owned()).collect();
        let most = said.iter().filter_map(|(_, hours)| *hours).fold(0.0, f64::max);
        if said.is_empty() {
            continue;
        } else if hidden.len() == said.len() {
            nowhere.push(letter.to_owned());
            continue;
        } else if most > 0.0 {
            longer.push((letter, hours(most)));
        } else if hidden.is_empty() {
            known.push(letter.to_owned());
        }
        if !hidden.is_empty() {
            somewhere.push(format!("{letter} does not show in {}", channel_list(&hidden)));
        }
    }
    // Of the three, N is known first.
    let too_short = known.is_empty() && longer.first().is_some_and(|(letter, _)| *letter == LETTERS[0].1);
    let longer: Vec<String> = match longer.as_slice() {
        [] => Vec::new(),
        [(letter, first), rest @ ..] => {
            let first = format!("{letter} takes {first} more");
            std::iter::once(first).chain(rest.iter().map(|(letter, hours)| format!("{letter} {hours} more"))).collect()
        }
    };
    let are = |letters: &[String], one: &str, several: &str| {
        if letters.len() == 1 { one.to_owned() } else { several.to_owned() }
    };
    [
        (!known.is_empty()).then(|| format!("{} {} known to ±20 %.", enumerated(&known), are(&known, "is", "are"))),
        too_short.then(|| "Too short for ±20 % of any coefficient.".to_owned()),
        (!longer.is_empty()).then(|| format!("For ±20 %, {}.", enumerated(&longer))),
        (!nowhere.is_empty()).then(|| {
            format!(
                "{} {} not show: the record bounds {} from above.",
                enumerated(&nowhere),
                are(&nowhere, "does", "do"),
                are(&nowhere, "it", "them")
            )
        }),
        (!somewhere.is_empty()).then(|| format!("{}.", enumerated(&somewhere))),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Which models of the first half are those of its later quarter; `None` where none is.
fn recent_fit(report: &Report) -> Option<String> {
    let recent: Vec<String> =
        inertial(report).filter(|channel| is_fitted_to_later_quarter(channel)).map(|of| of.name.clone()).collect();
    (!recent.is_empty()).then(|| {
        format!(
            "The noise changes: the error of {} is that of a fit to the later quarter of the first half.",
            channel_list(&recent)
        )
    })
}

/// What the errors mean where there are spikes or knocks, and what they are without them; `None` where there are none.
fn without_events(report: &Report) -> Option<String> {
    let excluding = inertial(report).filter_map(|channel| {
        let [before, after] = [&channel.before, &channel.after].map(|model| model.unseen_excluding.as_ref());
        let change = error_change([before?, after?].map(|error| error.deviance_per_point));
        Some(format!("{} {change}", channel_list(std::slice::from_ref(&channel.name))))
    });
    let excluding: Vec<String> = excluding.collect();
    (!excluding.is_empty()).then(|| {
        format!(
            "The errors are on the data as recorded; the models after foretell its spikes and knocks at the rate of the first half. \
             Without them: {}.",
            excluding.join(", ")
        )
    })
}

/// Whether the model `after` of a channel is fitted to the later quarter of the first half instead of to all of it.
#[must_use]
pub fn is_fitted_to_later_quarter(channel: &ChannelReport) -> bool {
    channel.nonstationarity.as_ref().is_some_and(|of| of.fitted_to == FittedPart::LaterQuarter)
}

/// Hours with two digits.
fn hours(hours: f64) -> String {
    match hours {
        hours if hours < 1.0 => span(3600.0 * hours),
        hours if hours < 10.0 => format!("{} h", significant(hours, 2)),
        hours if hours < 72.0 => format!("{hours:.0} h"),
        hours => format!("{:.0} days", hours / 24.0),
    }
}

/// Magnetometers, temperature and supply: conditions, one text each.
#[must_use]
pub fn conditions(report: &Report) -> Vec<String> {
    let moved = |name: &str, label: &str| {
        let channel = report.channels.iter().find(|channel| channel.name == name)?;
        let bias = channel.figure_data.bias_over_time.as_ref()?;
        let (low, high) = bias
            .mean
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| (value.min(low), value.max(high)));
        Some(match high - low {
            0.0 => format!("{label} did not change"),
            range => format!("{label} moved by {}", quantity(range, &channel.unit)),
        })
    };
    let unknown = report.channels.iter().all(|channel| channel.name != "temp");
    [
        moved("temp", "temperature"),
        unknown.then(|| "temperature was not recorded".to_owned()),
        moved("supply", "supply"),
    ]
    .into_iter()
    .flatten()
    .chain(magnetometers(report))
    .collect()
}

/// N of the magnetometers, and those whose noise is not that of N, B and K: a bound on N by a model that fails says nothing.
fn magnetometers(report: &Report) -> Vec<String> {
    let all = report.channels.iter().filter(|channel| channel.name.starts_with("magn_"));
    let (failed, described): (Vec<_>, Vec<_>) = all.partition(|channel| is_high(channel));
    let noise: Vec<(String, Parameter)> =
        described.iter().filter_map(|of| Some((of.name.clone(), coefficient(of, LETTERS[0].0)?))).collect();
    let mut told = Vec::new();
    if let Some((_, first)) = noise.first() {
        let sizes = noise.iter().map(|(_, n)| if n.value > 0.0 { n.value } else { n.high });
        let (prefix, factor) = column_prefix(sizes);
        let each: Vec<String> =
            noise.iter().map(|(_, n)| estimate(n.value / factor, n.low / factor, n.high / factor)).collect();
        let names: Vec<String> = noise.iter().map(|(name, _)| name.clone()).collect();
        told.push(format!("{} N {} {prefix}{}", channel_list(&names), each.join(", "), unit(&first.unit)));
    }
    if !failed.is_empty() {
        let names: Vec<String> = failed.iter().map(|channel| channel.name.clone()).collect();
        told.push(format!("the noise of {} is not that of N, B and K", channel_list(&names)));
    }
    told
}

/// The findings in words, in the order of the report, those that nothing explains apart.
#[must_use]
pub fn findings(report: &Report) -> (Vec<FindingText>, Vec<FindingText>) {
    let (unexplained, named): (Vec<_>, Vec<_>) =
        report.findings.iter().partition(|finding| matches!(finding.effect, Effect::Unexplained(_)));
    let of_inertial = |finding: &&&noise_analysis::report::Finding| {
        finding.channels.iter().any(|name| name.starts_with("gyro_") || name.starts_with("accl_"))
    };
    // A cause in a gyro or an accelerometer comes before one in a channel that is a condition.
    let (inertial, others): (Vec<_>, Vec<_>) = named.into_iter().partition(|finding| of_inertial(&finding));
    let words = |list: Vec<&noise_analysis::report::Finding>| {
        let text = |finding| {
            let mut text = describe(finding);
            if let Some(related) = related_line(report, finding) {
                text.weight =
                    [text.weight, related].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ");
            }
            text
        };
        list.into_iter().map(text).collect::<Vec<_>>()
    };
    (words(inertial.into_iter().chain(others).collect()), words(unexplained))
}

/// Largest difference of the frequency of a finding from that of a line that is followed, as a part of it: half of the distance to
/// the next whole ratio that is tried.
const SAME_LINE: f64 = 0.1;

/// The line of another channel that moves with the line of a finding; `None` where none does.
fn related_line(report: &Report, finding: &noise_analysis::report::Finding) -> Option<String> {
    let frequency = finding.effect.frequency_hz()?.value;
    let of = finding.channels.iter().find_map(|name| {
        let channel = report.channels.iter().find(|channel| channel.name == *name)?;
        let related = channel.nonstationarity.as_ref()?.related_line.as_ref()?;
        let followed = related.line_hz.iter().sum::<f64>() / related.line_hz.len().max(1) as f64;
        ((frequency / followed - 1.0).abs() < SAME_LINE).then_some(related)
    })?;
    let other = channel_list(std::slice::from_ref(&of.channel));
    let at = match of.ratio {
        (1, 1) => "at the same frequency".to_owned(),
        (above, below) => format!("at {above}/{below} of the frequency"),
    };
    Some(format!("a line of {other} moves with it, {at}"))
}

/// What the data contradicts, one text each, the most serious first.
#[must_use]
pub fn contradictions(report: &Report) -> Vec<String> {
    let mut told = Vec::new();
    let channels = inertial(report).count() as f64;
    let is_far_off = |channel: &ChannelReport, sigma: f64| {
        let fitted = if is_fitted_to_later_quarter(channel) { FITTED_TO_QUARTER } else { FITTED_TO_HALF };
        let octaves = channel.curve.len() as f64;
        sigma.abs() > (1.0 + fitted).sqrt() * quantile(CHANCE / 2.0 / (channels * octaves).max(1.0))
    };
    let mut far: Vec<(&ChannelReport, &ModelErrorReport, f64)> = inertial(report)
        .filter_map(|channel| {
            let error = &channel.after.unseen;
            let sigma = error.worst_sigma.filter(|&sigma| is_far_off(channel, sigma))?;
            Some((channel, error, sigma))
        })
        .collect();
    far.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
    for (channel, error, sigma) in &far {
        let (Some(tau), Some(ratio)) = (error.worst_tau_s, error.worst_ratio) else { continue };
        let change = 100.0 * (1.0 / ratio - 1.0);
        let amount = if change.abs() < 100.0 {
            format!("{}{} %", if change < 0.0 { "−" } else { "+" }, significant(change.abs(), 2))
        } else {
            format!("{} times", significant(1.0 / ratio, 2))
        };
        told.push(format!(
            "{} at τ = {}: measured {amount} against the model ({} σ)",
            channel_list(std::slice::from_ref(&channel.name)),
            span(tau),
            significant(sigma.abs(), 2)
        ));
    }
    for channel in inertial(report) {
        let Some((spectrum, fit)) =
            channel.assessment.angle_random_walk_by_spectrum.as_ref().zip(coefficient(channel, LETTERS[0].0))
        else {
            continue;
        };
        if spectrum.low > fit.high || spectrum.high < fit.low {
            let percent = 100.0 * (spectrum.value / fit.value - 1.0);
            told.push(format!(
                "{}: the spectrum gives N {} % {} than the fit",
                channel_list(std::slice::from_ref(&channel.name)),
                significant(percent.abs(), 2),
                if percent < 0.0 { "lower" } else { "higher" }
            ));
        }
    }
    let is_unsure = |of: &Innovations| channels * of.chance_of_small_claim() < CHANCE;
    let unsure: Vec<String> = inertial(report)
        .filter(|channel| channel.assessment.innovations.as_ref().is_some_and(is_unsure))
        .map(|channel| channel.name.clone())
        .collect();
    if !unsure.is_empty() {
        told.push(format!(
            "a Kalman filter with the models of {} would claim a smaller error than it has",
            channel_list(&unsure)
        ));
    }
    told
}

/// What to do next, the most useful first.
#[must_use]
pub fn next_steps(report: &Report) -> Vec<String> {
    let mut weighed: Vec<(f64, FindingText)> = report
        .findings
        .iter()
        .filter(|finding| !matches!(finding.effect, Effect::Unexplained(_)))
        .map(|finding| (finding.share_percent.values().copied().fold(0.0, f64::max), describe(finding)))
        .collect();
    weighed.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut steps: Vec<String> = Vec::new();
    for step in weighed.into_iter().filter_map(|(_, text)| text.step) {
        if !steps.contains(&step) {
            steps.push(step);
        }
    }
    steps.truncate(3);
    if inertial(report).next().is_some() {
        steps.push("For a filter: add --export kalibr=imu.yaml.".to_owned());
    }
    steps.extend(failures(report));
    steps
}

/// The models that fail on the unseen half. Where the first half's own curve fails too, no model of the first half can hold: the
/// noise has changed. Where it does not, the model lacks something.
fn failures(report: &Report) -> Vec<String> {
    let own_curve = |channel: &ChannelReport| channel.first_half_curve.deviance_per_point;
    let failed = || inertial(report).filter(|channel| is_high(channel));
    let told = |wanted: &dyn Fn(Option<f64>) -> bool, reason: &dyn Fn(&str) -> String| {
        let channels: Vec<&ChannelReport> = failed().filter(|channel| wanted(own_curve(channel))).collect();
        let names: Vec<String> = channels.iter().map(|channel| channel.name.clone()).collect();
        let (low, high) = channels
            .iter()
            .filter_map(|channel| own_curve(channel))
            .fold((f64::INFINITY, 0.0_f64), |(low, high), of| (low.min(of), high.max(of)));
        let (low, high) = (significant(low, 2), significant(high, 2));
        let range = if low == high { low } else { format!("{low} … {high}") };
        (!names.is_empty())
            .then(|| format!("! The model of {} fails on the unseen half{}", channel_list(&names), reason(&range)))
    };
    let changed = |own: Option<f64>| own.is_some_and(|own| own > HIGH_DEVIANCE);
    let lacking = |own: Option<f64>| own.is_some_and(|own| own <= HIGH_DEVIANCE);
    [
        told(&changed, &|range| format!(", and so does the first half's own curve ({range}): the noise has changed.")),
        told(&lacking, &|range| {
            format!(
                ": its error is far above 1. The first half's own curve holds ({range}): the model lacks something."
            )
        }),
        told(&|own| own.is_none(), &|_| ": its error is far above 1.".to_owned()),
    ]
    .into_iter()
    .flatten()
    .collect()
}
