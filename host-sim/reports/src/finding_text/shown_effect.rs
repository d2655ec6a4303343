//! A finding as each channel shows it.

use noise_analysis::effects::Effect;
use noise_analysis::report::Report;

/// A finding as one of its channels shows it.
#[derive(Debug, Clone, Copy)]
pub struct ShownEffect<'a> {
    pub channel: &'a str,
    /// With the channel's own numbers.
    pub effect: &'a Effect,
}

/// The finding at `index`, in the order of its channels.
#[must_use]
pub fn shown_effects(report: &Report, index: usize) -> Vec<ShownEffect<'_>> {
    let of_channel = |name: &String| {
        let channel = report.channels.iter().find(|channel| channel.name == *name)?;
        let shown = channel.effects.iter().find(|shown| shown.finding == index)?;
        Some(ShownEffect { channel: &channel.name, effect: &shown.effect })
    };
    report.findings.get(index).into_iter().flat_map(|finding| &finding.channels).filter_map(of_channel).collect()
}
