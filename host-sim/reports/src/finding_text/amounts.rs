//! Numbers of a finding in a sentence: one, or each channel's.

use super::channel_names::channel_list;
use super::shown_effect::ShownEffect;
use crate::rounding::{Scale, bounded_quantity, is_upper_bound, parameter_magnitude, rounded_quantity};
use noise_analysis::report::Parameter;
use std::f64::consts::FRAC_1_SQRT_2;

/// Significant digits of the numbers of a brief sentence.
const BRIEF_DIGITS: i32 = 2;

pub(super) struct Amounts<'a> {
    /// The effect in every channel.
    pub shown: &'a [ShownEffect<'a>],
    pub label: Label,
    pub is_brief: bool,
}

/// Text before a channel's number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Label {
    Nothing,
    /// All gyros, or all accelerometers: the axis.
    Axis,
    Channel,
}

impl Label {
    pub(super) fn new(channels: &[String]) -> Self {
        match channels {
            [] | [_] => Self::Nothing,
            [first, others @ ..] if others.iter().all(|other| sensor(other) == sensor(first)) => Self::Axis,
            _ => Self::Channel,
        }
    }
}

/// `gyro_` of `gyro_z`; the name itself without an axis.
fn sensor(channel: &str) -> &str {
    channel.rfind('_').map_or(channel, |at| &channel[..=at])
}

struct OfChannel<'a> {
    channel: &'a str,
    parameter: Parameter,
}

impl Amounts<'_> {
    pub(super) fn one(&self, parameter: &Parameter) -> String {
        if self.is_brief { rounded_quantity(parameter) } else { bounded_quantity(parameter) }
    }

    /// `0.27 °/s` of one channel, `x 21.2, y 11.9, z −27.8 m°/s/°C` of several.
    pub(super) fn each(&self, name: &str) -> String {
        self.each_as(name, None, 1.0)
    }

    /// Times a positive `factor`, perhaps in another unit.
    pub(super) fn each_as(&self, name: &str, unit: Option<&str>, factor: f64) -> String {
        let converted = self.parameters(name).map(|of| {
            let parameter = scaled(of.parameter, factor);
            let unit = unit.map_or(parameter.unit, str::to_owned);
            OfChannel { parameter: Parameter { unit, ..parameter }, ..of }
        });
        let each: Vec<OfChannel<'_>> = converted.collect();
        match &each[..] {
            [one] if self.label == Label::Nothing => self.one(&one.parameter),
            each => self.list(each),
        }
    }

    pub(super) fn largest(&self, name: &str, least: f64) -> f64 {
        self.parameters(name).map(|of| of.parameter.value).fold(least, f64::max)
    }

    /// Channels in which the parameter may be 0 or of either sign.
    pub(super) fn with_bound_alone(&self, name: &str) -> Vec<String> {
        let is_bound = |of: &OfChannel| of.parameter.low <= 0.0 && of.parameter.high >= 0.0;
        self.parameters(name).filter(is_bound).map(|of| of.channel.to_owned()).collect()
    }

    /// A line with a width in some channels has an amplitude in the others: √2 times the deviation.
    fn parameters(&self, name: &str) -> impl Iterator<Item = OfChannel<'_>> {
        self.shown.iter().filter_map(move |&ShownEffect { channel, effect }| {
            let mut parameters = effect.parameters();
            let parameter = match (parameters.remove(name), name) {
                (None, "deviation") => scaled(parameters.remove("amplitude")?, FRAC_1_SQRT_2),
                (own, _) => own?,
            };
            Some(OfChannel { channel, parameter })
        })
    }

    /// One prefix per unit, the unit behind the last number, the sensor before the first; equal numbers once.
    fn list(&self, each: &[OfChannel]) -> String {
        let is_alike = |one: &OfChannel, other: &OfChannel| {
            sensor(one.channel) == sensor(other.channel) && one.parameter.unit == other.parameter.unit
        };
        let groups: Vec<&[OfChannel]> = each.chunk_by(is_alike).collect();
        let written: Vec<Group> = groups.iter().map(|group| self.group(group)).collect();
        if let Some(same) = same_for_all(&written).filter(|_| each.len() > 1) {
            return format!("{same} each");
        }
        let name = |position: usize, channel: &str| match channel.trim_start_matches(sensor(channel)) {
            axis if (position > 0 || self.label == Label::Axis) && !axis.is_empty() => axis.to_owned(),
            _ => channel_list([channel]),
        };
        let text = |(group, Group { numbers, unit }): (&&[OfChannel], &Group)| {
            let named = group.iter().zip(numbers).enumerate();
            let named: Vec<String> =
                named.map(|(at, (of, number))| format!("{} {number}", name(at, of.channel))).collect();
            format!("{} {unit}", named.join(", ")).trim_end().to_owned()
        };
        groups.iter().zip(&written).map(text).collect::<Vec<_>>().join(", ")
    }

    fn group(&self, group: &[OfChannel]) -> Group {
        let magnitudes = group.iter().map(|of| parameter_magnitude(&of.parameter));
        let scale = Scale::new(magnitudes, &group[0].parameter.unit);
        let number = |of: &OfChannel| match &of.parameter {
            of if self.is_brief && !is_upper_bound(of.value, of.low) => scale.number(of.value, BRIEF_DIGITS),
            of => scale.estimate(of),
        };
        Group { numbers: group.iter().map(number).collect(), unit: scale.unit.clone() }
    }
}

struct Group {
    numbers: Vec<String>,
    unit: String,
}

fn same_for_all(groups: &[Group]) -> Option<String> {
    let first = groups.first()?;
    let number = first.numbers.first()?;
    let is_same = |group: &Group| group.unit == first.unit && group.numbers.iter().all(|other| other == number);
    groups.iter().all(is_same).then(|| format!("{number} {}", first.unit).trim_end().to_owned())
}

fn scaled(Parameter { value, low, high, unit }: Parameter, factor: f64) -> Parameter {
    Parameter { value: factor * value, low: factor * low, high: factor * high, unit }
}
