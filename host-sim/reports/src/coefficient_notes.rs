//! Notes on how N, B and K were estimated, for the whole report.

use crate::finding_text::channel_list;
use crate::rounding::significant;
use noise_analysis::report::assessment::CoefficientsFrom;
use noise_analysis::report::{ChannelReport, Report};

/// Empty if the coefficients are as a reader expects.
pub fn coefficient_notes(report: &Report) -> Vec<String> {
    let named = |is_one: &dyn Fn(&ChannelReport) -> bool| {
        let names: Vec<&String> = report.channels.iter().filter(|of| is_one(of)).map(|of| &of.name).collect();
        (!names.is_empty()).then(|| channel_list(names))
    };
    let by_curve = named(&|channel| channel.assessment.coefficients_from == CoefficientsFrom::OctavesAgainstSamples);
    let by_curve = by_curve.map(|names| {
        format!(
            "N, B and K of {names} are those that the Allan deviation shows; a navigation filter takes these. A fit to all samples does not \
             describe it: the record has more than the model, such as noise that changes, a line that wanders or another filter."
        )
    });
    let share = |channel: &ChannelReport| {
        let shares = channel.curve.iter().filter(|point| point.adev > 0.0);
        shares.map(|point| (point.rounding / point.adev).powi(2)).fold(0.0, f64::max)
    };
    let rounded = named(&|channel| share(channel) > 0.0);
    let largest = report.channels.iter().map(share).fold(0.0, f64::max);
    let rounded = rounded.map(|names| {
        format!(
            "Samples of {names} change by less than a count from one to the next, so that their rounding errors are correlated: up to {} % of \
             the measured variance at short averaging times. The models have this share apart from N, B and K.",
            significant(100.0 * largest, 2)
        )
    });
    [by_curve, rounded].into_iter().flatten().collect()
}
