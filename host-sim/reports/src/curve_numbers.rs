//! The measured curve and the models in numbers.

use crate::formatting::{count, number};
use crate::rounding::{NONE, Scale, significant, supported_digits};
use noise_analysis::report::ChannelReport;

/// Headings and one row per point; deviations have the digits of the measured interval.
pub(crate) fn curve_numbers(channel: &ChannelReport) -> (Vec<String>, Vec<Vec<String>>) {
    let is_same = channel.after == channel.before;
    let scale = Scale::new(channel.curve.iter().map(|point| point.adev), &channel.unit);
    let deviation = format!("σ(τ), {}", scale.unit);
    let models = if is_same { &["model"][..] } else { &["before", "after"] };
    let headings = ["n", "τ, s", &deviation, "low", "high", "edf", "accuracy, %", "by PSD"];
    let headings = headings.iter().chain(models).map(|heading| (*heading).to_owned()).collect();
    let rows = channel.curve.iter().enumerate().map(|(index, point)| {
        let digits = supported_digits(point.adev, point.low, point.high);
        let shown = |value: Option<f64>| value.map_or_else(|| NONE.to_owned(), |value| scale.number(value, digits));
        let mut row = vec![count(point.n), number(point.tau_s)];
        row.extend([point.adev, point.low, point.high].map(|value| shown(Some(value))));
        row.extend([significant(point.edf, 3), significant(point.accuracy_percent, 2)]);
        row.push(shown(point.adev_by_spectrum));
        row.push(shown(channel.before.adev.get(index).copied()));
        if !is_same {
            row.push(shown(channel.after.adev.get(index).copied()));
        }
        row
    });
    (headings, rows.collect())
}
