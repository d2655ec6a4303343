//! Temperature, supply and magnetometers in words.

use super::channels::is_constant;
use super::model_error::is_high;
use crate::coefficients::{CHANCE, KINDS, coefficient};
use crate::finding_text::channel_list;
use crate::rounding::{column_prefix, estimate, extremes, parameter_magnitude, quantity, unit};
use noise_analysis::distributions::quantile;
use noise_analysis::report::{BiasOverTime, ChannelReport, Parameter, Report};

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
