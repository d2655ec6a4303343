//! The channels of a report by what they measure.

use crate::finding_text::{SENSED, channel_list};
use noise_analysis::report::{ChannelReport, Report};

/// True for gyros and accelerometers.
pub(crate) fn is_inertial(name: &str) -> bool {
    SENSED[..2].iter().any(|prefix| name.starts_with(prefix))
}

pub(crate) fn inertial(report: &Report) -> impl Iterator<Item = &ChannelReport> {
    report.channels.iter().filter(|channel| is_inertial(&channel.name))
}

pub(crate) fn is_sensed(channel: &ChannelReport) -> bool {
    SENSED.iter().any(|prefix| channel.name.starts_with(prefix))
}

/// All samples equal, up to rounding of block means.
pub(super) fn is_constant(channel: &ChannelReport) -> bool {
    !channel.curve.is_empty() && channel.curve.iter().all(|point| point.adev == 0.0)
}

pub(super) fn inertial_names(report: &Report, is_so: impl Fn(&ChannelReport) -> bool) -> Option<String> {
    let names: Vec<&String> = inertial(report).filter(|channel| is_so(channel)).map(|channel| &channel.name).collect();
    (!names.is_empty()).then(|| channel_list(names))
}
