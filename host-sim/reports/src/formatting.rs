//! Numbers, units, names and tables as the terminal, the figures and the page show them.

use crate::line_breaks::broken;
use crate::rounding::{NONE, grouped, quantity_digits, significant, span};
use comfy_table::{Table, presets};
use noise_analysis::report::assessment::{Innovations, RecordLength};
use noise_analysis::report::{ChannelReport, MissingSamples, ModelErrorReport, ModelReport};
use std::collections::BTreeMap;

/// Four significant digits; [`NONE`] if not finite.
pub fn number(value: f64) -> String {
    let is_usual = value == 0.0 || (1e-9..1e15).contains(&value.abs());
    if is_usual || !value.is_finite() { significant(value, 4) } else { format!("{value:.3e}") }
}

pub fn optional(value: Option<f64>) -> String {
    value.map_or_else(|| NONE.to_owned(), number)
}

pub fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| NONE.to_owned(), |value| format!("{} %", number(value)))
}

/// A whole number with its thousands separated: `1,000,000`.
pub fn count(value: u64) -> String {
    grouped(&value.to_string())
}

/// Counts above 0 with their causes: `repeated 3, no new data 1`.
pub(crate) fn by_cause(counts: &BTreeMap<String, u64>) -> String {
    let counted = counts.iter().filter(|(_, samples)| **samples > 0);
    counted.map(|(cause, samples)| format!("{} {}", words(cause), count(*samples))).collect::<Vec<_>>().join(", ")
}

/// The same with the cause behind: `3 repeated, 1 no new data`.
pub(crate) fn of_each_cause<'a>(counts: impl IntoIterator<Item = (&'a String, &'a u64)>) -> String {
    let counted = counts.into_iter().filter(|(_, samples)| **samples > 0);
    counted.map(|(cause, samples)| format!("{} {}", count(*samples), words(cause))).collect::<Vec<_>>().join(", ")
}

/// Lost, refused and replaced samples of a channel in one sentence; empty without any.
pub fn missing_samples(missing: &MissingSamples) -> String {
    let MissingSamples { lost, refused, replaced } = missing;
    let lost = (*lost > 0).then(|| format!("{} samples lost", count(*lost)));
    let refused = Some(by_cause(refused)).filter(|text| !text.is_empty()).map(|text| format!("refused: {text}"));
    let replaced = format!("{} replaced from their neighbours", count(*replaced));
    if lost.is_none() && refused.is_none() {
        return String::new();
    }
    lost.into_iter().chain(refused).chain([replaced]).collect::<Vec<_>>().join("; ")
}

/// A duration such as `2 h 46 min 40 s`; four digits below a minute.
pub fn duration(seconds: f64) -> String {
    // Exact up to 2^53.
    if !(59.5..9.0e15).contains(&seconds) {
        return quantity_digits(seconds, "s", 4);
    }
    let whole = seconds.round() as u64;
    let parts = [(whole / 86_400, "d"), (whole / 3600 % 24, "h"), (whole / 60 % 60, "min"), (whole % 60, "s")];
    let shown: Vec<String> = parts
        .iter()
        .filter(|(amount, _)| *amount > 0)
        .map(|(amount, unit)| format!("{} {unit}", count(*amount)))
        .collect();
    shown.join(" ")
}

/// A time of the record, to the second from a minute on: `7.0 s`, `16 min 40 s`.
pub fn moment(seconds: f64) -> String {
    if seconds < 59.5 { span(seconds) } else { duration(seconds) }
}

/// A range of numbers, such as `0.03890 … 0.03910`.
pub fn interval(low: f64, high: f64) -> String {
    format!("{} … {}", number(low), number(high))
}

/// Capitalised, except `σ`.
pub fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| [first.to_ascii_uppercase()].into_iter().chain(letters).collect())
}

pub(crate) fn enumerated(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// The number of places, if there are several, and one of them in words.
pub(crate) fn counted_places(all: usize, text: &str) -> String {
    if all == 1 { text.to_owned() } else { format!("{all} places; {text}") }
}

/// A name of the JSON schema as words: `angle_random_walk` becomes `angle random walk`.
pub fn words(name: &str) -> String {
    name.replace('_', " ")
}

/// The name of a parameter without its unit: `frequency_hz` becomes `frequency`, `value` becomes nothing.
pub fn parameter_name(name: &str) -> String {
    let bare = name.strip_suffix("_hz").or(name.strip_suffix("_s")).unwrap_or(name);
    match bare {
        "value" => String::new(),
        "at" => "time".to_owned(),
        name => words(name),
    }
}

/// p-value from which innovations are white.
const WHITE: f64 = 0.01;

/// Consistency of a Kalman filter by the variance and whiteness of its innovations.
pub fn filter_consistency(of: &Innovations) -> &'static str {
    match (of.normalised > of.high, of.normalised >= of.low, of.whiteness_p >= WHITE) {
        (true, _, true) => {
            "white, but larger than the model says: a Kalman filter would claim a smaller error than it has"
        }
        (true, _, false) => "larger than the model says, and not white: the model is not enough for a filter",
        (_, true, true) => "white and as large as the model says: enough for a filter",
        (_, true, false) => "as large as the model says, but not white: something with a memory is missing",
        (.., true) => "white, but smaller than the model says: a Kalman filter would claim a larger error than it has",
        (.., false) => "smaller than the model says, and not white",
    }
}

/// Deviation that is told, standard deviations; one in 800 records of a true model.
const FAR_OFF: f64 = 4.0;

/// The largest deviation of a model beyond chance from `data`; `None` without one.
pub fn worst_deviation(error: &ModelErrorReport, data: &str) -> Option<String> {
    let (sigma, tau, ratio) = (error.worst_sigma?, error.worst_tau_s?, error.worst_ratio?);
    let times = |factor: f64| match factor {
        factor if factor < 1.1 => format!("{} % above", significant(100.0 * (factor - 1.0), 2)),
        factor => format!("{} times", number(factor)),
    };
    let text = if ratio > 1.0 {
        format!("at τ = {} the model is {} what is measured in {data}", duration(tau), times(ratio))
    } else {
        format!("at τ = {} what is measured in {data} is {} the model", duration(tau), times(1.0 / ratio))
    };
    (sigma.abs() > FAR_OFF).then(|| format!("{text} ({} sigma)", number(sigma)))
}

pub fn worst_deviations(channel: &ChannelReport) -> Vec<String> {
    let (before, after) = (("before: ", &channel.before), ("after: ", &channel.after));
    let models = if channel.before == channel.after { vec![("", &channel.after)] } else { vec![before, after] };
    let told = |(name, model): (&str, &ModelReport)| {
        let halves = [(&model.fitted, "the fitted half"), (&model.unseen, "the unseen half")].into_iter();
        let told = halves.filter_map(|(error, data)| worst_deviation(error, data));
        told.map(|text| format!("{name}{text}")).collect::<Vec<_>>()
    };
    models.into_iter().flat_map(told).collect()
}

pub fn recording_advice(record: &RecordLength) -> String {
    let kind = words(&record.kind);
    match record.more_hours {
        Some(0.0) => format!("{kind}: the record is long enough for ±20 %"),
        Some(hours) => format!("{kind} to ±20 %: record {} more", duration(3600.0 * hours)),
        None => format!("{kind}: not shown by this record, or a month would not tell it to ±20 %"),
    }
}

/// Lines of at most `width` columns, indented by two after the first.
pub fn wrap(text: &str, width: usize) -> String {
    broken(text, width, "  ").join("\n")
}

pub(crate) fn plain_table<const COLUMNS: usize>(header: [&str; COLUMNS]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING).set_header(header);
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_significant_digits() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1.000"),
            (0.0368, "0.03680"),
            (0.001_234_4, "0.001234"),
            (0.000_123_44, "0.0001234"),
            (0.000_099_994, "0.00009999"),
            (0.000_099_996, "0.0001000"),
            (1.234_56e-5, "0.00001235"),
            (1.234_56e-7, "0.0000001235"),
            (9.999_6, "10.00"),
            (-273.149, "−273.1"),
            (9_999.6, "10,000"),
            (163.84, "163.8"),
            (524_288.0, "524,300"),
            (999_960.0, "1,000,000"),
            (1.5e6, "1,500,000"),
            (1.5e8, "150,000,000"),
            (f64::MAX, "1.798e308"),
            (f64::MIN_POSITIVE, "2.225e-308"),
            (f64::NAN, NONE),
            (f64::INFINITY, NONE),
        ] {
            assert_eq!(number(value), text, "{value:e}");
        }
    }

    #[test]
    fn counts_have_separated_thousands() {
        for (value, text) in [
            (0, "0"),
            (999, "999"),
            (1000, "1,000"),
            (49_425, "49,425"),
            (1_000_000, "1,000,000"),
            (u64::MAX, "18,446,744,073,709,551,615"),
        ] {
            assert_eq!(count(value), text);
        }
    }

    #[test]
    fn durations_are_split_into_days_hours_minutes_and_seconds() {
        for (value, text) in [
            (0.01, "10.00 ms"),
            (59.4, "59.40 s"),
            (59.7, "1 min"),
            (3600.0, "1 h"),
            (10_000.0, "2 h 46 min 40 s"),
            (90_061.0, "1 d 1 h 1 min 1 s"),
            (f64::NAN, NONE),
            (f64::INFINITY, NONE),
        ] {
            assert_eq!(duration(value), text);
        }
    }

    #[test]
    fn names_become_readable() {
        assert_eq!(words("angle_random_walk"), "angle random walk");
        assert_eq!([7.0, 1000.0].map(moment), ["7.0 s", "16 min 40 s"]);
        assert_eq!(parameter_name("value"), "");
        assert_eq!(parameter_name("frequency_hz"), "frequency");
        assert_eq!(parameter_name("correlation_time_s"), "correlation time");
        assert_eq!(parameter_name("at_s"), "time");
    }
}
