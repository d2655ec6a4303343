//! The sentences of `sentences.txt`, filled with the numbers of an effect.

use super::amounts::{Amounts, Label};
use super::channel_names::channel_list;
use super::departure::{departure, excess_percent};
use super::shown_effect::ShownEffect;
use crate::formatting::{capital, count, enumerated, moment};
use crate::rounding::{estimate, plain, probability, quantity, quantity_digits, signed, significant, span};
use noise_analysis::bounds::Parameter;
use noise_analysis::effects::Effect;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::f64::consts::SQRT_2;

/// Encloses what the brief form leaves out.
pub(super) const DETAIL: char = '|';
const SENTENCES: &str = include_str!("sentences.txt");
/// Likelihood ratio from which no number is given.
const MILLION: f64 = 1e6;

/// The numbers of an effect: evidence and parameters as in its JSON, and what follows from them.
pub(crate) struct Sentences<'a> {
    kind: &'static str,
    numbers: Value,
    parameters: BTreeMap<&'static str, Parameter>,
    amounts: Amounts<'a>,
}

/// The lines below the first heading `name` whose conditions hold; none without one.
fn block(name: &str, numbers: &Value) -> Vec<String> {
    let is_chosen = |block: &&str| {
        let mut heading = block.lines().next().unwrap_or_default().split(' ');
        heading.next() == Some(name) && heading.all(|condition| holds(condition, numbers))
    };
    let found = SENTENCES.split("\n\n").find(is_chosen).unwrap_or_default().replace("\n  ", " ");
    found.lines().skip(1).map(str::to_owned).collect()
}

/// `path` that is there, and neither false nor 0; `path=text`; `path<number`.
fn holds(condition: &str, numbers: &Value) -> bool {
    if let Some((path, expected)) = condition.split_once('=') {
        return at(numbers, path).is_some_and(|of| text(of) == expected);
    }
    if let Some((path, limit)) = condition.split_once('<') {
        return limit.parse().is_ok_and(|limit: f64| number(at(numbers, path)) < limit);
    }
    let of = at(numbers, condition);
    !matches!(of, None | Some(Value::Null | Value::Bool(false))) && number(of) != 0.0
}

fn at<'v>(numbers: &'v Value, path: &str) -> Option<&'v Value> {
    if path.is_empty() { Some(numbers) } else { numbers.pointer(&format!("/{}", path.replace('.', "/"))) }
}

/// A number, or the value of a parameter; JSON has `null` for infinity.
fn number(of: Option<&Value>) -> f64 {
    match of {
        Some(Value::Null) => f64::INFINITY,
        of => of.and_then(|of| of.get("value").unwrap_or(of).as_f64()).unwrap_or(f64::NAN),
    }
}

fn text(of: &Value) -> String {
    of.as_str().map_or_else(|| number(Some(of)).to_string(), str::to_owned)
}

/// A time in s with three decimals, below 0.1 s with four.
fn seconds(tau: f64) -> String {
    if tau < 0.1 { format!("{tau:.4}") } else { format!("{tau:.3}") }
}

/// Percent, or ppm below 0.01 %.
fn relative(difference: f64) -> String {
    let (factor, unit) = if difference.abs() < 1e-4 { (1e6, "ppm") } else { (100.0, "%") };
    format!("{} {unit}", signed(factor * difference, 2))
}

fn odds(p_value: f64) -> String {
    match 1.0 / p_value {
        odds if odds >= 1e15 => "chance does not explain it".to_owned(),
        odds if odds >= 2.0 => format!("chance explains it once in {} times", significant(odds, 2)),
        _ => "chance explains it".to_owned(),
    }
}

/// `+.1` with a sign, `abs.0` without, `.2` as it is.
fn decimals(value: f64, form: &str) -> String {
    let (head, digits) = form.split_once('.').unwrap_or_default();
    let digits = digits.parse().unwrap_or(0);
    match head {
        "+" => format!("{value:+.digits$}"),
        "abs" => format!("{:.digits$}", value.abs()),
        _ => format!("{value:.digits$}"),
    }
}

impl<'a> Sentences<'a> {
    /// Of `effect`, with each channel's numbers in `shown`.
    pub(crate) fn new(effect: &Effect, shown: &'a [ShownEffect<'a>], label: Label, is_brief: bool) -> Self {
        let amounts = Amounts { shown, label, is_brief };
        let parameters = effect.parameters();
        let mut numbers = match serde_json::to_value(effect) {
            Ok(Value::Object(numbers)) => numbers,
            _ => Map::new(),
        };
        numbers.extend(parameters.iter().map(|(name, of)| ((*name).to_owned(), json!(of))));
        let derived = derived(effect, &amounts).into_iter().chain([("limits", json!(limits(&amounts)))]);
        numbers.extend(derived.map(|(name, of)| (name.to_owned(), of)));
        Self { kind: effect.name(), numbers: Value::Object(numbers), parameters, amounts }
    }

    /// Of something else with the numbers of its JSON.
    pub(crate) fn of(kind: &'static str, numbers: &impl Serialize) -> Self {
        let amounts = Amounts { shown: &[], label: Label::Nothing, is_brief: false };
        let numbers = serde_json::to_value(numbers).unwrap_or_default();
        Self { kind, numbers, parameters: BTreeMap::new(), amounts }
    }

    pub(crate) fn with(mut self, name: &str, text: impl Into<Value>) -> Self {
        self.numbers[name] = text.into();
        self
    }

    /// Physics, advice and evidence, as they stand in the file.
    pub(super) fn lines(&self) -> Vec<String> {
        block(self.kind, &self.numbers)
    }

    /// The line at this position, filled.
    pub(crate) fn sentence(&self, position: usize) -> Option<String> {
        self.lines().get(position).map(|line| self.filled(line))
    }

    /// `template` with the numbers at its places.
    pub(super) fn filled(&self, template: &str) -> String {
        self.filled_with(template, &self.numbers)
    }

    fn filled_with(&self, template: &str, numbers: &Value) -> String {
        let mut pieces = template.split('{');
        let first = pieces.next().unwrap_or_default().to_owned();
        let filled = |piece: &str| piece.split_once('}').map(|(place, text)| self.place(place, numbers) + text);
        first + &pieces.filter_map(filled).collect::<String>()
    }

    fn place(&self, place: &str, numbers: &Value) -> String {
        if let Some(name) = place.strip_prefix('@') {
            let (name, path) = name.split_once(' ').unwrap_or((name, ""));
            let part = at(numbers, path).unwrap_or(&Value::Null);
            return block(name, part).first().map_or_else(String::new, |line| self.filled_with(line, part));
        }
        if let Some((condition, texts)) = place.split_once('?') {
            let (yes, no) = texts.split_once('|').unwrap_or((texts, ""));
            return (if holds(condition, numbers) { yes } else { no }).to_owned();
        }
        let (name, form) = place.split_once(':').unwrap_or((place, ""));
        let (factor, name) = name.split_once('*').unwrap_or(("1", name));
        let factor = factor.parse().unwrap_or(f64::NAN);
        match name.strip_prefix("1/") {
            Some(name) => self.amount(name, form, at(numbers, name), |of| 1.0 / of),
            None => self.amount(name, form, at(numbers, name), |of| factor * of),
        }
    }

    fn amount(&self, name: &str, form: &str, of: Option<&Value>, scaled: impl Fn(f64) -> f64) -> String {
        let value = scaled(number(of));
        let parameter = self.parameters.get(name);
        let unit = parameter.map_or("", |of| of.unit.as_str());
        let array = of.and_then(Value::as_array);
        let list = || -> Vec<String> { array.into_iter().flatten().map(text).collect() };
        if let Some(one) = form.strip_prefix("counted ") {
            return format!("{value} {one}{}", if value == 1.0 { "" } else { "s" });
        }
        match form {
            "" => parameter.map_or_else(|| of.map_or_else(|| "–".to_owned(), text), |of| self.amounts.one(of)),
            "raw" => of.map_or_else(String::new, text),
            "no unit" => parameter.map_or_else(String::new, |of| self.amounts.one(&of.estimate().parameter(""))),
            "each" => self.amounts.each(name),
            "each %" => self.amounts.each_as(name, Some("%"), 100.0),
            "each √2" => self.amounts.each_as(name, None, SQRT_2),
            "unit" => unit.to_owned(),
            "amount" => quantity_digits(value, unit, 3),
            "rounded" => quantity(value, unit),
            "moment" => moment(value),
            "span" => span(value),
            "seconds" => seconds(value),
            "plain" => plain(value, 3),
            "estimate" => {
                estimate(value, number(of.and_then(|of| of.get("low"))), number(of.and_then(|of| of.get("high"))))
            }
            "s" => quantity(value, "s"),
            "signed" => signed(value, 2),
            "count" => count(value as u64),
            "odds" => odds(value),
            "rate" => plain(value, 6),
            "nominal" => plain(value, 4),
            "two digits" => significant(value, 2),
            "three digits" => significant(value, 3),
            "four digits" => significant(value, 4),
            "relative" => relative(value),
            "chance" => probability(value).replace('<', "below"),
            // Likelihood ratio of a gain in ln.
            "likelier" if value > MILLION.ln() => "more than a million".to_owned(),
            "likelier" => significant(value.exp(), 2),
            "enumerated" => enumerated(&list()),
            "channels" => enumerated(&list().iter().map(|name| channel_list([name])).collect::<Vec<_>>()),
            "channel" => channel_list([of.map_or_else(String::new, text)]),
            "Channel" => capital(&channel_list([of.map_or_else(String::new, text)])),
            "alternatives" => list().join(" or "),
            "joined" => list().join(" and "),
            "listed" => list().join(", "),
            "length" => list().len().to_string(),
            form => decimals(value, form),
        }
    }
}

/// A remark on sensitivities of which only a bound is known.
fn limits(amounts: &Amounts) -> String {
    let bounded = channel_list(amounts.with_bound_alone("sensitivity"));
    if bounded.is_empty() {
        return bounded;
    }
    format!(" Subtract nothing in {bounded}: the record gives a limit only.")
}

/// What follows from the numbers of an effect.
fn derived(effect: &Effect, amounts: &Amounts) -> Vec<(&'static str, Value)> {
    match effect {
        Effect::OutputFilter(of) => vec![("sample_rate_hz", json!(of.internal_rate_hz / of.decimation.value))],
        Effect::SharedDrift(of) => {
            let shown = amounts.shown.iter().filter_map(|shown| match shown.effect {
                Effect::SharedDrift(of) => Some(of.with),
                _ => None,
            });
            let mut others = vec![of.with];
            shown.for_each(|other| {
                if !others.contains(&other) {
                    others.push(other);
                }
            });
            vec![("all_others", json!(channel_list(others)))]
        }
        Effect::TurnOnTransient(of) => {
            // After ln 100 time constants a hundredth is left.
            let longest = amounts.largest("time_constant", of.time_constant_s.value);
            vec![("settled", json!(span(4.6 * longest)))]
        }
        Effect::AccelerationSensitivity(_) => {
            let names = ["x", "y", "z"].map(|axis| (axis, format!("sensitivity_{axis}")));
            let is_shown = |name: &str| amounts.shown.iter().any(|of| of.effect.parameters().contains_key(name));
            let axes = names.iter().filter(|(_, name)| is_shown(name));
            let axes: Vec<String> = axes.map(|(axis, name)| format!("along {axis} {}", amounts.each(name))).collect();
            let others: String = axes.iter().skip(1).map(|axis| format!("{DETAIL}; {axis}{DETAIL}")).collect();
            vec![("axes", json!(axes.first().cloned().unwrap_or_default() + &others))]
        }
        Effect::VibrationRectification(of) => vec![("vibration", json!(quantity_digits(of.strongest, of.per, 3)))],
        Effect::NoisyInterval(of) => vec![("length_s", json!(of.to_s.value - of.from_s.value))],
        Effect::MotionInterval(of) => vec![("length_s", json!(of.to_s.value - of.from_s.value))],
        Effect::ClockDeviation(of) => vec![
            ("difference", json!(of.rate_hz.value / of.nominal_hz - 1.0)),
            ("nominal", json!(quantity_digits(of.nominal_hz, "Hz", 4))),
        ],
        Effect::Unexplained(of) => {
            let known = effect.parameters();
            let absent = ["excess_percent", "tau", "frequency"].into_iter().filter(|name| !known.contains_key(name));
            let place = capital(&departure(of, &excess_percent(amounts.shown)));
            absent.map(|name| (name, json!(0.0))).chain([("departure", json!(place))]).collect()
        }
        _ => Vec::new(),
    }
}
